"""The model of a car against its own equations, written out for a single window."""

import numpy as np
import pytest

from brakelab.identify.vehicle.model import (
    Place,
    brakes_of,
    motion,
    prior_of,
    residuals_of,
    seen,
    signals_of,
    stiffness_of,
)
from brakelab.identify.vehicle.windows import Windows
from ecu.contract.params import GRAVITY

from .example import suv


def both(value, n):
    return np.broadcast_to(np.asarray(value, float), (2, n)).copy()


def steady(accel, speed, pressure=(0.0, 0.0), motor=0.0, reference=True):
    """Return windows of a straight road; wheels at the speed of a rigid wheel of 0.36 m."""
    n = len(accel)
    omega = np.stack([both(speed / 0.36, n)] * 4)
    bar = np.stack([both(pressure[k // 2], n) for k in range(4)])
    yes = np.ones(n, bool)
    brakes = yes if max(pressure) > 0 else ~yes
    return Windows(
        drive=np.zeros(n, np.int64), t=np.arange(n) * 0.5, omega=omega, spin_up=np.zeros((2, 2, n)),
        accel=both(accel, n), accel_sum=both(0.0, n), accel_y=both(0.0, n), yaw_rate=both(0.0, n),
        speed=both(speed if reference else np.nan, n), speed_rate=both(accel, n), pressure=bar,
        motor=np.stack([both(motor, n)] * 4), free=~brakes, braking=brakes, steady=yes, straight=yes,
        standing=~yes, cluster=np.arange(n),
    )  # fmt: skip


def theta_of(windows):
    params = suv()[0]
    return prior_of(params, signals_of(windows, params)).mean, params


def test_rolling_free_the_balance_is_drag_and_rolling_resistance():
    windows = steady(np.array([-0.3, -0.3]), np.array([10.0, 30.0]))
    theta, params = theta_of(windows)
    found = motion(theta, seen(windows, 0), params)
    mass, kappa = params["mass"], 1.0 + GRAVITY * params["pitch_gradient"]
    drag = params["drag_area"] * np.array([10.0, 30.0]) ** 2
    load = 1.0 + 0.3 / kappa * np.exp(theta[Place.LOAD_F]), 1.0 - 0.3 / kappa * np.exp(theta[Place.LOAD_R])
    share = params["rear_axle"] / params["wheelbase"]
    weight = mass * GRAVITY * (share * load[0] + (1 - share) * load[1])
    by_hand = -0.3 + kappa * (params["rolling_resistance"] * weight + drag) / mass
    assert found.balance == pytest.approx(by_hand, rel=1e-9)


def test_brakes_and_motors_balance_the_deceleration():
    windows = steady(np.array([-3.0]), np.array([20.0]), (30.0, 20.0), 100.0)
    theta, params = theta_of(windows)
    theta[Place.ROLLING] = 0.0
    found = motion(theta, seen(windows, 1), params)
    per_bar = 4e5 * params["piston_area"] * params["effective_radius"] * params["mu_nominal"]
    accel = -3.0 / (1.0 + GRAVITY * params["pitch_gradient"])
    sink = np.exp(theta[Place.DEFLECTION]) * accel
    for axle, (pressure, sign) in enumerate(((30.0, 1.0), (20.0, -1.0))):
        radius = params["wheel_radius"][2 * axle] * (1.0 + sign * sink)
        torque = per_bar[2 * axle] * (pressure - 0.5) + 200.0
        assert -found.force[axle, 0] == pytest.approx(torque / radius, rel=1e-9)


def test_slip_is_force_over_stiffness_and_the_speed_follows():
    windows = steady(np.array([-2.0]), np.array([20.0]), motor=300.0)
    theta, params = theta_of(windows)
    theta[[Place.CURVE, Place.ROLLING]] = 0.0
    theta[[Place.LOAD_F, Place.LOAD_R, Place.DEFLECTION]] = -20.0  # no load transfer
    found = motion(theta, seen(windows, 0), params)
    stiffness = (params["slip_stiffness"] * params["static_load"]).reshape(2, 2).sum(axis=1)
    assert stiffness_of(theta) == pytest.approx(stiffness)
    slip = -600.0 / params["wheel_radius"][::2] / stiffness
    assert found.slip[:, 0] == pytest.approx(slip, rel=1e-6)
    assert found.axle[:, 0] == pytest.approx(
        20.0 / 0.36 * params["wheel_radius"][::2] / (1.0 + slip), rel=1e-6
    )


def test_the_prior_is_start():
    params = suv()[0]
    windows = steady(np.array([-1.0]), np.array([20.0]))
    theta, _ = theta_of(windows)
    per_bar = 4e5 * params["piston_area"] * params["effective_radius"] * params["mu_nominal"]
    assert brakes_of(theta) == pytest.approx(per_bar[::2])
    assert np.exp(theta[Place.MASS]) == pytest.approx(params["mass"])


@pytest.mark.parametrize("reference", [True, False])
def test_without_a_reference_the_front_axle_is_the_measure(reference):
    n = 4
    windows = steady(np.full(n, -2.0), np.linspace(10.0, 25.0, n), (20.0, 10.0), reference=reference)
    params = suv()[0]
    signals = signals_of(windows, params)
    assert signals.speed == reference
    found = residuals_of(windows, params, signals, (0.001, 0.005))
    assert len(found.kind) == (3 * n if reference else 2 * n)
    prior = prior_of(params, signals)
    assert (prior.sigma[Place.RADIUS_F] > 0.0) == reference
    assert found.of(prior.mean, 0).shape == found.kind.shape


def test_mass_is_held_where_no_torque_is_known_well():
    windows = steady(np.array([-1.0]), np.array([20.0]), motor=np.nan)
    params = suv()[0]
    signals = signals_of(windows, params)
    assert not signals.motor
    assert not signals.torque
    assert prior_of(params, signals).sigma[Place.MASS] == 0.0
    rough = suv()
    rough["sigma_motor_torque"] = 0.3
    assert not signals_of(steady(np.array([-1.0]), np.array([20.0]), motor=5.0), rough[0]).motor
