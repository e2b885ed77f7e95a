"""Accelerations in road axes, against a car that is pitched as a rigid body."""

import math

import numpy as np
import pytest

from ecu.algorithm.estimation.motion import MOTION_STATE, update_motion
from ecu.contract.signals import ACCEL_X, ALIVE, STEERING_ANGLE, VALID, YAW_RATE

G = 9.81


def reading(params, accel_x: float, grade: float, yaw_rate: float = 0.0) -> float:
    """Return what a body-fixed sensor reads: rotate the specific force into the body, no small angles.

    accel_x: sum of tyre forces and drag over mass, along the road; uphill grade in rad. ISO 8855: positive
    pitch turns the nose down, the body's x axis is (cos, -sin) in road axes (x forward, z up).
    """
    p = params[0]
    pitch = -p["pitch_gradient"] * accel_x
    specific_force_road = np.array([accel_x, G * math.cos(grade)])
    body_x = np.array([math.cos(pitch), -math.sin(pitch)])
    centripetal = -(yaw_rate**2) * p["imu_x"]  # a point ahead of the centre accelerates towards it
    return float(specific_force_road @ body_x) + centripetal


@pytest.mark.parametrize("accel_x", [-10.0, -8.0, -4.0, -1.0, 0.0, 2.0])
@pytest.mark.parametrize("grade", [-0.1, 0.0, 0.1])
def test_pitch_is_removed_from_the_reading(params, feed, accel_x: float, grade: float) -> None:
    state = np.zeros(1, MOTION_STATE)
    update_motion(params[0], state[0], feed(accel_x=reading(params, accel_x, grade))[0], 20.0, np.zeros(4))
    assert state[0]["accel_x"] == pytest.approx(accel_x, abs=0.012)


def test_the_dive_of_two_degrees_per_g_is_worth_a_quarter_of_a_metre_per_second_squared(params) -> None:
    assert reading(params, -8.0, 0.0) + 8.0 == pytest.approx(-0.28, abs=0.04)


@pytest.mark.parametrize("imu_x", [-0.5, 0.0, 0.9])
def test_a_sensor_ahead_of_the_centre_of_gravity_sees_the_centripetal_acceleration(
    params, feed, imu_x
) -> None:
    params[0]["imu_x"] = imu_x
    state = np.zeros(1, MOTION_STATE)
    inputs = feed(accel_x=reading(params, -3.0, 0.0, yaw_rate=0.8), yaw_rate=0.8)
    update_motion(params[0], state[0], inputs[0], 20.0, np.zeros(4))
    assert state[0]["accel_x"] == pytest.approx(-3.0, abs=0.02)


def test_lateral_speed_of_a_car_that_turns_on_its_rear_axle(params, feed) -> None:
    """Slowly round a bend the rear axle rolls without side slip: v_y = l_r psi_dot at the centre of gravity.
    Faster, the rear tyres slip outwards: v_y falls, as the rear force m a_y l_f / L needs a slip angle."""
    state = np.zeros(1, MOTION_STATE)
    update_motion(params[0], state[0], feed(yaw_rate=0.5, accel_y=0.0)[0], 1.0, np.zeros(4))
    assert state[0]["lateral_speed"] == pytest.approx(params[0]["rear_axle"] * 0.5)
    update_motion(params[0], state[0], feed(yaw_rate=0.2, accel_y=4.0)[0], 20.0, np.zeros(4))
    p = params[0]
    rear_load = p["mass"] * G * p["front_axle"] / p["wheelbase"]
    rear_slip = p["mass"] * 4.0 * p["front_axle"] / p["wheelbase"] / (p["cornering_stiffness"] * rear_load)
    # Rear slip angle (A.2c, corrected l_r): -(v_y - l_r psi_dot) / v_x
    assert -(state[0]["lateral_speed"] - p["rear_axle"] * 0.2) / 20.0 == pytest.approx(rear_slip)


@pytest.mark.parametrize(("lost", "field"), [(YAW_RATE, "yaw_rate"), (STEERING_ANGLE, "steering")])
@pytest.mark.parametrize("verdict", [0, ALIVE, VALID])
def test_a_signal_that_is_not_both_alive_and_valid_counts_as_zero(params, feed, lost, field, verdict) -> None:
    state = np.zeros(1, MOTION_STATE)
    inputs = feed(accel_x=-3.0, yaw_rate=0.1, steering_angle=0.1)
    inputs[0]["verdict"][lost] = verdict
    update_motion(params[0], state[0], inputs[0], 20.0, np.zeros(4))
    assert state[0][field] == 0.0


@pytest.mark.parametrize("verdict", [0, ALIVE, VALID])
def test_torques_and_drag_stand_in_for_a_lost_acceleration(params, feed, verdict) -> None:
    state = np.zeros(1, MOTION_STATE)
    inputs = feed(accel_x=-3.0, motor_torque_fl=100.0)
    inputs[0]["verdict"][ACCEL_X] = verdict
    update_motion(params[0], state[0], inputs[0], 20.0, np.array([500.0, 600.0, 300.0, 300.0]))
    car = params[0]
    tyres = -(500.0 + 100.0 + 600.0) / car["wheel_radius"][0] - 600.0 / car["wheel_radius"][2]
    assert state[0]["accel_x"] == pytest.approx((tyres - car["drag_area"] * 20.0**2) / car["mass"])


@pytest.mark.parametrize(("speed", "backwards"), [(-3.0, 1), (0.0, 1), (1.5, 1), (2.5, 0), (20.0, 0)])
def test_wheels_that_turn_backwards_drive_a_car_backwards_that_stood(params, feed, speed, backwards) -> None:
    state, inputs = np.zeros(1, MOTION_STATE), feed(wheel_speed=-3.0 / params[0]["wheel_radius"])
    update_motion(params[0], state[0], inputs[0], speed, np.zeros(4))
    assert state[0]["backwards"] == backwards
