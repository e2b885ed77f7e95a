import subprocess
import sys
import time

import pytest

from ecu.runtime import companion
from ecu.runtime.companion import Companion

SLEEPER = "import time, pathlib, sys; pathlib.Path(sys.argv[1]).open('a').write('x'); time.sleep({})"


@pytest.fixture
def module(tmp_path, monkeypatch):
    """Write a module for the companion to run, which notes each of its starts and lives that long."""

    def write(seconds):
        (tmp_path / "lives.py").write_text(SLEEPER.format(seconds))
        monkeypatch.chdir(tmp_path)
        return tmp_path / "starts"

    return write


def test_it_does_not_change_how_the_other_ends(module):
    one = Companion("lives", [str(module(60))])
    other = subprocess.Popen([sys.executable, "-c", "raise SystemExit(7)"])
    assert one.await_end_of(other) == 7
    assert other.poll() == 7
    one.end()
    assert one._process.poll() == -9


def test_it_is_started_again_with_pauses_that_grow(module, monkeypatch):
    starts, commands = module(0), []
    popen = subprocess.Popen
    monkeypatch.setattr(
        companion.subprocess,
        "Popen",
        lambda command, **more: (commands.append(command), popen(command, **more))[1],
    )
    one = Companion("lives", [str(starts)])
    until = "import sys, time\nwhile len(open(sys.argv[1]).read()) < 4: time.sleep(0.01)"
    starts.touch()
    other = popen([sys.executable, "-c", until, str(starts)])
    assert one.await_end_of(other) == 0
    one.end()
    pauses = [float(command[-1]) for command in commands[1:6]]
    assert pauses == [1, 2, 4, 8, 16][: len(pauses)]
    assert len(pauses) >= 3


def test_one_that_lived_long_begins_with_the_short_pause(module, monkeypatch):
    starts = module(0.1)
    starts.touch()
    one = Companion("lives", [str(starts)])
    one._pause_s, one._began_s = 32.0, time.monotonic() - 200
    until = "import sys, time\nwhile len(open(sys.argv[1]).read()) < 2: time.sleep(0.01)"
    other = subprocess.Popen([sys.executable, "-c", until, str(starts)])
    one.await_end_of(other)
    one.end()
    assert one._pause_s < 32
