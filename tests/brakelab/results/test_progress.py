"""Progress where no terminal is: lines, and none for what is short."""

import pytest

from brakelab.results.progress import Lines, progress_bar


def test_long_work_says_how_far_it_is_every_ten_seconds(capsys: pytest.CaptureFixture[str]) -> None:
    clock = iter([0.0, 4.0, 11.0, 12.0, 25.0])
    lines = Lines("replay", 200.0, lambda: next(clock))
    for _ in range(4):
        lines.advance(40.0)
    assert capsys.readouterr().err == "replay: 40 %, 11 s\nreplay: 80 %, 25 s\n"


def test_short_work_and_work_from_python_say_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    for shown in (True, False):
        with progress_bar("replay", 2.0, shown) as advance:
            advance(1.0)
    assert capsys.readouterr().err == ""
