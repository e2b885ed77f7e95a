"""Motor torques that contradict the motion or what was demanded of them: which, and when none is named."""

import numpy as np
import pytest

from ecu.algorithm.control.blending import BLENDING_STATE
from ecu.algorithm.estimate import ESTIMATE
from ecu.algorithm.monitoring.accel_blocks import BLOCK_S
from ecu.algorithm.monitoring.accel_error import ACCEL_ERROR_STATE, APART_S
from ecu.algorithm.monitoring.acceleration import ACCELERATION_STATE
from ecu.algorithm.monitoring.motors import (
    ACCEL,
    DRIVES_ON,
    GAP,
    GAP_SHARE,
    LEAST_SPEED,
    MOTORS,
    MOTORS_WATCH_STATE,
    USUAL_GAP,
    USUAL_GAP_SHARE,
    compare_motors,
    deny_drive,
    watch_motors,
)
from ecu.algorithm.monitoring.witness import WITNESS_STATE
from ecu.contract.params import GRAVITY
from ecu.contract.signals import CORNERS, INPUT, MOTOR_TORQUE

DT = 0.01


class Car:
    """A car on a level road whose motors decelerate it by `decel` [m/s²] a wheel and linings by `lining`."""

    def __init__(self, params, feed) -> None:
        params["blending"] = 0.5
        self.p, self.feed, self.inputs = params[0], feed, feed()
        self.state, self.witness = np.zeros(1, MOTORS_WATCH_STATE)[0], np.zeros(1, WITNESS_STATE)[0]
        self.estimate, self.blending = np.zeros(1, ESTIMATE)[0], np.zeros(1, BLENDING_STATE)[0]
        self.estimate["measured"], self.estimate["mu"] = 1, 0.4
        self.lines, self.blocks = np.zeros(1, ACCEL_ERROR_STATE)[0], np.zeros(1, ACCELERATION_STATE)[0]
        self.unit = self.p["wheel_radius"] * self.p["mass"]
        self.base = np.full(4, 0.4)

    def drive(
        self, seconds: float, decel, reads=1.0, speed=20.0, lining=0.0, off=0.0, accel_offset=0.0, **inputs
    ) -> tuple[str, ...]:
        """Return the wheels whose motors are left out; they read `reads` times their torque, the car brakes
        by `off` [m/s²] more than all torques say."""
        decel, p = np.broadcast_to(decel, 4), self.p
        drag = p["drag_area"] * speed**2 / p["mass"] + p["rolling_resistance"] * GRAVITY
        accel = -(decel.sum() + 4.0 * lining + drag + off)
        self.lines["wheels"]["now"]["offset"], self.blocks["time"] = accel_offset, 0.05
        self.estimate["speed"], self.estimate["brake_torque"] = speed, lining * self.unit
        for _ in range(round(seconds / DT)):
            self.feed(
                self.inputs,
                accel_x=accel * (1.0 + GRAVITY * p["pitch_gradient"]),
                motor_torque=np.broadcast_to(reads, 4) * decel * self.unit,
                **inputs,
            )
            watch_motors(
                *(p, self.state, self.witness, self.inputs[0], self.estimate, self.base),
                *(self.lines, self.blocks, DT),
            )
        return self.rejected()

    def known(self, seconds: float, decel, reads=1.0, apart: float | None = None, **lines) -> tuple[str, ...]:
        """Return the wheels whose motors are left out, where what the car does at each torque is known.

        They read `reads` times their torque; `apart` [m/s²]: from what it usually does, else by that.
        """
        decel, reads = np.broadcast_to(decel, 4), np.broadcast_to(reads, 4)
        self.lines["torques"]["offset_s"], self.blocks["known_blocks"] = 20.0, 5
        self.blocks["mean"][0] = -decel.sum(), 20.0, -(reads * decel).sum(), 20.0
        apart = ((reads - 1.0) * decel).sum() if apart is None else apart
        for name, value in lines.items():
            self.lines[name] = value
        self.estimate["speed"], self.estimate["brake_torque"] = 20.0, 0.0
        accel = -decel.sum()
        for k in range(round(seconds / DT)):
            self.feed(
                self.inputs,
                accel_x=accel * (1.0 + GRAVITY * self.p["pitch_gradient"]),
                motor_torque=reads * decel * self.unit,
                accelerator_position=30.0,
            )
            self.blocks["time"] = 0.0 if k % round(BLOCK_S / DT) == 0 else 0.05
            self.lines["apart"] += (apart - self.lines["apart"]) * DT / APART_S
            watch_motors(
                *(self.p, self.state, self.witness, self.inputs[0], self.estimate, self.base),
                *(self.lines, self.blocks, DT),
            )
        return self.rejected()

    def rejected(self) -> tuple[str, ...]:
        return tuple(c for c in CORNERS if self.witness["rejected"][INPUT[f"motor_torque_{c}"]])

    def obey(self, seconds: float, asked, torque: float, limit: float = 1000.0) -> tuple[str, ...]:
        """Return the wheels whose motors are left out; `asked` of them in the last three cycles [N m]."""
        self.blending["asked"], self.blending["limit"] = np.reshape(asked, (3, 1)), limit
        for _ in range(round(seconds / DT)):
            self.feed(self.inputs, motor_torque=torque)
            compare_motors(self.p, self.state, self.witness, self.inputs[0], self.blending, self.lines, DT)
        return self.rejected()


@pytest.fixture
def car(params, feed) -> Car:
    return Car(params, feed)


ALL, ONE = CORNERS, (1.0, 1.0, 2.0, 1.0)
BRAKES, DRIVER = {"decel": 0.5}, {"accelerator_position": 20.0}
CASES = [
    # case, what the car does, seconds, left out
    ("all right", BRAKES, 20.0, ()),
    ("linings beside them", {"decel": 0.5, "lining": 0.5}, 20.0, ()),
    ("one reads twice its torque", {"decel": 0.5, "reads": ONE}, 3.0, ("rl",)),
    ("another one", {"decel": 0.5, "reads": (1.0, 2.0, 1.0, 1.0)}, 3.0, ("fr",)),
    ("one reads 0: more than its mate, none", {"decel": 0.5, "reads": (1.0, 1.0, 1.0, 0.0)}, 3.0, ALL),
    ("all read half", {"decel": 0.5, "reads": 0.5}, 3.0, ALL),
    ("all read 1.5 times", {"decel": 0.5, "reads": 1.5}, 3.0, ALL),
    ("no time for it yet", {"decel": 0.5, "reads": ONE}, 0.3, ()),
    ("5 % too much", {"decel": 0.5, "reads": 1.05}, 20.0, ()),
    ("one reads twice, walking pace", {"decel": 0.5, "reads": ONE, "speed": LEAST_SPEED}, 20.0, ()),
    ("one reads twice, just faster", {"decel": 0.5, "reads": ONE, "speed": LEAST_SPEED + 0.01}, 3.0, ("rl",)),
    ("one reads twice, accelerating", {"decel": 0.5, "reads": ONE, "accelerator_position": 20.0}, 9.0, ()),
    ("one reads twice, ABS", {"decel": 0.5, "reads": ONE, "abs_active": 1.0}, 9.0, ()),
    ("the linings' doubt", {"decel": 0.1, "lining": 1.0, "off": 1.5}, 9.0, ()),
    ("more than it", {"decel": 0.1, "lining": 0.25, "off": 1.5}, 9.0, ALL),
    ("they drive by themselves, says their torque", {"decel": -0.5, "off": 1.5}, 9.0, ALL),
    ("they drive a heavier car", {"decel": -0.5, "off": 0.6}, 9.0, ()),
    ("they drive as the driver wants", DRIVER | {"decel": -0.5, "off": 1.5}, 9.0, ()),
    ("the accelerometer's zero", {"decel": 0.5, "off": 1.0, "accel_offset": -0.9}, 9.0, ()),
    ("a zero of the other sign", {"decel": 0.5, "off": 1.0, "accel_offset": 0.9}, 9.0, ALL),
    ("a greater zero takes just the error", {"decel": 0.5, "off": 1.0, "accel_offset": -9.0}, 9.0, ()),
]  # fmt: skip


@pytest.mark.parametrize(
    ("what", "seconds", "left_out"), [case[1:] for case in CASES], ids=[c[0] for c in CASES]
)
def test_which_motor_contradicts_the_motion(car: Car, what, seconds: float, left_out) -> None:
    assert car.drive(seconds, **what) == left_out


@pytest.mark.parametrize(("over", "left_out"), [(0.97, ()), (1.03, ALL)])
def test_what_a_car_without_linings_may_differ_by(car: Car, over: float, left_out) -> None:
    tolerance = ACCEL + MOTORS * 0.5
    assert car.drive(30.0, decel=0.5, off=over * tolerance) == left_out


@pytest.mark.parametrize("name", ["measured", "backwards"])
def test_without_the_accelerometer_or_in_reverse_nothing_is_judged(car: Car, name: str) -> None:
    car.estimate[name] = name == "backwards"
    assert car.drive(9.0, decel=0.5, reads=ONE) == ()


def test_a_stale_torque_is_not_judged(car: Car) -> None:
    car.inputs["verdict"][0, INPUT["motor_torque_rl"]] = 0
    assert car.drive(9.0, decel=(0.5, 0.5, 0.0, 0.5), off=0.5) == ("fl", "fr", "rr")


@pytest.mark.parametrize(("reads", "left_out"), [(1.0, ()), (0.7, ("rl",))])
def test_who_drives_the_car_as_he_says_is_believed_again(car: Car, reads: float, left_out) -> None:
    assert car.drive(3.0, decel=0.5, reads=ONE) == ("rl",)
    found = car.drive(2.5, decel=-0.4, reads=reads, accelerator_position=30.0)
    assert found == left_out
    assert car.drive(0.8, decel=-0.4, accelerator_position=30.0) == left_out, "only after a second"


DRIVES = {"decel": -1.0}
DEMANDS = [
    # demands of the last three cycles, the newest first, limit, torque [N m]; left out
    ((500.0, 500.0, 500.0), 1000.0, 500.0, False),
    ((500.0, 500.0, 500.0), 1000.0, 500.0 + 0.98 * (GAP + GAP_SHARE * 500.0), False),
    ((500.0, 500.0, 500.0), 1000.0, 500.0 + 1.02 * (GAP + GAP_SHARE * 500.0), True),
    ((500.0, 500.0, 500.0), 1000.0, 500.0 - 1.02 * (GAP + GAP_SHARE * 500.0), True),
    ((500.0, 300.0, 100.0), 1000.0, 100.0, False),  # it follows a cycle or two later
    ((100.0, 300.0, 500.0), 1000.0, 500.0, False),
    ((300.0, 500.0, 300.0), 1000.0, 500.0, False),
    ((300.0, 100.0, 300.0), 1000.0, 100.0, False),
    ((500.0, 500.0, 500.0), 200.0, 200.0, False),  # its limit excuses it
    ((500.0, 500.0, 500.0), 200.0, 100.0, True),
    ((500.0, 500.0, 500.0), -5.0, 0.0, False),
    ((0.0, 0.0, 0.0), 0.0, 0.98 * GAP, False),
    ((0.0, 0.0, 0.0), 0.0, 1.05 * GAP, True),
]  # fmt: skip


@pytest.mark.parametrize(("asked", "limit", "torque", "left_out"), DEMANDS)
def test_a_motor_gives_what_was_demanded_of_it(car: Car, asked, limit, torque, left_out) -> None:
    assert car.obey(5.0, asked, torque, limit) == (ALL if left_out else ())


FAR = GAP + GAP_SHARE * 500.0
SHORT = [
    # torque of motors that drove as usual and are asked for 500 N m; left out, short
    (500.0 - 1.05 * FAR, (), True),
    (500.0 - 0.95 * FAR, ALL, False),  # more than the usual share allows: it has drifted
    (500.0 + 1.05 * FAR, ALL, False),
]  # fmt: skip


@pytest.mark.parametrize(("torque", "left_out", "short"), SHORT)
def test_a_motor_that_drove_as_usual_and_gives_far_less_has_a_wrong_limit(
    car: Car, torque, left_out, short
) -> None:
    asked = (500.0,) * 3
    assert car.known(10.0, **DRIVES) == car.obey(10.0, asked, 500.0) == ()
    assert car.obey(0.5, asked, torque) == left_out
    assert car.blending["lost"].all() == car.blending["lost"].any() == short


def test_an_accelerometer_that_is_known_to_drift_accuses_no_motor(car: Car) -> None:
    car.lines["reported"] = 1
    assert car.drive(9.0, 0.5, reads=0.5) == ()
    car.lines["reported"] = 0
    assert car.drive(9.0, 0.5, reads=0.5) == ALL


def test_a_motor_that_drove_wrongly_is_not_short(car: Car) -> None:
    car.known(10.0, **DRIVES)
    car.state["moved_s"] = 0.1
    assert car.obey(5.0, (500.0,) * 3, 500.0 - 1.05 * FAR) == ALL


def test_what_does_not_blend_or_is_stale_is_not_compared(car: Car) -> None:
    car.p["blending"][2] = 0.0
    car.inputs["verdict"][0, MOTOR_TORQUE + 3] = 0
    assert car.obey(5.0, (500.0,) * 3, 100.0) == ("fl", "fr")


def test_a_gap_is_judged_within_half_a_second(car: Car) -> None:
    assert car.obey(0.1, (500.0,) * 3, 400.0) == ()
    assert car.obey(0.4, (500.0,) * 3, 400.0) == ALL


MOVED = [
    # case, what the car does after 10 s in which all read right, seconds, left out
    ("all right", DRIVES, 20.0, ()),
    ("all read 3 % less", DRIVES | {"reads": 0.97}, 20.0, ()),
    ("all read a tenth less", DRIVES | {"reads": 0.9}, 1.0, ALL),
    ("all read a tenth more", DRIVES | {"reads": 1.1}, 1.0, ALL),
    ("no time for it yet", DRIVES | {"reads": 0.9}, 0.2, ()),
    ("one reads a fifth less than its mate", DRIVES | {"reads": (0.8, 1.0, 1.0, 1.0)}, 1.5, ("fl",)),
    ("one reads a fifth more", DRIVES | {"reads": (1.0, 1.0, 1.0, 1.2)}, 1.5, ("rr",)),
    ("one reads a tenth less", DRIVES | {"reads": (0.9, 1.0, 1.0, 1.0)}, 20.0, ()),
    ("torque goes from left to right", {"decel": (-0.7, -1.3, -1.0, -1.0)}, 20.0, ()),
    ("the wheels show it too", DRIVES | {"apart": 1.0, "wheels": 0.8}, 20.0, ()),
    ("the wheels show the contrary", DRIVES | {"apart": 1.0, "wheels": -0.8}, 2.0, ALL),
    ("the accelerometer is known to drift", DRIVES | {"apart": 1.0, "reported": 1}, 20.0, ()),
]  # fmt: skip


@pytest.mark.parametrize(
    ("what", "seconds", "left_out"), [case[1:] for case in MOVED], ids=[c[0] for c in MOVED]
)
def test_which_motor_no_longer_drives_the_car_as_it_used_to(car: Car, what, seconds, left_out) -> None:
    assert car.known(10.0, **DRIVES) == ()
    what = dict(what)
    car.lines["wheels"]["now"]["offset"] = what.pop("wheels", 0.0)
    assert car.known(seconds, **what) == left_out


def test_motors_are_usually_unequal(car: Car) -> None:
    """By a tenth, for as long as the car is known: then both have to become equal to be found to lie."""
    assert car.known(10.0, (-1.1, -0.9, -1.0, -1.0)) == ()
    assert car.known(5.0, (-1.1, -0.9, -1.0, -1.0), reads=(1.0 / 1.3, 1.0, 1.0, 1.0)) == ("fl",)


def test_what_moved_is_believed_again_once_it_has_moved_back(car: Car) -> None:
    car.known(10.0, **DRIVES)
    assert car.known(2.0, reads=0.9, **DRIVES) == ALL
    assert car.known(5.0, reads=0.9, **DRIVES) == ALL
    assert car.known(2.5, **DRIVES) == ()


@pytest.mark.parametrize(("over", "left_out"), [(0.95, ()), (1.05, ALL)])
def test_a_motor_gives_the_share_of_a_demand_that_it_usually_gives(car: Car, over: float, left_out) -> None:
    """5 % too little for as long as it is known."""
    asked, usual = (500.0,) * 3, 475.0
    assert car.obey(10.0, asked, usual) == ()
    assert car.obey(5.0, asked, usual + over * (USUAL_GAP + USUAL_GAP_SHARE * 500.0)) == left_out


NO_DRIVE = [
    # torque while the brakes are applied and the accelerator is free [N m], left out
    (0.0, ()),
    (-0.95 * DRIVES_ON, ()),
    (-1.05 * DRIVES_ON, ALL),
    (200.0, ()),  # it brakes by itself
]


@pytest.mark.parametrize(("torque", "left_out"), NO_DRIVE)
def test_a_motor_that_does_not_blend_does_not_drive_against_the_brakes(car: Car, torque, left_out) -> None:
    car.p["blending"] = 0.0
    for _ in range(100):
        car.feed(car.inputs, motor_torque=torque)
        deny_drive(car.p, car.state, car.witness, car.inputs[0], DT)
    assert car.rejected() == left_out


def test_a_torque_that_is_a_guess_denies_nothing(car: Car) -> None:
    car.p["blending"], car.p["sigma_motor_torque"] = 0.0, 0.5
    for _ in range(100):
        car.feed(car.inputs, motor_torque=-200.0)
        deny_drive(car.p, car.state, car.witness, car.inputs[0], DT)
    assert car.rejected() == ()
