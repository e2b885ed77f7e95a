"""Torque of a lining, and what it lacks of its demand, by (A.19)."""

import math

import numpy as np
import pytest

from ecu.algorithm.control.friction_torque import lagging_torque, lining_torque
from ecu.algorithm.control.pressure_law import PRESSURE_LAW_STATE

BAR = 1e5


@pytest.mark.parametrize("corner", [0, 2])
@pytest.mark.parametrize(("override", "mu"), [(math.nan, 0.40), (0.35, 0.35)])
@pytest.mark.parametrize(
    ("there", "wanted"), [(10.0, 25.0), (25.0, 10.0), (0.0, 10.0), (10.0, 0.0), (0.3, 0.4)]
)
def test_the_lag_is_a_torque(params, corner, override, mu, there, wanted) -> None:
    law = np.zeros(1, PRESSURE_LAW_STATE)[0]
    law["used"], law["mu_override"] = 0.40, override
    diameter, radius = ((0.060, 0.1205), (0.060, 0.1205), (0.034, 0.1288), (0.034, 0.1288))[corner]

    def torque(bar: float) -> float:
        """(A.19), one piston a side, 0.5 bar of push-out pressure."""
        return 2 * mu * math.pi * diameter**2 / 4 * max(bar - 0.5, 0.0) * BAR * radius

    assert lining_torque(params[0], wanted * BAR, law, corner) == pytest.approx(torque(wanted))
    found = lagging_torque(params[0], np.full(4, there), law, wanted * BAR, corner)
    assert found == pytest.approx(torque(wanted) - torque(there))
