"""First-order lags: the nominal period is no special case but to the compiler."""

import math
import struct

import pytest

from ecu.algorithm.lag import PERIOD, lag_gain
from ecu.jit import compiler


@pytest.mark.parametrize("lag", [0.01, 0.1, 0.4, 60.0])
@pytest.mark.parametrize("dt", [PERIOD, 1e-9 * 20_000_000, 0.05, 3.0])
def test_a_lag_covers_its_share_of_a_step(dt: float, lag: float) -> None:
    assert lag_gain(dt, lag) == pytest.approx(1.0 - math.exp(-dt / lag), rel=1e-14)


@pytest.mark.compiled
def test_the_gain_of_a_nominal_cycle_is_computed_by_the_compiler() -> None:
    numba = compiler()
    gain = numba.njit(error_model="numpy")(lambda dt: lag_gain(dt, 0.4))
    gain.compile((numba.float64,))
    code = gain.inspect_llvm((numba.float64,))
    assert struct.pack(">d", math.exp(-PERIOD / 0.4)).hex() in code.lower()
