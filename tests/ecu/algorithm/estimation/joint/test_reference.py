"""A speed reference: what it corrects, and when it is believed at once."""

import math

import numpy as np
import pytest

from ecu.algorithm.estimation.joint.layout import DELAY, REFERENCE_RATIO, V
from ecu.algorithm.estimation.joint.reference import correct_by_reference

SPEED, SAMPLES, SLOWING = 20.0, 5, -4.0  # m/s, -, m/s^2


def window(params, state, off: float, rolled: float = SPEED):
    """Return a state whose reference reads `off` [m/s] too much while the wheels roll at a speed [m/s]."""
    state["x"][V] = SPEED
    state["p"][:] = 0.0
    state["p"][V, V], state["p"][DELAY, DELAY] = 0.1**2, 0.005**2
    state["free"][[V, DELAY]] = 1
    w = state["window"]
    w["reference"], w["reference_change"], w["reference_samples"] = off, SLOWING, SAMPLES
    w["omega"], w["omega_samples"] = rolled / params[0]["wheel_radius"], SAMPLES
    return state


def test_it_corrects_speed_and_delay_by_their_variances(params, state) -> None:
    """A delay of tau reads -tau dv/dt too much: Kalman's gain of two states and one measurement, by hand."""
    state = window(params, state, 0.05)
    total = 0.1**2 + (0.005 * SLOWING) ** 2 + float(params[0]["sigma_vehicle_speed"]) ** 2 / SAMPLES
    correct_by_reference(params[0], state)
    assert state["x"][V] == pytest.approx(SPEED + 0.1**2 / total * 0.05)
    assert state["x"][DELAY] == pytest.approx(0.005**2 * -SLOWING / total * 0.05)
    assert state["ratio"][REFERENCE_RATIO] == pytest.approx(0.05**2 / total)


@pytest.mark.parametrize(
    ("case", "off", "rolled", "hold_s", "believed"),
    [
        ("wheels roll as the reference says", -8.0, SPEED - 8.0, 0.0, True),
        ("wheels slide: they cannot deny it", -8.0, SPEED, 0.2, True),
        ("wheels deny it", -8.0, SPEED, 0.0, False),
        ("no jump, four standard deviations", -0.4, SPEED, 0.2, False),
    ],
)
def test_a_jump_is_believed_where_no_wheel_denies_it(
    params, state, case, off, rolled, hold_s, believed
) -> None:
    state = window(params, state, off, rolled)
    state["hold_s"] = hold_s
    correct_by_reference(params[0], state)
    if believed:
        assert state["x"][V] == pytest.approx(SPEED + off), case
        assert math.sqrt(state["p"][V, V]) > 0.5
    else:
        assert state["x"][V] > SPEED + 0.9 * off, case
        assert np.sqrt(state["p"][V, V]) < 0.11
