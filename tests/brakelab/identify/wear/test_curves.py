"""Curves of a wear law against a stop computed anew with the wrong torque or temperature."""

import numpy as np
import pytest

from brakelab.identify.wear.curves import TABLE_7_1, sensitivity, specific_wear, wear_surface
from brakelab.results.wear import regressors_of

LAW = np.array([0.05, 2e-4, 3e-7, 0.4, 1e-4, 3.0, 6e-3])


def stop(torque_factor: float = 1.0, warmer: float = 0.0) -> np.ndarray:
    t = np.arange(0.0, 5.0, 0.01)
    omega, torque = 80.0 - 14.0 * t, torque_factor * (500.0 + 40.0 * np.sin(t))
    return regressors_of(torque, omega, 120.0 + 15.0 * t + warmer, 0.01, 20)


@pytest.mark.parametrize("error", [-0.3, -0.05, 0.1, 0.3])
def test_an_error_of_friction_is_that_of_the_torque(error: float):
    (found,) = sensitivity(LAW, stop(), np.array([error]), "friction")
    assert found == pytest.approx(LAW @ stop(1.0 + error) / (LAW @ stop()) - 1.0, rel=1e-9)


@pytest.mark.parametrize("error", [-50.0, 10.0, 50.0])
def test_an_error_of_temperature_shifts_it_throughout(error: float):
    (found,) = sensitivity(LAW, stop(), np.array([error]), "temperature")
    assert found == pytest.approx(LAW @ stop(warmer=error) / (LAW @ stop()) - 1.0, rel=1e-9)


def test_figure_7_10_of_table_7_1():
    """Quasi-static: linear in friction, deaf to temperature; extended: more than linear, and it hears it."""
    extended, static = TABLE_7_1["extended"], TABLE_7_1["quasi-static"]
    assert sensitivity(static, stop(), np.array([0.2]), "friction") == pytest.approx([0.2])
    assert abs(sensitivity(static, stop(), np.array([50.0]), "temperature")[0]) < 0.10
    assert sensitivity(extended, stop(), np.array([0.2]), "friction")[0] > 0.2
    assert sensitivity(extended, stop(), np.array([50.0]), "temperature")[0] > 0.04


def test_figure_7_9_is_the_wear_of_a_short_stop_over_its_energy():
    """At 72 km/h, 2 m/s² of 700 kg, 200 degC: 28 kW, and omega'/omega 0.1 1/s."""
    surface = wear_surface(LAW, np.array([20.0]), np.array([200.0]), 2.0, 700.0)
    assert surface[0, 0] == pytest.approx(float(specific_wear(LAW, np.array([200.0]), 0.028, 0.1)[0]))
    omega = 20.0 / 0.36 * (1.0 - 1e-3 * np.arange(100))
    torque = np.full(100, 0.028e6) / omega
    x = regressors_of(torque, omega, np.full(100, 200.0), 0.01, 20)
    slow = np.abs(np.gradient(omega, 0.01) / omega).mean()
    expected = float(specific_wear(LAW, np.array([200.0]), 0.028, slow)[0])
    assert LAW @ x / x[0] == pytest.approx(expected, rel=1e-3)
