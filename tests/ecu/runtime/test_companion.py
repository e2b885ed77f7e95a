import subprocess
import sys
import time

import pytest

from ecu.runtime import companion
from ecu.runtime.companion import Companion, await_end_of

SLEEPER = """import time, pathlib, sys
pathlib.Path(sys.argv[1]).open("a").write("x")
time.sleep({})
raise SystemExit({})"""


@pytest.fixture
def module(tmp_path, monkeypatch):
    """Write a module for the companion to run, which notes each of its starts and lives that long."""

    def write(seconds, code=1):
        (tmp_path / "lives.py").write_text(SLEEPER.format(seconds, code))
        monkeypatch.chdir(tmp_path)
        return tmp_path / "starts"

    return write


def test_it_does_not_change_how_the_other_ends(module):
    one = Companion("lives", [str(module(60))])
    other = subprocess.Popen([sys.executable, "-c", "raise SystemExit(7)"])
    assert await_end_of(other, [one]) == 7
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
    assert await_end_of(other, [one]) == 0
    one.end()
    pauses = [float(command[-1]) for command in commands[1:6]]
    assert pauses == [1, 2, 4, 8, 16][: len(pauses)]
    assert len(pauses) >= 3


def test_each_of_several_is_started_again_and_one_that_is_done_is_not(module):
    """Done: exit code 0."""
    starts = module(0, code=0)
    starts.touch()
    done = Companion("lives", [str(starts)])
    done._process.wait = lambda *_: 0  # it is `os.wait` that sees its end
    again = Companion("again", [])  # no such module
    await_end_of(subprocess.Popen([sys.executable, "-c", "import time; time.sleep(0.3)"]), [done, again])
    assert starts.read_text() == "x"
    assert done._process.returncode == 0
    assert again._pause_s >= 1.0
    again.end()


def test_one_that_has_something_to_store_is_waited_for(module):
    one = Companion("lives", [str(module(0.2, code=0))], patience_s=20.0)
    one.end()
    assert one._process.returncode == 0


def test_one_that_lived_long_begins_with_the_short_pause(module, monkeypatch):
    starts = module(0.1)
    starts.touch()
    one = Companion("lives", [str(starts)])
    one._pause_s, one._began_s = 32.0, time.monotonic() - 200
    until = "import sys, time\nwhile len(open(sys.argv[1]).read()) < 2: time.sleep(0.01)"
    other = subprocess.Popen([sys.executable, "-c", until, str(starts)])
    await_end_of(other, [one])
    one.end()
    assert one._pause_s < 32
