"""What is asked of the inputs: is a signal there, who brakes, the pedal map, the larger of two demands."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ecu.algorithm.inputs import (
    current,
    driver_accelerates,
    fresh,
    mean_wheel_speed,
    motor_torque,
    motor_torque_known,
    no_wheel_known,
    others_brake,
    pedal_known,
    pedal_to_decel,
    requested_decel,
    share_pressures,
    usable,
    wheels_mapped,
)
from ecu.contract.signals import (
    ABS_ACTIVE,
    ACCEL_X,
    ACCELERATOR_POSITION,
    ALIVE,
    CALLIPER_PRESSURE,
    DECEL_DEMAND,
    DECEL_DEMAND_VALID,
    ESP_ACTIVE,
    MOTOR_TORQUE,
    PEDAL_POSITION,
    PEDAL_PRESSED,
    RATE_OK,
    USABLE,
    VALID,
    WHEEL_SPEED,
)
from ecu.settings.config import load_config, new_params

CONFIGS = Path(__file__).parents[3] / "config"
MAP = [(0, 0), (5, 0), (20, 0.8), (40, 2.1), (60, 4.0), (80, 6.6), (100, 10.0)]  # config/suv.toml


@pytest.mark.parametrize(("position", "decel"), MAP)
def test_the_points_of_the_map(params, position: float, decel: float) -> None:
    assert pedal_to_decel(params[0], float(position)) == pytest.approx(decel)


@pytest.mark.parametrize(
    ("position", "decel"), [(12.5, 0.4), (50.0, 3.05), (90.0, 8.3), (-5.0, 0.0), (130.0, 10.0)]
)
def test_between_and_beyond_the_points(params, position: float, decel: float) -> None:
    assert pedal_to_decel(params[0], position) == pytest.approx(decel)


@pytest.fixture(scope="module")
def suv():
    return new_params(load_config(CONFIGS / "suv.toml"))[0]


@given(st.floats(-20, 150), st.floats(0, 50))
def test_pushing_further_never_asks_for_less(suv, position: float, further: float) -> None:
    assert pedal_to_decel(suv, position + further) >= pedal_to_decel(suv, position)


@given(st.lists(st.tuples(st.floats(0, 100), st.floats(0, 12)), min_size=2, max_size=8))
def test_any_rising_map_gives_what_numpy_interpolates(suv, points: list[tuple[float, float]]) -> None:
    xs, ys = sorted({round(x, 3) for x, _ in points}), sorted(y for _, y in points)
    ys = ys[: len(xs)]
    params = suv.copy()
    params["pedal_position"] = xs + xs[-1:] * (8 - len(xs))
    params["pedal_decel"] = ys + ys[-1:] * (8 - len(ys))
    for position in np.linspace(-10, 110, 25):
        expected = np.interp(position, xs, ys)
        assert pedal_to_decel(params, position) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("case", "pedal", "demand", "valid", "decel"),
    [
        ("pedal alone", 60.0, 0.0, 0.0, 4.0),
        ("automated demand alone", 0.0, 3.0, 1.0, 3.0),
        ("pedal is the larger", 80.0, 3.0, 1.0, 6.6),
        ("demand is the larger", 40.0, 3.0, 1.0, 3.0),
        ("demand not valid", 40.0, 9.0, 0.0, 2.1),
        ("nobody brakes", 0.0, 0.0, 1.0, 0.0),
    ],
)
@pytest.mark.requirement("REQ-DEM-6")
def test_the_larger_of_pedal_and_valid_demand_counts(params, feed, case, pedal, demand, valid, decel) -> None:
    inputs = feed(pedal_position=pedal, decel_demand=demand, decel_demand_valid=valid)
    assert requested_decel(params[0], inputs[0]) == pytest.approx(decel), case


@pytest.mark.parametrize("verdict", [0, ALIVE, VALID])
@pytest.mark.parametrize(
    ("case", "lost", "decel_valid", "expected"),
    [
        ("pedal lost, demand valid", (PEDAL_POSITION,), 1.0, 3.0),
        ("pedal lost, demand not valid: nobody asks", (PEDAL_POSITION,), 0.0, math.nan),
        ("demand lost", (DECEL_DEMAND,), 1.0, 2.1),
        ("both lost", (PEDAL_POSITION, DECEL_DEMAND), 1.0, math.nan),
        ("validity of the demand lost", (DECEL_DEMAND_VALID,), 1.0, 2.1),
    ],
)
def test_a_lost_request_is_not_a_request_for_nothing(
    params, feed, verdict, case, lost, decel_valid, expected
) -> None:
    inputs = feed(pedal_position=40.0, decel_demand=3.0, decel_demand_valid=decel_valid)
    for place in lost:
        inputs[0]["verdict"][place] = verdict
    assert requested_decel(params[0], inputs[0]) == pytest.approx(expected, nan_ok=True), case


@pytest.mark.parametrize("asked", [-1.0, 15.0, 1e9])
def test_an_absurd_demand_is_cut_to_what_a_road_holds(params, feed, asked: float) -> None:
    inputs = feed(decel_demand=asked, decel_demand_valid=1.0)
    assert 0.0 <= requested_decel(params[0], inputs[0]) <= 12.0


@pytest.mark.parametrize(
    ("case", "verdict", "value", "age_ms", "new", "expected"),
    [
        # expected: usable, younger than 50 ms, came in this cycle
        ("a sample of now", USABLE, 1.0, 0, 1, (True, True, True)),
        ("slower than it should be", ALIVE | VALID, 1.0, 40, 0, (True, True, False)),
        ("kept over a gap", USABLE, 1.0, 50, 0, (True, False, False)),
        ("silent", VALID | RATE_OK, 1.0, 0, 0, (False, False, False)),
        ("said to be invalid", ALIVE | RATE_OK, 1.0, 0, 0, (False, False, False)),
        ("not a number", USABLE, math.nan, 0, 1, (False, False, False)),
    ],
)
def test_what_a_signal_may_be_used_for(feed, case, verdict, value, age_ms, new, expected) -> None:
    inputs = feed(accel_x=value)[0]
    inputs["verdict"][ACCEL_X], inputs["age_ns"][ACCEL_X] = verdict, age_ms * 1_000_000
    inputs["new"][ACCEL_X] = new
    found = usable(inputs, ACCEL_X), current(inputs, ACCEL_X, 0.05), fresh(inputs, ACCEL_X)
    assert found == expected, case


@pytest.mark.parametrize(
    ("case", "torque", "verdict", "expected"),
    [
        ("regenerates", 120.0, USABLE, (120.0, True)),
        ("drives", -80.0, USABLE, (-80.0, True)),
        ("lost while it did something", 120.0, 0, (0.0, False)),
        ("a car without such motors", 0.0, 0, (0.0, True)),
    ],
)
def test_a_motor_torque_that_is_not_reported_counts_as_none(feed, case, torque, verdict, expected) -> None:
    inputs = feed(motor_torque=torque)[0]
    inputs["verdict"][MOTOR_TORQUE + 2] = verdict
    assert (motor_torque(inputs, 2), motor_torque_known(inputs, 2)) == expected, case


@pytest.mark.parametrize(("place", "value"), [(ABS_ACTIVE, 1.0), (ESP_ACTIVE, 1.0)])
def test_another_controller_that_works_brakes(feed, place: int, value: float) -> None:
    inputs = feed()[0]
    assert not others_brake(inputs)
    inputs["value"][place] = value
    assert others_brake(inputs)


@pytest.mark.parametrize(
    ("position", "verdict", "accelerates"), [(2.0, USABLE, False), (2.5, USABLE, True), (60.0, 0, False)]
)
def test_a_driver_is_known_to_accelerate_or_is_not_said_to(feed, position, verdict, accelerates) -> None:
    inputs = feed(accelerator_position=position)[0]
    inputs["verdict"][ACCELERATOR_POSITION] = verdict
    assert driver_accelerates(inputs) == accelerates


def test_the_mean_of_the_wheels_has_no_sign(params, feed) -> None:
    radius = params[0]["wheel_radius"]
    assert mean_wheel_speed(params[0], feed(wheel_speed=-8.0 / radius)[0]) == pytest.approx(8.0)
    four = np.array([8.0, 8.0, 4.0, 0.0])
    assert mean_wheel_speed(params[0], feed(wheel_speed=four / radius)[0]) == pytest.approx(5.0)


@pytest.mark.parametrize(("lost", "mean"), [(1, 4.0), (2, 2.0), (3, math.nan), (4, math.nan)])
def test_the_mean_is_of_two_wheels_at_least(params, feed, lost: int, mean: float) -> None:
    inputs = feed(wheel_speed=np.array([8.0, 8.0, 4.0, 0.0]) / params[0]["wheel_radius"])[0]
    inputs["verdict"][WHEEL_SPEED : WHEEL_SPEED + lost] = 0
    assert mean_wheel_speed(params[0], inputs) == pytest.approx(mean, nan_ok=True)


@pytest.mark.parametrize(("lost", "none"), [([], False), ([0, 1, 2], False), ([0, 1, 2, 3], True)])
def test_no_wheel_is_known_where_each_is_lost(feed, lost: list[int], none: bool) -> None:
    inputs = feed()[0]
    inputs["verdict"][[WHEEL_SPEED + i for i in lost]] = 0
    assert no_wheel_known(inputs) == none


@pytest.mark.parametrize(
    ("mapped", "any_of_them"), [([0, 0, 0, 0], False), ([0, 0, 0, 1], True), ([1, 1, 1, 1], True)]
)
def test_a_car_has_wheel_speeds_if_one_is_mapped(params, mapped: list[int], any_of_them: bool) -> None:
    params[0]["mapped"][WHEEL_SPEED : WHEEL_SPEED + 4] = mapped
    assert wheels_mapped(params[0]) == any_of_them


@pytest.mark.parametrize(
    ("position", "switch", "mapped", "known"),
    [(USABLE, 0, 1, True), (0, USABLE, 1, True), (0, USABLE, 0, False), (0, 0, 1, False)],
)
def test_a_pedal_is_known_by_position_or_switch(params, feed, position, switch, mapped, known) -> None:
    inputs = feed()[0]
    inputs["verdict"][PEDAL_POSITION], inputs["verdict"][PEDAL_PRESSED] = position, switch
    params[0]["mapped"][PEDAL_POSITION] = mapped
    assert pedal_known(params[0], inputs) == known


@pytest.mark.parametrize(
    ("received", "taken"),
    [
        ([1, 1, 1, 1], [0, 1, 2, 3]),
        ([1, 0, 1, 0], [0, 0, 2, 2]),  # one of each axle
        ([1, 1, 0, 0], [0, 1, 0, 1]),  # the front circuit alone
        ([0, 0, 1, 1], [2, 3, 2, 3]),
        ([1, 0, 0, 1], [0, 0, 3, 3]),  # one of two diagonal circuits has a sensor in front, one behind
        ([0, 0, 1, 0], [2, 2, 2, 2]),
        ([0, 0, 0, 0], [0, 1, 2, 3]),
    ],
)
def test_a_wheel_without_a_pressure_takes_that_of_another(params, feed, received, taken) -> None:
    car, bars = params[0], np.array([10.0, 20.0, 30.0, 40.0])
    four = slice(CALLIPER_PRESSURE, CALLIPER_PRESSURE + 4)
    for armed in (0, 1):
        car["transmit"], car["mapped"][four] = armed, received
        inputs = feed(calliper_pressure=bars)[0]
        inputs["new"][four] = inputs["verdict"][four] = inputs["age_ns"][four] = np.arange(4) + 1
        share_pressures(car, inputs)
        expected = np.arange(4) if armed else np.array(taken)
        assert (inputs["value"][four] == bars[expected]).all()
        for name in ("new", "verdict", "age_ns"):
            assert (inputs[name][four] == expected + 1).all(), name
