"""Variance of a wheel's measurement: what a correction's test ratio says of it, beside each part by hand."""

import math

import numpy as np
import pytest

from ecu.algorithm.estimation.joint.layout import OFFSET, WHEEL_RATIO, V
from ecu.algorithm.estimation.joint.wheel_speed import correct_by_wheel, predict_wheel

SPEED, PRESSURES, SAMPLES, OFF = 20.0, (35.0, 28.0), 5, 0.3  # m/s, bar, -, rad/s


def prepared(params, state, across: float, noise_bar: float = 0.0):
    """Return a state at the end of a window of steady braking."""
    car, w = params[0], state["window"]
    state["x"][V] = SPEED
    w["load"], w["cycles"], w["omega_samples"], w["across"] = car["static_load"], SAMPLES, SAMPLES, across
    w["ground"], w["pressure_variance"] = SPEED, noise_bar**2
    w["pressure"] = state["smooth_pressure"] = state["last_smooth"] = np.repeat(PRESSURES, 2)
    state["free"] = 1
    return state


def variance_of(params, state, i: int) -> tuple[float, float, float, float]:
    """Return the measurement's variance, slip, its part beyond a linear tyre, and derivative by pressure."""
    w = state["window"]
    w["omega"][i] = predict_wheel(params[0], state, i, SPEED) + OFF
    h, P = state["h"].copy(), state["p"].copy()
    slip, curved = float(state["slip"][i]), float(state["curved"])
    correct_by_wheel(params[0], state, i, SPEED, True, True)
    return (
        OFF**2 / float(state["ratio"][WHEEL_RATIO + i]) - h @ P @ h,
        slip,
        curved,
        float(h[OFFSET + i // 2]),
    )


@pytest.mark.parametrize("noise_bar", [0.0, 1.8])
@pytest.mark.parametrize("across", [0.0, 0.2, 0.4])  # lateral acceleration over gravity
@pytest.mark.parametrize("i", [0, 3])
def test_a_wheels_variance_is_the_sum_of_its_parts(params, state, i: int, across: float, noise_bar) -> None:
    """Sensor, pressure, a tyre that is not linear, and a curve by the square of what is used sideways."""
    car = params[0]
    found, slip, curved, per_bar = variance_of(params, prepared(params, state, across, noise_bar), i)
    rolled = SPEED / float(car["wheel_radius"][i])
    parts = [
        float(car["sigma_wheel_speed"]) / math.sqrt(SAMPLES),
        per_bar * noise_bar,
        curved * rolled,
        across**2 * slip * rolled,
    ]
    assert found == pytest.approx(sum(part**2 for part in parts), rel=1e-6)
    assert slip < -0.005
