"""What a wheel's speed is trusted with, worked out by hand from what is known of the window."""

from collections.abc import Callable
from typing import Any

import pytest

from ecu.estimation.joint.correction import correct_by_wheel
from ecu.estimation.joint.layout import V
from ecu.estimation.joint.wheel import predict_wheel


@pytest.mark.parametrize("across", [0.3, 0.5, 0.7, -0.5])
def test_a_wheel_in_a_corner_is_trusted_less(new_car: Callable[..., Any], across: float) -> None:
    """With a state that is known the variance is the wheel's own: slip times squared adhesion used sideways.

    At 0.5 g and 3 % of slip that is 0.6 rad/s at 25 m/s, twenty times the sensor's noise.
    """
    car = new_car(quiet=True, speed=25.0)
    state = car.drive(1.0, front=40.0, rear=20.0)
    window, params = state["window"], car.params
    state["p"][:] = state["unsettled"] = state["curved"] = 0.0
    window["across"], window["pressure_variance"] = across, 0.0
    state["last_smooth"][:], state["motors"]["variance"] = state["smooth_pressure"], 0.0
    window["omega_samples"], window["ground"] = 10.0, 25.0
    predicted = predict_wheel(params, state.copy(), 0, 25.0)
    window["omega"][0] = predicted + 0.1
    correct_by_wheel(params, state, 0, float(state["x"][V]), True, True)
    slip, radius = float(state["slip"][0]), float(params["wheel_radius"][0])
    assert -0.2 < slip < -0.005
    by_corner = across**2 * slip * 25.0 / radius
    sensor = float(params["sigma_wheel_speed"]) ** 2 / 10.0
    assert 0.1**2 / float(state["ratio"][0]) == pytest.approx(by_corner**2 + sensor, rel=0.1)
    assert by_corner**2 > 5.0 * sensor, "the corner is what counts here"
