"""First-order lags: the nominal period is no special case."""

import math

import pytest

from ecu.algorithm.lag import PERIOD, lag_gain


@pytest.mark.parametrize("lag", [0.01, 0.1, 0.4, 60.0])
@pytest.mark.parametrize("dt", [PERIOD, 1e-9 * 20_000_000, 0.05, 3.0])
def test_a_lag_covers_its_share_of_a_step(dt: float, lag: float) -> None:
    assert lag_gain(dt, lag) == pytest.approx(1.0 - math.exp(-dt / lag), rel=1e-14)
