"""Rolling radius (A.4), speeds of the wheels (A.5), sum of tyre forces (4.16), worked out here as well."""

import math

import numpy as np
import pytest

from ecu.algorithm.estimation.motion import MOTION_STATE, update_motion
from ecu.algorithm.vehicle import corner_speed, rolling_radius, set_steering, total_tyre_force

G = 9.81
RADIUS, STIFFNESS = 0.3705, 250e3


def chord_per_arc(load: float) -> float:
    """Return contact length over the tread that passes it: an inextensible belt of radius r_0 flattened at
    the height r_0 - F/K has a half chord sqrt(r_0^2 - h^2); the wheel turns by its half angle meanwhile."""
    height = RADIUS - load / STIFFNESS
    half_chord = math.sqrt(RADIUS**2 - height**2)
    return half_chord / math.atan2(half_chord, height)


@pytest.mark.parametrize("load", [50.0, 500.0, 2000.0, 5000.0, 8000.0, 12000.0])
def test_the_radius_is_the_chord_of_the_contact_over_its_angle(load: float) -> None:
    assert rolling_radius(load, RADIUS, STIFFNESS) == pytest.approx(chord_per_arc(load), rel=1e-12)


@pytest.mark.parametrize(("load", "expected"), [(0.0, RADIUS), (1e-6, RADIUS), (-500.0, RADIUS)])
def test_an_unloaded_wheel_rolls_on_its_unloaded_radius(load: float, expected: float) -> None:
    assert rolling_radius(load, RADIUS, STIFFNESS) == pytest.approx(expected, rel=1e-9)


def test_small_deflection_takes_a_third_of_it_from_the_radius() -> None:
    deflection = 1e-5
    lost = RADIUS - rolling_radius(deflection * STIFFNESS, RADIUS, STIFFNESS)
    assert lost == pytest.approx(deflection / 3, rel=1e-4)


def test_load_transfer_of_4_m_s2_is_about_a_millimetre() -> None:
    static, transfer = 5300.0, 2105 * 4 * 0.65 / (2 * 2.665)
    change = rolling_radius(static, RADIUS, STIFFNESS) - rolling_radius(static + transfer, RADIUS, STIFFNESS)
    assert change == pytest.approx(1.2e-3, rel=0.25)


def test_the_radius_falls_with_every_newton_and_stays_positive_for_absurd_loads() -> None:
    radii = [rolling_radius(load, RADIUS, STIFFNESS) for load in range(0, 40_000, 500)]
    assert (np.diff(radii) < 0).all()
    assert 0 < rolling_radius(1e9, RADIUS, STIFFNESS) < RADIUS


def rigid_body_speed(
    params, speed: float, lateral: float, yaw_rate: float, steering: float, corner: int
) -> float:
    """Return v + omega x r of a wheel hub, projected on its rolling direction."""
    p = params[0]
    x = p["front_axle"] if corner < 2 else -p["rear_axle"]
    y = 0.5 * p["track"] * (1 if corner % 2 == 0 else -1)  # left is positive
    hub = np.array([speed, lateral, 0.0]) + np.cross([0.0, 0.0, yaw_rate], [x, y, 0.0])
    angle = steering if corner < 2 else 0.0
    return float(hub @ [math.cos(angle), math.sin(angle), 0.0])


@pytest.mark.parametrize("corner", range(4))
@pytest.mark.parametrize(
    ("manoeuvre", "speed", "lateral", "yaw_rate", "steering"),
    [
        ("straight", 30.0, 0.0, 0.0, 0.0),
        ("left turn", 15.0, 0.2, 0.4, 0.08),
        ("right turn", 15.0, -0.2, -0.4, -0.08),
        ("tight left turn at low speed", 4.0, 0.5, 0.9, 0.5),
        ("skid", 20.0, -2.0, 0.3, -0.2),
    ],
)
def test_corner_speeds_are_those_of_a_rigid_body(
    params, manoeuvre: str, speed: float, lateral: float, yaw_rate: float, steering: float, corner: int
) -> None:
    state = np.zeros(1, MOTION_STATE)
    state["lateral_speed"], state["yaw_rate"], state["steering"] = lateral, yaw_rate, steering
    expected = rigid_body_speed(params, speed, lateral, yaw_rate, steering, corner)
    assert corner_speed(params[0], state[0], speed, corner) == pytest.approx(expected, abs=1e-12), manoeuvre
    set_steering(state[0], 0.3)
    set_steering(state[0], steering)  # cosine and sine are those of the last angle
    assert corner_speed(params[0], state[0], speed, corner) == pytest.approx(expected, abs=1e-12), manoeuvre


@pytest.mark.parametrize("grade", [-0.15, -0.05, 0.0, 0.08, 0.15])
@pytest.mark.parametrize("force", [-12000.0, -4000.0, 0.0, 3000.0])
def test_total_force_does_not_depend_on_the_slope(params, feed, grade: float, force: float) -> None:
    p, speed = params[0], 25.0
    drag = 0.5 * 1.2 * 0.35 * 2.32 * speed**2
    acceleration = (force - drag) / p["mass"] - G * math.sin(grade)  # Newton along the road
    specific = acceleration + G * math.sin(grade)  # what a sensor feels
    pitch = -p["pitch_gradient"] * specific
    reading = specific * math.cos(pitch) - G * math.cos(grade) * math.sin(pitch)
    motion = np.zeros(1, MOTION_STATE)[0]
    update_motion(p, motion, feed(accel_x=reading)[0], speed, np.zeros(4))
    assert total_tyre_force(p, motion, speed) == pytest.approx(force, abs=25.0 + 0.002 * abs(force))


@pytest.mark.parametrize(("accel_y", "steering"), [(4.0, 0.05), (-4.0, -0.05), (3.0, 0.2)])
def test_in_a_curve_the_front_tyres_side_force_is_taken_out(params, accel_y: float, steering: float) -> None:
    """(A.1a): m a_x = F_L - F_S,f sin(delta) - drag with F_S,f = m a_y l_r / L (steady turn)."""
    p, speed, longitudinal = params[0], 15.0, -5000.0
    side = p["mass"] * accel_y * p["rear_axle"] / p["wheelbase"]
    motion = np.zeros(1, MOTION_STATE)[0]
    drag = 0.5 * 1.2 * 0.35 * 2.32 * speed**2
    motion["accel_x"] = (longitudinal - side * math.sin(steering) - drag) / p["mass"]
    motion["accel_y"], motion["steering"] = accel_y, steering
    assert total_tyre_force(p, motion, speed) == pytest.approx(longitudinal)
