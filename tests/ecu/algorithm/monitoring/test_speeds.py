"""Wheel speeds and vehicle speed: which of them contradicts the others, and when nothing is said."""

import math

import numpy as np
import pytest

from ecu.algorithm.estimate import ESTIMATE
from ecu.algorithm.monitoring.speeds import SPEEDS_STATE, watch_speeds
from ecu.algorithm.monitoring.witness import WITNESS_STATE
from ecu.contract.signals import INPUT

DT = 0.01
NAMES = ("wheel_speed_fl", "wheel_speed_fr", "wheel_speed_rl", "wheel_speed_rr", "vehicle_speed")


class Road:
    """A car on a straight road; `turns` of its wheels and of the vehicle speed over its own speed."""

    def __init__(self, params, feed, reference: bool = True) -> None:
        self.params, self.feed, self.inputs = params[0], feed, feed()
        self.state, self.witness = np.zeros(1, SPEEDS_STATE)[0], np.zeros(1, WITNESS_STATE)[0]
        self.estimate = np.zeros(1, ESTIMATE)[0]
        self.estimate["measured"], self.estimate["grip_limit"] = 1, math.nan
        self.speed, self.reference, self.noise = 25.0, reference, 0.0  # m/s, -, N m
        self.random = np.random.default_rng(0)

    def drive(
        self,
        seconds: float,
        turns=(1, 1, 1, 1, 1),
        accel: float = 0.0,
        gas: float = 0.0,
        late=0.0,
        guarded=False,
        overslept: float = 0.0,
    ) -> tuple[str, ...]:
        """Return the names that are rejected at the end; `accel` < 0 brakes all wheels, `gas` [%].

        `late` [s]: of each input; `guarded`: the slip guard acts; the first cycle is `overslept` s late.
        """
        turns, late = np.array(turns, float), np.broadcast_to(late, 5)
        for _ in range(round(seconds / DT)):
            self.speed += accel * DT
            self.estimate["speed"], self.estimate["accel_x"] = self.speed, accel
            braking = 800.0 if accel < -1.0 else 0.0
            self.estimate["brake_torque"] = np.maximum(
                braking + self.noise * self.random.standard_normal(4), 0.0
            )
            read = (self.speed - accel * late) * turns
            wheels = read[:4] / self.params["wheel_radius"]
            self.feed(
                self.inputs,
                wheel_speed=wheels + 0.1 * self.random.standard_normal(4),
                vehicle_speed=read[4] - self.params["vehicle_speed_delay"] * accel,
                vehicle_speed_valid=1.0,
                accelerator_position=gas,
                accel_x=accel,
                motor_torque=0.0,
            )
            if not self.reference:
                self.inputs[0]["verdict"][INPUT["vehicle_speed"]] = 0
            watch_speeds(
                self.params, self.state, self.witness, self.inputs[0], self.estimate, guarded, DT + overslept
            )
            overslept = 0.0
        return tuple(name for name in NAMES if self.witness["rejected"][INPUT[name]])


@pytest.fixture
def road(params, feed) -> Road:
    road = Road(params, feed)
    assert road.drive(5.0) == ()
    return road


FRONT, REAR = NAMES[:2], NAMES[2:4]
CASES = [
    # case, wheels and vehicle speed over the car's, acceleration, accelerator, seconds, rejected
    ("rolls", (1, 1, 1, 1, 1), 0.0, 0.0, 10.0, ()),
    ("brakes with 3 % of slip", (0.97, 0.97, 0.97, 0.97, 1), -4.0, 0.0, 3.0, ()),
    ("a wheel locks", (1, 1, 0.0, 1, 1), -4.0, 0.0, 3.0, ()),
    ("all slide", (0.6, 0.6, 0.6, 0.6, 1), -4.0, 0.0, 1.5, ()),
    ("all slide, and the speed reads 40 % more", (0.6, 0.6, 0.6, 0.6, 1.4), -4.0, 0.0, 0.5, NAMES[4:]),
    ("all lock on ice", (0.1, 0.1, 0.1, 0.1, 1), -1.5, 0.0, 12.0, ()),
    ("an axle spins", (1, 1, 1.3, 1.3, 1), 2.0, 50.0, 3.0, ()),
    ("three wheels spin", (1.4, 1, 1.4, 1.4, 1), 3.0, 50.0, 2.0, ()),
    ("three wheels lock", (0.3, 1, 0.3, 0.3, 1), -3.0, 0.0, 2.0, ()),
    ("an axle that rolls reads 0.3 % more", (1.003, 1.003, 1, 1, 1), 0.0, 0.0, 3.0, ()),
    ("an axle that rolls reads 1 % more", (1.01, 1.01, 1, 1, 1), 0.0, 0.0, 1.0, FRONT),
    ("an axle that rolls reads 1 % less", (1, 1, 0.99, 0.99, 1), 0.0, 0.0, 1.0, REAR),
    ("an axle that rolls reads 2.5 % more", (1.025, 1.025, 1, 1, 1), 0.0, 0.0, 1.0, FRONT),
    ("the speed reads 2.5 % more", (1, 1, 1, 1, 1.025), 0.0, 0.0, 1.0, NAMES[4:]),
    ("an engine drags an axle on ice", (0.9, 0.9, 1, 1, 1), -0.8, 0.0, 2.0, ()),
    ("stuck while the car slows", (1.1, 0.98, 0.98, 0.98, 1), -4.0, 0.0, 0.5, NAMES[:1]),
    ("a wheel that rolls reads zero", (1, 1, 1, 0, 1), 0.0, 0.0, 0.3, NAMES[3:4]),
    ("an axle that rolls reads 6 % less", (1, 1, 0.94, 0.94, 1), 0.0, 0.0, 1.0, REAR),
    ("an axle that brakes reads 20 % more", (1.2, 1.2, 0.98, 0.98, 1), -4.0, 0.0, 0.5, FRONT),
    ("the speed reads zero", (1, 1, 1, 1, 0), 0.0, 0.0, 0.3, NAMES[4:]),
    ("the speed stands still above", (0.97, 0.97, 0.97, 0.97, 1.4), -4.0, 0.0, 0.5, NAMES[4:]),
    ("the speed stands below braked wheels", (0.97, 0.97, 0.97, 0.97, 0.7), -4.0, 0.0, 0.5, NAMES[4:]),
    ("all that roll read 5 % more", (1.05, 1.05, 1.05, 1.05, 1), 0.0, 0.0, 0.5, NAMES[:4]),
    ("all that roll read 5 % less", (0.95, 0.95, 0.95, 0.95, 1), 0.0, 0.0, 0.5, NAMES[:4]),
    ("all that brake read 20 % more", (1.2, 1.2, 1.2, 1.2, 1), -4.0, 0.0, 0.5, NAMES[:4]),
    ("all that drive read 10 % less", (0.9, 0.9, 0.9, 0.9, 1), 2.0, 30.0, 0.5, NAMES[:4]),
    ("all that drive read 5 % less", (0.96, 0.96, 0.96, 0.96, 1), 3.0, 30.0, 1.0, NAMES[:4]),
    ("all that drive slip by 4 %", (1.04, 1.04, 1.04, 1.04, 1), 3.0, 30.0, 3.0, ()),
    ("all that brake slip by 4 %", (0.96, 0.96, 0.96, 0.96, 1), -4.0, 0.0, 3.0, ()),
]


@pytest.mark.parametrize(
    ("case", "turns", "accel", "gas", "seconds", "rejected"), CASES, ids=[c[0] for c in CASES]
)
def test_who_contradicts_the_others(road, case, turns, accel, gas, seconds, rejected) -> None:
    assert road.drive(seconds, turns, accel, gas) == rejected


@pytest.mark.parametrize("measured", [1, 0])
def test_without_an_accelerometer_dead_reckoning_is_the_others_median(road, measured) -> None:
    """The torques' acceleration stands for it, which knows no slope."""
    road.estimate["measured"] = measured
    turns = np.full(5, 0.94)
    for _ in range(100):
        road.drive(0.01, turns)
    assert (road.state["reckoned"] == pytest.approx(0.94 * road.speed, rel=0.003)) == (measured == 0)


@pytest.mark.parametrize("overslept", [0.2, 0.5])
def test_what_an_ecu_overslept_contradicts_no_wheel(params, feed, overslept) -> None:
    """The brakes were released meanwhile: dead reckoning by the deceleration of before is wrong."""
    road = Road(params, feed, False)
    road.drive(5.0)
    road.drive(1.0, accel=-6.0)
    road.estimate["accel_x"] = -6.0
    assert road.drive(0.02, accel=-6.0, overslept=overslept) == ()
    road.drive(1.5, accel=-6.0)
    assert road.state["reckoned"] == pytest.approx(road.speed, rel=0.01)


def test_a_wheel_that_locked_on_ice_has_time_to_spin_up(road) -> None:
    """The guard takes its pressure away; a sensor that stays behind for longer is one that lies."""
    assert road.drive(0.5, (1, 0.5, 1, 1, 1), -1.5) == ()
    assert road.drive(0.3, (1, 0.7, 1, 1, 1), -0.5) == ()
    assert road.drive(0.5, (1, 0.5, 1, 1, 1), -1.5) == ()
    assert road.drive(1.0, (1, 0.7, 1, 1, 1), -0.5) == NAMES[1:2]


@pytest.mark.parametrize("reference", [True, False])
@pytest.mark.parametrize("rest", [(1, 1, 1, 1, 1), (0.95, 0.95, 0.98, 0.95, 1)])
def test_wheels_that_slip_together_again_and_again_contradict_nobody(params, feed, reference, rest) -> None:
    """A guard releases all brakes and applies them again, twice a second, until the car is slow."""
    road = Road(params, feed, reference)
    road.drive(5.0)
    for _ in range(24):
        assert road.drive(0.3, (0.5, 0.6, 0.7, 0.6, 1), -2.0) == ()
        assert road.drive(0.15, rest, -0.3) == ()
    assert road.drive(1.0) == ()


def test_a_wheel_that_reads_too_little_is_found_in_a_coast_that_is_short(road) -> None:
    """A slip of 2 % while braked is not the lie, and it did not slide."""
    assert road.drive(1.0, (0.93, 0.98, 0.98, 0.98, 1), -4.0) == ()
    assert road.drive(0.6, (0.95, 1, 1, 1, 1), -0.3) == NAMES[:1]


def test_a_wheel_that_spun_has_time_to_spin_down(road) -> None:
    assert road.drive(1.0, (1.6, 1.6, 1, 1, 1), 1.0, 50.0) == ()
    assert road.drive(0.4, (1.1, 1.1, 1, 1, 1), -0.5) == ()
    assert road.drive(0.5, (1.1, 1.1, 1, 1, 1), -0.5) == FRONT


def test_without_a_speed_over_ground_the_accelerometer_sees_which_axle_lies(params, feed) -> None:
    road = Road(params, feed, reference=False)
    road.drive(5.0)
    assert road.drive(1.0, (1.2, 1.2, 0.98, 0.98, 1), -4.0) == FRONT


@pytest.mark.parametrize(
    ("turns", "rejected"), [((1.01, 1.01, 1, 1, 1), FRONT), ((1, 1, 1.01, 1.01, 1), REAR)]
)
def test_the_vehicle_speed_tells_which_axle_turns_otherwise(road, turns, rejected) -> None:
    """Dead reckoning was drawn along by wheels that were driven: it accuses the other axle."""
    road.speed = 10.0
    assert road.drive(5.0, (1.02, 1.02, 1.02, 1.02, 1), 3.0, 40.0) == ()
    assert road.drive(1.2, turns, -0.3) == rejected


def test_without_a_speed_over_ground_nobody_knows_which_axle_turns_otherwise(params, feed) -> None:
    road = Road(params, feed, reference=False)
    road.drive(5.0)
    assert road.drive(3.0, (1.01, 1.01, 1, 1, 1)) == ()


def test_all_wheels_that_lied_are_believed_again_by_the_vehicle_speed(road) -> None:
    assert road.drive(3.0, (1.1, 1.1, 1.1, 1.1, 1)) == NAMES[:4]
    assert road.drive(1.5, (1, 1, 1, 1, 1)) == ()


@pytest.mark.parametrize("more", [0.035, 0.06])
def test_wheels_that_drift_while_they_drive_are_found_as_they_brake(road, more: float) -> None:
    """What may be slip says nothing of them, nor of the vehicle speed that the accelerometer confirms."""
    for rolled in np.linspace(1.0, 1.0 + more, 30):
        assert road.drive(0.1, (rolled, rolled, rolled, rolled, 1), 2.0, 30.0) == ()
    assert road.drive(0.4, (rolled, rolled, rolled, rolled, 1), -4.0) == ()
    assert road.drive(1.5, (rolled, rolled, rolled, rolled, 1), -4.0) == NAMES[:4]


def test_without_an_accelerometer_s_word_the_wheels_outvote_the_vehicle_speed(road) -> None:
    """A slope of 6 % begins as all wheels begin to read more: both speeds leave dead reckoning alike."""
    for k in range(30):
        road.speed += 0.06
        rolled = 1.0 + 0.001 * k
        road.drive(0.1, (rolled, rolled, rolled, rolled, 1))
    assert road.drive(0.0) == NAMES[4:]


def test_another_tyre_is_learned_while_rolling(params, feed) -> None:
    """A spare wheel 2.5 % smaller is no lie, braked or not; what it then changes by is."""
    road = Road(params, feed)
    assert road.drive(20.0, (1.025, 1, 1, 1, 1)) == ()
    assert road.state["base"][0] == pytest.approx(0.025, abs=0.004)
    assert road.drive(3.0, (1.0, 0.975, 0.975, 0.975, 1), -4.0) == ()
    road.speed = 25.0
    assert road.drive(1.0, (1.08, 1, 1, 1, 1)) == NAMES[:1]


def test_wheels_that_spun_as_the_car_drove_off_say_nothing_later(params, feed) -> None:
    road = Road(params, feed)
    road.speed = 3.0
    assert road.drive(0.3, (2.5, 1, 2.5, 2.5, 1), 2.0, 50.0) == ()
    assert road.drive(3.0, (1, 1, 1, 1, 1), 2.0, 50.0) == ()


def test_a_sensor_that_is_well_again_is_believed_again(road) -> None:
    assert road.drive(1.0, (1.1, 1, 1, 1, 1)) == NAMES[:1]
    assert road.drive(0.8) == NAMES[:1]
    assert road.drive(1.0) == ()


@pytest.mark.parametrize("backwards", [0, 1])
def test_slow_or_backwards_nothing_is_judged(params, feed, backwards) -> None:
    road = Road(params, feed)
    road.speed = 25.0 if backwards else 4.0
    road.estimate["backwards"] = backwards
    assert road.drive(3.0, (0.5, 1, 1, 1, 1)) == ()


def test_two_witnesses_that_differ_judge_nobody(params, feed) -> None:
    """One wheel, and dead reckoning; without more the third is the median of the two."""
    road = Road(params, feed, reference=False)
    road.inputs[0]["verdict"][INPUT["wheel_speed_fl"] : INPUT["wheel_speed_fl"] + 3] = 0
    assert road.drive(2.0, (1, 1, 1, 1, 1)) == ()
    assert road.drive(2.0, (1, 1, 1, 0.5, 1)) == ()


LATE = [
    # case, braking, wheels and vehicle speed over the car's, late by [s], rejected
    ("nobody", -4.0, (0.98, 0.98, 0.98, 0.98, 1), (0, 0, 0, 0, 0), ()),
    ("an axle by 0.2 s", -4.0, (0.98, 0.98, 0.98, 0.98, 1), (0.2, 0.2, 0, 0, 0), FRONT),
    ("the other, that slips more", -4.0, (0.985, 0.985, 0.975, 0.975, 1), (0, 0, 0.2, 0.2, 0), REAR),
    ("a wheel by 0.1 s", -4.0, (0.98, 0.98, 0.98, 0.98, 1), (0, 0.1, 0, 0, 0), NAMES[1:2]),
    ("the vehicle speed: a GNSS is", -4.0, (0.98, 0.98, 0.98, 0.98, 1), (0, 0, 0, 0, 0.2), ()),
    ("all wheels", -4.0, (0.98, 0.98, 0.98, 0.98, 1), (0.2, 0.2, 0.2, 0.2, 0), NAMES[:4]),
    ("by 20 ms: within the doubt", -4.0, (0.98, 0.98, 0.98, 0.98, 1), (0.02, 0.02, 0, 0, 0.02), ()),
    ("an axle, the car rolls", -0.5, (1, 1, 1, 1, 1), (0.2, 0.2, 0, 0, 0), ()),
]


@pytest.mark.parametrize(("case", "accel", "turns", "late", "rejected"), LATE, ids=[c[0] for c in LATE])
def test_who_is_late(road, case, accel, turns, late, rejected) -> None:
    assert road.drive(4.5, turns, accel, late=late) == rejected


def test_who_was_late_is_left_out_in_the_next_braking_from_the_first(road) -> None:
    slips, late = (0.98, 0.98, 0.98, 0.98, 1), (0.2, 0.2, 0, 0, 0)
    assert road.drive(4.5, slips, -4.0, late=late) == FRONT
    assert road.drive(10.0, accel=2.0, gas=20.0, late=late) == FRONT
    assert road.drive(0.3, slips, -4.0, late=late) == FRONT


@pytest.mark.parametrize(("speed", "lost"), [(1.0, None), (1.0, "vehicle_speed"), (1.0, "wheel_speed_rl")])
def test_what_is_left_out_makes_nobody_else_late(road, speed: float, lost: str | None) -> None:
    """Without it the others' reference is another one, in the middle of a braking."""
    slips = (0.98, 0.98, 0.98, 0.98, speed)
    assert road.drive(2.5, slips, -4.0) == ()
    if lost:
        road.inputs[0]["verdict"][INPUT[lost]] = 0
        road.reference = lost != "vehicle_speed"
    assert road.drive(2.5, slips, -4.0) == ()


@pytest.mark.parametrize("guarded", [False, True])
def test_a_wheel_that_comes_back_from_a_slip_is_not_late(road, guarded: bool) -> None:
    """By the guard, or as more than 4 % of slip become less."""
    slid = 0.035 if guarded else 0.08
    road.drive(0.8, (1 - slid, 0.98, 0.98, 0.98, 1), -4.0, guarded=guarded)
    for slip in np.linspace(slid, 0.0, 30):
        road.drive(0.1, (1 - slip, 0.98, 0.98, 0.98, 1), -4.0, guarded=guarded)
        assert road.drive(0.0) == ()


@pytest.mark.parametrize(("limit", "late"), [(math.nan, REAR), (9.0, REAR), (6.8, ())])
def test_near_the_limit_of_grip_an_axle_that_slips_less_is_not_late(params, feed, limit, late) -> None:
    """The front comes to slip by 5 %, the rear to 3 %, and dead reckoning is as far behind the car."""
    road = Road(params, feed, reference=False)
    road.speed = 33.0
    assert road.drive(5.0) == ()
    road.estimate["grip_limit"], road.state["reckoned"] = limit, 0.95 * road.speed
    for slip in np.minimum(np.linspace(0.15, 6.75, 45), 1.0):
        front, rear = 1.0 - 0.055 * slip, 1.0 - 0.03 * slip
        named = road.drive(0.1, (front, front, rear, rear, 1), -6.2)
    assert named == late


def test_an_axle_that_is_not_driven_does_not_lie_because_the_vehicle_speed_does(params, feed) -> None:
    """The other one spins as the car drives off, and slips by 4 %; the vehicle speed reads 1 m/s more."""
    road = Road(params, feed)
    road.drive(10.0)
    road.drive(5.5, (0.99, 0.99, 0.99, 0.99, 1), -4.0)
    for _ in range(9):
        assert road.drive(0.1, (1, 1, 3, 3, 1.0 + 1.0 / road.speed), 4.8, 50.0) == ()
    for _ in range(40):
        over_ground = 1.0 + 1.0 / road.speed
        named = road.drive(0.1, (1, 1, 1.05, 1.05, over_ground), 4.8, 50.0)
        assert named in ((), NAMES[4:])


def test_pressures_noise_brakes_no_wheel(road) -> None:
    """A sensor of 1.8 bar reads 100 N m now and then; the axle that is not driven is judged all the same."""
    road.noise = 60.0
    assert road.drive(1.5, (0.9, 0.9, 1.01, 1.01, 1), 2.0, 30.0) == FRONT
