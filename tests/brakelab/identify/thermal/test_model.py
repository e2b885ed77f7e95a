"""Closed form of the disc model beside scipy's integration, and the sensor's lag beside its step response."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from brakelab.identify.thermal.model import Cooling, lagged, respond

SPEED = np.repeat([0.0, 10.0, 35.0, 20.0], 100)
POWER = np.where(np.arange(400) % 50 < 6, 40e3, 0.0)
COOLING = Cooling(1.8e-3, 1.0e-4, 2.6e-3, 2.2e-4)


@pytest.mark.parametrize("wet", [False, True])
def test_excess_is_that_of_an_integrated_lump(wet) -> None:
    xi, start = 2.1e-4, 55.0
    rate = COOLING.rate(SPEED, np.full(400, wet))
    heat, decay = respond(rate, POWER)

    def slope(t, theta):
        row = min(int(t), 399)
        still, by_speed = (2.6e-3, 2.2e-4) if wet else (1.8e-3, 1.0e-4)
        return xi * POWER[row] - (still + by_speed * SPEED[row]) * theta

    found = solve_ivp(slope, (0.0, 400.0), [start], t_eval=np.arange(1.0, 400.5), max_step=0.2, rtol=1e-8)
    assert xi * heat + start * decay == pytest.approx(found.y[0], abs=0.05)
    assert found.y[0].max() > 100.0


def test_a_disc_that_only_cools_follows_the_exponential() -> None:
    rate = np.full(3600, 3.1e-3)
    heat, decay = respond(rate, np.zeros(3600))
    assert not heat.any()
    assert decay == pytest.approx(np.exp(-3.1e-3 * np.arange(1, 3601)))


def test_a_day_of_driving_does_not_overflow() -> None:
    rate, power = np.full(200_000, 0.02), np.where(np.arange(200_000) % 300 < 5, 60e3, 0.0)
    heat, _ = respond(rate, power)
    assert np.isfinite(heat).all()
    assert heat[-300:] == pytest.approx(heat[-90_300:-90_000], rel=1e-9)  # periodic by then


@pytest.mark.parametrize("lag", [0.5, 3.0, 20.0])
def test_the_sensor_lags_by_its_time_constant(lag) -> None:
    step = np.concatenate([np.full(10, 20.0), np.full(200, 120.0)])
    shown = lagged(step, lag)
    t = np.arange(1, 201)
    assert shown[:10] == pytest.approx(20.0)
    assert shown[10:] == pytest.approx(120.0 - 100.0 * np.exp(-t / lag))
