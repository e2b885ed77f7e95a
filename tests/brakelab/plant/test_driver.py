"""The driver, and what the vehicle makes of the ECU's demands: ramps, phases, fallback."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from brakelab.plant.cycle import CYCLE, move
from brakelab.plant.driver import Script, drive
from brakelab.plant.records import BRAKE, COAST, CRUISE, DEMAND, DRIVER, PHASE, new_record
from brakelab.plant.road import value_at

DEFAULTS = {"accel": 2.0, "ramp": 13.3, "pedal_rate": 150 / 90 * 100, "seconds": math.inf}
PLACES = ("speed", "decel", "pedal", "kept_decel", "until_speed")


def script(*phases: dict[str, Any], blending: bool = False, friction: float = 1.2) -> Script:
    rows = np.zeros(len(phases), PHASE)
    for row, phase in zip(rows, phases, strict=True):
        for name, value in {**dict.fromkeys(PLACES, math.nan), **DEFAULTS, **phase}.items():
            row[name] = value
    return Script(rows, np.array([[0.0, friction]]), np.array([[0.0, 0.0]]), 20.0, blending)


class Trip:
    """A driver in a car without an ECU, cycle by cycle."""

    def __init__(self, car: Any, plan: Script) -> None:
        self.car, self.plan = car, plan
        self.driver, self.demand = new_record(DRIVER), new_record(DEMAND)
        self.demand["pressure_age"] = self.demand["motor_age"] = math.inf

    def cycle(self) -> bool:
        car = self.car
        if not drive(self.plan, car.params[0], car.state[0], self.driver[0], CYCLE):
            return False
        move(self.plan, car.params[0], car.state[0], self.driver[0], self.demand[0], car.commands[0])
        return True

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / CYCLE)):
            self.cycle()


@pytest.mark.parametrize(
    ("t", "value"), [(-1.0, 1.2), (2.0, 1.2), (2.5, 0.95), (3.0, 0.7), (9.0, 0.7), (5.0, 0.7)]
)
def test_road_is_linear_between_rows_and_constant_outside(t: float, value: float) -> None:
    assert value_at(np.array([[0.0, 1.2], [2.0, 1.2], [3.0, 0.7]]), t, 1) == pytest.approx(value)


def test_demand_reaches_4_within_the_time_a_pedal_takes(car_at: Callable[[float], Any]) -> None:
    trip = Trip(car_at(30.0), script({"kind": BRAKE, "decel": 4.0}))
    demands = []
    for _ in range(40):
        trip.cycle()
        demands.append(float(trip.driver["decel_demand"][0]))
    assert demands[-1] == 4.0
    assert 0.28 <= CYCLE * (1 + demands.index(4.0)) <= 0.32
    assert max(np.diff([0.0, *demands])) == pytest.approx(13.3 * CYCLE)


def test_pedal_moves_at_150_mm_per_second(car_at: Callable[[float], Any]) -> None:
    trip = Trip(car_at(30.0), script({"kind": BRAKE, "pedal": 50.0}))
    trip.run(0.2)
    assert trip.driver["pedal_position"][0] == pytest.approx(100 * 0.2 * 150 / 90)
    trip.run(1.0)
    assert trip.driver["pedal_position"][0] == 50.0
    assert trip.driver["decel_demand_valid"][0] == 0.0


@pytest.mark.parametrize("speed", [10.0, 33.3])
def test_a_speed_is_held_on_the_motors(car_at: Callable[[float], Any], speed: float) -> None:
    trip = Trip(car_at(speed), script({"kind": CRUISE, "speed": speed}))
    trip.run(8.0)
    assert trip.car.now["speed_x"] == pytest.approx(speed, abs=0.05)
    assert np.all(trip.car.now["motor_torque"] < 0.0)  # negative drives
    assert np.all(trip.car.now["pressure"] == 0.0)


def test_the_motors_also_slow_down(car_at: Callable[[float], Any]) -> None:
    trip = Trip(car_at(25.0), script({"kind": CRUISE, "speed": 15.0, "accel": 1.5}))
    trip.run(2.0)
    assert trip.car.now["accel_x"] == pytest.approx(-1.5, abs=0.1)
    assert np.all(trip.car.now["motor_torque"] > 0.0)


def test_phases_end_by_time_or_speed_and_the_script_with_the_last(car_at: Callable[[float], Any]) -> None:
    plan = script(
        {"kind": COAST, "seconds": 0.5},
        {"kind": BRAKE, "decel": 5.0, "until_speed": 12.0},
        {"kind": CRUISE, "speed": 20.0, "until_speed": 15.0},
        {"kind": BRAKE, "decel": 5.0, "until_speed": 0.0},
    )
    trip = Trip(car_at(18.0), plan)
    seen: dict[int, list[float]] = {}
    while trip.cycle():
        seen.setdefault(int(trip.driver["phase"][0]), []).append(float(trip.car.now["speed_x"]))
    assert list(seen) == [0, 1, 2, 3]
    assert len(seen[0]) == 50
    assert seen[1][-1] == pytest.approx(12.0, abs=0.1)
    assert seen[2][-1] == pytest.approx(15.0, abs=0.1)
    assert seen[3][-1] < 0.06


@pytest.mark.parametrize("speed", [-0.02, 0.0, 0.02])
def test_braking_to_rest_is_over_at_once_for_a_car_at_rest(
    car_at: Callable[[float], Any], speed: float
) -> None:
    trip = Trip(car_at(speed), script({"kind": BRAKE, "decel": 4.0, "until_speed": 0.0}))
    assert trip.cycle()
    assert not trip.cycle()


@pytest.mark.parametrize(
    ("valid", "age", "expected_bar"),
    [(1, 0.00, 30.0), (1, 0.02, 30.0), (1, 0.03, None), (0, 0.00, None), (1, math.inf, None)],
)
def test_the_hydraulics_fall_back_when_the_demand_is_invalid_or_30_ms_old(
    car_at: Callable[[float], Any], valid: int, age: float, expected_bar: float | None
) -> None:
    trip = Trip(car_at(30.0), script({"kind": BRAKE, "decel": 4.0}))
    trip.driver["asked_decel"] = 4.0
    trip.demand["pressure"], trip.demand["pressure_valid"], trip.demand["pressure_age"] = 30.0, valid, age
    trip.cycle()
    asked = 1e-5 * trip.car.commands["pressure_demand"][0]
    if expected_bar is None:  # m r a / (4 mu (A_f r_f + A_r r_r)), nominal friction, equal on all wheels
        lever = 2.827e-3 * 0.1205 + 0.9079e-3 * 0.1288
        expected_bar = 1e-5 * 2105 * 0.3706 * 4.0 / (4 * 0.45 * lever) + 0.5
    assert asked == pytest.approx(np.full(4, expected_bar), rel=1e-3)


def test_fallback_brakes_about_as_asked(car_at: Callable[[float], Any]) -> None:
    trip = Trip(car_at(30.0), script({"kind": BRAKE, "decel": 4.0}))
    trip.run(2.0)
    assert -trip.car.now["accel_x"] == pytest.approx(4.0, rel=0.25)  # friction is not nominal


@pytest.mark.parametrize(("blending", "expected"), [(True, 250.0), (False, 0.0)])
def test_motors_follow_the_ecu_in_braking_only_with_blending(
    car_at: Callable[[float], Any], blending: bool, expected: float
) -> None:
    trip = Trip(car_at(30.0), script({"kind": BRAKE, "decel": 4.0}, blending=blending))
    trip.demand["motor"], trip.demand["motor_valid"], trip.demand["motor_age"] = 250.0, 1, 0.0
    trip.cycle()
    assert trip.car.commands["motor_demand"][0] == pytest.approx(np.full(4, expected))
