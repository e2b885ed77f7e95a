"""Progress where no terminal is: lines, and none for what is short."""

import os
import subprocess
import sys
import time

import pytest

from brakelab.results import progress
from brakelab.results.progress import progress_bar, tracked


def _wait_for(capsys: pytest.CaptureFixture[str], line: str) -> None:
    said, end = "", time.monotonic() + 20.0
    while line not in said and time.monotonic() < end:
        said += capsys.readouterr().err
    assert line in said


def test_long_work_says_how_far_it_is(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress, "PERIOD_S", 0.01)
    with progress_bar("replay", 200.0) as advance:
        advance(80.0)
        _wait_for(capsys, "replay: 40 %, ")
        advance(80.0)
        _wait_for(capsys, "replay: 80 %, ")
    with progress_bar("simulate", None):
        _wait_for(capsys, "simulate: ")


def test_short_work_and_work_from_python_say_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    assert list(tracked("abc", "cars", 3)) == ["a", "b", "c"]
    with progress_bar("replay", 2.0, shown=False) as advance:
        advance(1.0)
    assert capsys.readouterr().err == ""


def test_results_go_where_they_were_sent_beside_a_bar_on_the_terminal() -> None:
    terminal, other_end = os.openpty()
    text = "from brakelab.results.progress import progress_bar\nwith progress_bar('x', None): print('result')"
    done = subprocess.run(
        [sys.executable, "-c", text], stdout=subprocess.PIPE, stderr=other_end, check=True, text=True
    )
    os.close(other_end)
    os.close(terminal)
    assert done.stdout == "result\n"
