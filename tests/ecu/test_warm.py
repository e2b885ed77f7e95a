"""What is said while the kernels of an installation are compiled."""

from collections.abc import Callable

import pytest

from ecu import warm


def test_an_installation_says_how_far_it_is(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def compile_all(begins: Callable[[int], None]) -> int:
        for count in range(120):
            begins(count)
        return 120

    monkeypatch.setattr(warm, "warm", compile_all)
    monkeypatch.setattr("sys.argv", ["warm"])
    assert warm.main() == 0
    said = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in said] == ["0", "50", "100", "120"]
