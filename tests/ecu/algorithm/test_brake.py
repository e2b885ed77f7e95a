"""A disc brake by hand: torque of a pressure (A.19); a pressure by model and sensor as Kalman's scalar."""

import math

import numpy as np
import pytest

from ecu.algorithm.brake import TOLERANCE, brake_gain, brake_gain_per_bar, correct_pressure

PRESSURE = np.dtype([(name, "f8", (4,)) for name in ("value", "variance", "disagreement", "agreed_s")])
SIGMA, DT = 1.8, 0.01  # bar (Table 4.1), s


@pytest.mark.parametrize("corner", range(4))
def test_two_pads_press_with_the_pistons_area_at_the_effective_radius(params, corner: int) -> None:
    car = params[0]
    force = 30e5 * car["piston_area"][corner]
    torque = 2 * 0.45 * force * car["effective_radius"][corner]
    assert brake_gain(car, corner) * 0.45 * 30e5 == pytest.approx(torque)
    assert brake_gain_per_bar(car, corner) * 0.45 * 30.0 == pytest.approx(torque)


def test_a_sample_counts_by_the_variances() -> None:
    state = np.zeros(1, PRESSURE)[0]
    state["value"], state["variance"] = 20.0, 0.9**2
    correct_pressure(state, 1, 21.0, SIGMA, DT)
    weight = 0.9**2 / (0.9**2 + SIGMA**2)
    assert state["value"].tolist() == pytest.approx([20.0, 20.0 + weight, 20.0, 20.0])
    assert 1 / state["variance"][1] == pytest.approx(1 / 0.9**2 + 1 / SIGMA**2)
    assert state["agreed_s"].tolist() == [0.0, DT, 0.0, 0.0]


def test_where_both_disagree_for_long_the_sample_counts_alone() -> None:
    """A model that insists on 20 bar beside samples four deviations higher; low-passed over 0.4 s."""
    state, gain = np.zeros(1, PRESSURE)[0], 1.0 - math.exp(-DT / 0.4)
    limit = TOLERANCE * (SIGMA * math.sqrt(0.5 * gain) + 0.1)
    patience = math.ceil(math.log(1.0 - limit / (4.0 * SIGMA)) / math.log(1.0 - gain))
    for cycle in range(1, patience + 1):
        state["value"][0], state["variance"][0] = 20.0, 0.1**2
        correct_pressure(state, 0, 20.0 + 4.0 * SIGMA, SIGMA, DT)
        assert state["agreed_s"][0] == pytest.approx(cycle * DT if cycle < patience else 0.0)
    assert state["value"][0] == 20.0 + 4.0 * SIGMA
    assert state["variance"][0] == SIGMA**2
