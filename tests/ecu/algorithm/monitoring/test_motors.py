"""Motor torques that contradict the motion or what was demanded of them: which, and when none is named."""

import numpy as np
import pytest

from ecu.algorithm.control.blending import BLENDING_STATE
from ecu.algorithm.estimate import ESTIMATE
from ecu.algorithm.monitoring.motors import (
    ACCEL,
    GAP,
    GAP_SHARE,
    LEAST_SPEED,
    MOTORS,
    MOTORS_WATCH_STATE,
    compare_motors,
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
        self.estimate["speed"], self.estimate["brake_torque"] = speed, lining * self.unit
        for _ in range(round(seconds / DT)):
            self.feed(
                self.inputs,
                accel_x=accel * (1.0 + GRAVITY * p["pitch_gradient"]),
                motor_torque=np.broadcast_to(reads, 4) * decel * self.unit,
                **inputs,
            )
            watch_motors(
                p, self.state, self.witness, self.inputs[0], self.estimate, self.base, accel_offset, DT
            )
        return self.rejected()

    def rejected(self) -> tuple[str, ...]:
        return tuple(c for c in CORNERS if self.witness["rejected"][INPUT[f"motor_torque_{c}"]])

    def obey(self, seconds: float, asked, torque: float, limit: float = 1000.0) -> tuple[str, ...]:
        """Return the wheels whose motors are left out; `asked` of them in the last three cycles [N m]."""
        self.blending["asked"], self.blending["limit"] = np.reshape(asked, (3, 1)), limit
        for _ in range(round(seconds / DT)):
            self.feed(self.inputs, motor_torque=torque)
            compare_motors(self.p, self.state, self.witness, self.inputs[0], self.blending, DT)
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


def test_what_does_not_blend_or_is_stale_is_not_compared(car: Car) -> None:
    car.p["blending"][2] = 0.0
    car.inputs["verdict"][0, MOTOR_TORQUE + 3] = 0
    assert car.obey(5.0, (500.0,) * 3, 100.0) == ("fl", "fr")


def test_a_gap_is_judged_within_half_a_second(car: Car) -> None:
    assert car.obey(0.1, (500.0,) * 3, 400.0) == ()
    assert car.obey(0.4, (500.0,) * 3, 400.0) == ALL
