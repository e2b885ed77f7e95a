import os
import pty
import select
import struct
import subprocess
import sys
import termios
import time
from fcntl import ioctl
from pathlib import Path

import pytest

from ecu.recording.recorder import read_recording
from ecu.watch import terminal
from ecu.watch.terminal import Screen, _pressed
from ecu.watch.watcher import PERIOD_S, Watcher

ROOT = Path(__file__).parents[3]
LEFT, RIGHT, UP, DOWN, END = b"\x1b[D", b"\x1b[C", b"\x1b[A", b"\x1b[B", b"\x1b[F"


@pytest.fixture
def screen(loop, tmp_path):
    one = loop()
    one.publish(2000)
    watcher = Watcher(None)
    watcher.turn()
    yield Screen(watcher, tmp_path / "kept")
    assert one


@pytest.mark.parametrize(
    ("keys", "back_s"),
    [
        ([], 0),
        ([LEFT], 1),
        ([UP, LEFT, LEFT, RIGHT], 11),
        ([UP, DOWN], 0),
        ([LEFT, UP, END], 0),
        ([UP] * 9, 19.96),  # no further than the oldest row
        ([RIGHT], 0),
    ],
)
def test_keys_move_in_time(screen, keys, back_s):
    for key in keys:
        screen.press(key)
    assert screen.back_s == pytest.approx(back_s, abs=1e-6)


def test_a_pause_stays_where_it_is(screen):
    screen.press(b" ")
    assert screen.back_s == 0
    screen.watcher.history.rows.append(screen.watcher.history.rows[-1] + 2.0)
    assert screen.back_s == pytest.approx(2)
    screen.press(b" ")
    assert screen.back_s == 0


def test_k_keeps_a_recording(screen, tmp_path):
    screen.press(b"k")
    assert len(read_recording(tmp_path / "kept").cycles) == 2000
    assert screen._note.startswith("20 s kept in ")


@pytest.mark.parametrize("key", [b"q", b" ", b"k", LEFT, RIGHT, UP, DOWN, END, b"\x1bOF"])
def test_a_key_is_read_whole(key):
    reading, writing = os.pipe()
    os.write(writing, key + b"q")
    assert [_pressed(reading, 1.0), _pressed(reading, 1.0)] == [key, b"q"]
    assert _pressed(reading, 0.0) is None
    os.close(writing)
    assert _pressed(reading, 1.0) == b"q"
    os.close(reading)


def test_a_real_terminal_of_40_columns_is_left_as_it_was():
    """Without a daemon; q ends it."""
    ours, theirs = pty.openpty()
    ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 40, 0, 0))
    before = termios.tcgetattr(theirs)
    child = subprocess.Popen(
        [sys.executable, "-m", "ecu.cli", "watch", "no-such-daemon"],
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT), "TERM": "xterm"},
    )
    shown, end = b"", time.monotonic() + 60
    while b"no daemon" not in shown and time.monotonic() < end:
        if select.select([ours], [], [], 0.1)[0]:
            shown += os.read(ours, 65536)
    assert b"no daemon" in shown
    os.write(ours, b"q")
    assert child.wait(30) == 0
    assert termios.tcgetattr(theirs) == before
    os.close(ours)
    os.close(theirs)


@pytest.mark.parametrize("as_json", [False, True])
def test_that_no_cycles_come_is_one_line(rings, monkeypatch, capfd, as_json):
    turns = [*["no daemon runs"] * 90, *[""] * 60, *[f"no cycle for {k} s" for k in range(90)]]
    watcher = Watcher(None)
    now_s = 1000.0

    def turn():
        nonlocal now_s
        now_s += PERIOD_S
        if not turns:
            raise KeyboardInterrupt
        watcher.trouble = turns.pop(0)

    monkeypatch.setattr(watcher, "turn", turn)
    monkeypatch.setattr(terminal.time, "monotonic", lambda: now_s)
    monkeypatch.setattr(terminal.time, "sleep", lambda _: None)
    monkeypatch.setattr(terminal.os, "dup2", lambda *_: None)
    assert terminal.print_lines(watcher, as_json) == 0
    monkeypatch.undo()
    lines = capfd.readouterr().out.splitlines()
    assert [sum(said in line for line in lines) for said in ("no daemon runs", "no cycle for")] == [1, 1]
    assert len(lines) == 2 + 3  # between them a line a second, as ever


def test_it_ends_with_its_reader_also_while_no_cycles_come():
    line = ["sh", "-c", '"$0" -P -m ecu.cli watch nosuch | head -1', sys.executable]
    assert subprocess.run(line, capture_output=True, text=True, timeout=60).stdout.count("\n") == 1
