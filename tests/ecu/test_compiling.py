"""Words while kernels are compiled."""

import numba
import pytest

from ecu.compiling import report_compiling
from ecu.output import Level, new_policy


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
def test_compiling_is_said_once_and_named_to_who_asks(capsys: pytest.CaptureFixture[str]) -> None:
    @numba.njit
    def area(radius: float) -> float:
        return 3.0 * radius * radius

    @numba.njit
    def volume(radius: float, length: float) -> float:
        return area(radius) * length

    with new_policy() as policy:
        policy.level = Level.VERBOSE
        with report_compiling():
            assert volume(1.0, 2.0) == 6.0
            assert volume(2.0, 1.0) == 12.0
        assert volume(1, 2) == 6.0  # other types: compiled anew, but outside
    first, *rest = capsys.readouterr().err.splitlines()
    assert first.startswith("compiling kernels that are not in the cache yet")
    assert [line.rpartition(".")[2] for line in rest] == ["volume", "area"]
