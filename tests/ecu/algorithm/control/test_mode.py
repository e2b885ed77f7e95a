"""Which lost input gives which fault bit and which mode."""

import numpy as np
import pytest

from ecu.algorithm.control.mode import MODE_STATE, decide_mode, input_faults, request_lost, speaks
from ecu.contract.faults import (
    BUS_OFF,
    DEMAND_LIMITED,
    FILTER_RESET,
    FOREIGN_SENDER,
    HYDRAULICS_NOT_READY,
    IMU_LOST,
    MOTOR_TORQUE_LOST,
    PEDAL_IMPLAUSIBLE,
    PEDAL_LOST,
    PRESSURE_LOST,
    REQUEST_LOST,
    STEERING_LOST,
    WHEEL_SPEED_LOST,
)
from ecu.contract.signals import ACTIVE, ALIVE, DEGRADED, FAILED, INPUT, READY, STARTING, VALID

ALL_GOOD = {"pedal_position": 0.0, "pedal_pressed": 0.0, "decel_demand_valid": 1.0, "hydraulic_ready": 1.0}

# lost inputs, demand valid, fault bits, mode in operation without braking
LOST = [
    ("nothing", [], 1, 0, READY),
    *[
        (f"wheel speed {c}", [f"wheel_speed_{c}"], 1, WHEEL_SPEED_LOST, DEGRADED)
        for c in ("fl", "fr", "rl", "rr")
    ],
    *[
        (f"pressure {c}", [f"calliper_pressure_{c}"], 1, PRESSURE_LOST, DEGRADED)
        for c in ("fl", "fr", "rl", "rr")
    ],
    ("longitudinal acceleration", ["accel_x"], 1, IMU_LOST, DEGRADED),
    ("steering angle", ["steering_angle"], 1, STEERING_LOST, READY),
    ("yaw rate", ["yaw_rate"], 1, STEERING_LOST, READY),
    ("automated demand, pedal there", ["decel_demand", "decel_demand_valid"], 1, 0, READY),
    ("pedal position, its switch there", ["pedal_position", "decel_demand"], 1, PEDAL_LOST, DEGRADED),
    ("pedal switch, its position there", ["pedal_pressed", "decel_demand"], 1, 0, READY),
    (
        "pedal and demand",
        ["pedal_position", "pedal_pressed", "decel_demand"],
        1,
        PEDAL_LOST | REQUEST_LOST,
        FAILED,
    ),
    ("pedal, demand valid", ["pedal_position", "pedal_pressed"], 1, PEDAL_LOST, DEGRADED),
    ("pedal, demand not valid", ["pedal_position", "pedal_pressed"], 0, PEDAL_LOST | REQUEST_LOST, FAILED),
    (
        "pedal, validity of the demand lost",
        ["pedal_position", "pedal_pressed", "decel_demand_valid"],
        1,
        PEDAL_LOST | REQUEST_LOST,
        FAILED,
    ),
    ("speed reference", ["vehicle_speed", "vehicle_speed_valid"], 1, 0, READY),
    ("ambient", ["ambient_temperature", "rain"], 1, 0, READY),
    (
        "wheel speed and request",
        ["wheel_speed_fl", "pedal_position", "pedal_pressed", "decel_demand"],
        1,
        WHEEL_SPEED_LOST | PEDAL_LOST | REQUEST_LOST,
        FAILED,
    ),
]


def running():
    """Return the state of a car that was complete once."""
    state = np.zeros(1, MODE_STATE)
    decide_mode(state[0], 0, False, 0.01)
    return state[0]


@pytest.mark.parametrize("verdict", [0, ALIVE, VALID], ids=["never", "invalid", "stale"])
@pytest.mark.parametrize(("case", "lost", "valid", "bits", "mode"), LOST, ids=[row[0] for row in LOST])
def test_what_a_lost_input_means(params, feed, case, lost, valid, bits, mode, verdict) -> None:
    inputs = feed(**ALL_GOOD | {"decel_demand_valid": float(valid)})
    for name in lost:
        inputs[0]["verdict"][INPUT[name]] = verdict
    faults = input_faults(params[0], inputs[0]) | request_lost(params[0], inputs[0])
    assert faults == bits
    assert decide_mode(running(), faults, False, 0.01) == mode
    expected = mode if mode in (DEGRADED, FAILED) else ACTIVE
    assert decide_mode(running(), faults, True, 0.01) == expected


def test_a_pedal_that_is_lost_beside_a_valid_demand_is_seen(params, feed) -> None:
    inputs = feed(**ALL_GOOD)
    inputs[0]["verdict"][INPUT["pedal_position"]] = 0
    assert input_faults(params[0], inputs[0]) == PEDAL_LOST


@pytest.mark.parametrize(
    ("position", "pressed", "bit"),
    [
        (5.0, 0, 0),
        (5.1, 0, PEDAL_IMPLAUSIBLE),
        (5.1, 0.49, PEDAL_IMPLAUSIBLE),
        (5.1, 0.5, 0),
        (5.1, 1, 0),
        (0, 0, 0),
        (0, 1, 0),
    ],
)
def test_a_pedal_that_is_pressed_and_free_at_once(params, feed, position, pressed, bit) -> None:
    inputs = feed(**ALL_GOOD | {"pedal_position": position, "pedal_pressed": pressed})
    assert input_faults(params[0], inputs[0]) == bit


@pytest.mark.parametrize(("lost", "bit"), [("pedal_position", PEDAL_LOST), ("pedal_pressed", 0)])
def test_a_lost_half_of_the_pedal_contradicts_nothing(params, feed, lost, bit) -> None:
    inputs = feed(**ALL_GOOD | {"pedal_position": 50.0, "pedal_pressed": 0.0})
    inputs[0]["verdict"][INPUT[lost]] = ALIVE
    assert input_faults(params[0], inputs[0]) == bit


@pytest.mark.parametrize(
    ("ready", "bit"),
    [(1.0, 0), (0.5, 0), (0.49, HYDRAULICS_NOT_READY), (0.0, HYDRAULICS_NOT_READY)],
)
def test_hydraulics_that_are_not_ready(params, feed, ready, bit) -> None:
    assert input_faults(params[0], feed(**ALL_GOOD | {"hydraulic_ready": ready})[0]) == bit


@pytest.mark.parametrize("verdict", [0, ALIVE, VALID], ids=["never", "invalid", "stale"])
def test_hydraulics_that_say_nothing_are_not_reported_as_not_ready(params, feed, verdict) -> None:
    inputs = feed(**ALL_GOOD | {"hydraulic_ready": 0.0})
    inputs[0]["verdict"][INPUT["hydraulic_ready"]] = verdict
    assert input_faults(params[0], inputs[0]) == 0


@pytest.mark.parametrize("corner", ["fl", "fr", "rl", "rr"])
@pytest.mark.parametrize("verdict", [ALIVE, VALID], ids=["invalid", "stale"])
def test_a_motor_torque_that_came_and_is_lost(params, feed, corner, verdict) -> None:
    inputs = feed(**ALL_GOOD)
    place = INPUT[f"motor_torque_{corner}"]
    inputs[0]["verdict"][place], inputs[0]["value"][place] = verdict, 80.0
    assert input_faults(params[0], inputs[0]) == MOTOR_TORQUE_LOST
    assert decide_mode(running(), MOTOR_TORQUE_LOST, False, 0.01) == READY


def test_a_steering_angle_that_the_car_does_not_have_is_not_lost(params, feed) -> None:
    inputs = feed(**ALL_GOOD)
    place = INPUT["steering_angle"]
    inputs[0]["verdict"][place], params[0]["mapped"][place] = 0, 0
    assert input_faults(params[0], inputs[0]) == 0


@pytest.mark.parametrize(
    ("mapped", "armed", "bits"),
    [
        ([], 0, 0),
        ([], 1, REQUEST_LOST),
        (["pedal_position"], 0, PEDAL_LOST | REQUEST_LOST),
        (["decel_demand"], 0, REQUEST_LOST),
        (["pedal_position", "decel_demand"], 1, PEDAL_LOST | REQUEST_LOST),
    ],
)
def test_a_shadow_without_any_source_of_a_demand_misses_none(params, feed, mapped, armed, bits) -> None:
    """A recorded car; an armed ECU that nobody can ask is one whose request is lost."""
    inputs = feed(**ALL_GOOD | {"decel_demand_valid": 0.0})
    params[0]["transmit"] = armed
    for name in ("pedal_position", "pedal_pressed", "decel_demand"):
        inputs[0]["verdict"][INPUT[name]] = 0
    for name in ("pedal_position", "decel_demand"):
        params[0]["mapped"][INPUT[name]] = name in mapped
    assert input_faults(params[0], inputs[0]) | request_lost(params[0], inputs[0]) == bits


@pytest.mark.parametrize(
    ("fault", "mode"),
    [(BUS_OFF, DEGRADED), (FOREIGN_SENDER, DEGRADED), (DEMAND_LIMITED, READY), (FILTER_RESET, READY)],
)
def test_faults_that_only_the_service_or_a_filter_sees(fault, mode) -> None:
    assert decide_mode(running(), fault, False, 0.01) == mode


@pytest.mark.parametrize(
    ("missing", "after"), [(WHEEL_SPEED_LOST, DEGRADED), (REQUEST_LOST, FAILED), (IMU_LOST, DEGRADED)]
)
def test_the_start_waits_a_second_for_what_is_missing(missing: int, after: int) -> None:
    state = np.zeros(1, MODE_STATE)
    modes = [decide_mode(state[0], missing, False, 0.01) for _ in range(110)]
    assert set(modes[:98]) == {STARTING}
    assert set(modes[101:]) == {after}


def test_the_start_ends_when_everything_is_there_and_does_not_come_back() -> None:
    state = np.zeros(1, MODE_STATE)
    assert decide_mode(state[0], IMU_LOST, False, 0.01) == STARTING
    assert decide_mode(state[0], 0, False, 0.01) == READY
    assert decide_mode(state[0], IMU_LOST, False, 0.01) == DEGRADED
    assert decide_mode(state[0], 0, True, 0.01) == ACTIVE


@pytest.mark.parametrize(("age", "mode"), [(0.99, STARTING), (1.0, DEGRADED)])
def test_the_start_is_over_after_a_second(age: float, mode: int) -> None:
    assert decide_mode(np.zeros(1, MODE_STATE)[0], IMU_LOST, False, age) == mode


@pytest.mark.parametrize(
    ("mode", "armed"),
    [(STARTING, False), (READY, True), (ACTIVE, True), (DEGRADED, True), (FAILED, False)],
)
def test_demands_are_valid_where_the_ecu_is_armed_and_neither_starts_nor_has_failed(
    params, mode: int, armed: bool
) -> None:
    for transmit in (0, 1):
        params[0]["transmit"] = transmit
        assert speaks(params[0], mode) == (armed and transmit == 1)
