"""The driver, and what the vehicle makes of the ECU's demands: ramps, phases, fallback."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from brakelab.plant.cycle import CYCLE, move
from brakelab.plant.driver import Script, drive, pedal_for
from brakelab.plant.records import BRAKE, COAST, CRUISE, DEMAND, DRIVER, FOLLOW, PHASE, new_record
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


@pytest.mark.study
def test_demand_reaches_4_within_the_time_a_pedal_takes(car_at: Callable[[float], Any]) -> None:
    trip = Trip(car_at(30.0), script({"kind": BRAKE, "decel": 4.0}))
    demands = []
    for _ in range(40):
        trip.cycle()
        demands.append(float(trip.driver["decel_demand"][0]))
    assert demands[-1] == 4.0
    assert 0.28 <= CYCLE * (1 + demands.index(4.0)) <= 0.32
    assert max(np.diff([0.0, *demands])) == pytest.approx(13.3 * CYCLE)


@pytest.mark.parametrize("mm_per_s", [150.0, 50.0])
def test_the_pedal_moves_at_its_speed_down_and_up(car_at: Callable[[float], Any], mm_per_s: float) -> None:
    rate = mm_per_s / 90 * 100
    plan = script(
        {"kind": BRAKE, "pedal": 50.0, "pedal_rate": rate, "seconds": 1.2},
        {"kind": COAST, "pedal_rate": rate},
    )
    trip = Trip(car_at(30.0), plan)
    trip.run(0.2)
    assert trip.driver["pedal_position"][0] == pytest.approx(0.2 * rate)
    trip.run(1.0)
    assert trip.driver["pedal_position"][0] == 50.0
    assert trip.driver["decel_demand_valid"][0] == 0.0
    trip.run(0.2)
    assert trip.driver["pedal_position"][0] == pytest.approx(50.0 - 0.2 * rate)


@pytest.mark.parametrize("friction", [0.8, 1.0, 1.15])
@pytest.mark.parametrize("decel", [1.3, 3.5, 6.0])
def test_an_expert_keeps_a_deceleration_whatever_the_friction(
    car_at: Callable[[float], Any], decel: float, friction: float
) -> None:
    car = car_at(40.0)
    car.params["friction_scale"] *= friction
    trip = Trip(car, script({"kind": BRAKE, "kept_decel": decel}))
    trip.run(5.0)
    assert -car.now["accel_x"] == pytest.approx(decel, rel=0.03)
    assert trip.driver["decel_demand_valid"][0] == 0.0


@pytest.mark.parametrize(("asked", "percent"), [(0.0, 0.0), (4.0, 60.0), (2.0, 39.6), (12.0, 100.0)])
def test_sixty_percent_of_the_pedal_is_4(asked: float, percent: float) -> None:
    assert pedal_for(asked) == pytest.approx(percent, abs=0.1)


def following(*rows: tuple[float, float]) -> Script:
    end = rows[-1][0]
    return script({"kind": FOLLOW, "seconds": end})._replace(trace=np.array(rows, dtype=np.float64))


def test_a_trace_is_followed_on_motors_and_pedal(car_at: Callable[[float], Any]) -> None:
    rows = (
        (0.0, 0.0),
        (3.0, 0.0),
        (13.0, 15.0),
        (25.0, 15.0),
        (35.0, 12.0),
        (40.0, 2.0),
        (41.0, 0.0),
        (45.0, 0.0),
    )
    trip = Trip(car_at(0.0), following(*rows))
    t, error, pedal, torque = [], [], [], []
    while trip.cycle():
        now = float(trip.driver["elapsed"][0])
        t.append(now)
        error.append(float(trip.car.now["speed_x"]) - np.interp(now, *np.transpose(rows)))
        pedal.append(float(trip.driver["pedal_position"][0]))
        torque.append(float(trip.car.now["motor_torque"].sum()))
    at = np.searchsorted(t, [2.0, 8.0, 20.0, 30.0, 38.0, 44.0])
    assert t[-1] == pytest.approx(45.0)
    assert np.std(error) < 0.3  # the hydraulics alone brake harder than the driver expects
    assert np.max(np.abs(error)) < 1.0
    assert np.array(pedal)[at] == pytest.approx([30.0, 0.0, 0.0, 0.0, 20.0, 30.0], abs=5.0)
    assert list(np.sign(np.round(np.array(torque)[at], -1))) == [0, -1, -1, 1, 0, 0]  # negative drives


def test_a_trace_is_held_downhill_on_the_pedal(car_at: Callable[[float], Any]) -> None:
    plan = following((0.0, 15.0), (30.0, 15.0))._replace(grade=np.array([[0.0, -0.15]]))
    trip = Trip(car_at(15.0), plan)
    trip.run(29.0)
    assert trip.car.now["speed_x"] == pytest.approx(15.0, abs=0.1)
    assert trip.driver["pedal_position"][0] > 5.0
    force = 2105 * 9.81 * np.sin(0.15) - 0.5 * 1.2 * 0.35 * 2.32 * 15.0**2  # of the tyres: slope less drag
    assert -trip.car.now["force_x"].sum() == pytest.approx(force, rel=0.03)


@pytest.mark.parametrize("share", [0.0, 0.2, 0.4, 0.6, 0.8])
def test_motors_take_their_share_and_the_brakes_the_rest(
    car_at: Callable[[float], Any], share: float
) -> None:
    trip = Trip(car_at(20.0), script({"kind": BRAKE, "decel": 4.0})._replace(motor_share=share))
    trip.run(1.0)
    assert trip.driver["decel_demand"][0] == pytest.approx(4.0 * (1.0 - share))
    force = float((trip.car.now["motor_torque"] / trip.car.now["rolling_radius"]).sum())
    assert force == pytest.approx(share * 2105.0 * 4.0, rel=0.01, abs=1.0)


def test_the_brakes_make_up_for_motors_that_can_do_no_more(car_at: Callable[[float], Any]) -> None:
    """ECE R13-H: at a speed v 42 kW are 42000 / v N at each wheel; below some 3 m/s the motors fade out."""
    trip = Trip(car_at(35.0), script({"kind": BRAKE, "decel": 5.0})._replace(motor_share=1.0))
    trip.run(0.6)
    force = (42000.0 / (trip.car.now["wheel_speed"] * trip.car.now["rolling_radius"])).sum()
    assert trip.driver["decel_demand"][0] == pytest.approx(5.0 - force / 2105.0, rel=0.01)
    slow = Trip(car_at(1.0), script({"kind": BRAKE, "decel": 5.0, "ramp": 1e3})._replace(motor_share=1.0))
    slow.run(0.02)
    assert slow.driver["decel_demand"][0] > 2.0


@pytest.mark.parametrize(("cycles", "stiffness"), [(4, 22.0), (5, 22.0), (6, 0.67 * 22.0), (20, 0.67 * 22.0)])
def test_tyres_soften_once_in_the_cycle_of_their_fault(
    car_at: Callable[[float], Any], cycles: int, stiffness: float
) -> None:
    trip = Trip(car_at(20.0), script({"kind": COAST})._replace(fault_cycle=5, fault_stiffness=0.67))
    trip.run(cycles * CYCLE)
    assert trip.car.params["slip_stiffness"][0] == pytest.approx(np.full(4, stiffness))


def test_the_battery_takes_what_the_script_says(car_at: Callable[[float], Any]) -> None:
    table = np.array([[0.0, 80e3], [0.5, 80e3], [1.0, 0.0]])
    trip = Trip(car_at(20.0), script({"kind": COAST})._replace(charge_limit=table))
    for seconds, power in ((0.4, 80e3), (0.35, 40e3), (0.5, 0.0)):
        trip.run(seconds)
        now = trip.car.now
        assert float(now["motor_limit"] @ now["wheel_speed"]) == pytest.approx(power, rel=0.05, abs=1.0)


def test_rain_cools_the_discs_of_a_moving_car(car_at: Callable[[float], Any]) -> None:
    left = []
    for wetness in (0.0, 1.0):
        trip = Trip(car_at(30.0), script({"kind": CRUISE, "speed": 30.0})._replace(wetness=wetness))
        trip.run(10.0)
        left.append(trip.car.now["disc_temperature"] - 20.0)
    # Lining A's disc: exp(-(delta_0 + delta_1 v) t), rain doubles delta_1.
    assert left[1][0] / left[0][0] == pytest.approx(np.exp(-9.108e-5 * 30.0 * 10.0), rel=1e-3)


@pytest.mark.parametrize("start", [14.9, 15.0, 15.1])
def test_cruising_ends_at_its_speed_from_below(car_at: Callable[[float], Any], start: float) -> None:
    trip = Trip(car_at(start), script({"kind": CRUISE, "speed": 17.0, "until_speed": 15.0}))
    trip.run(0.5)
    assert not trip.cycle()


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
