"""Interactive terminal of `watch`: draws the picture, reads keys. Without a terminal: lines."""

import os
import select
import sys
import termios
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from rich.console import Console
from rich.live import Live

from ecu.streams import are_unread
from ecu.watch.history import COLUMN
from ecu.watch.keep import keep_now
from ecu.watch.line import json_line, text_line
from ecu.watch.picture import picture
from ecu.watch.watcher import PERIOD_S, Watcher

DRAWN_S: Final = 0.2
NOTE_S: Final = 8.0
STEPS_S: Final = {b"\x1b[D": 1.0, b"\x1b[C": -1.0, b"\x1b[A": 10.0, b"\x1b[B": -10.0}
"""Arrow keys: how much further back they go."""
WITHOUT_DIGITS: Final = str.maketrans("", "", "0123456789")
END: Final = (b"\x1b[F", b"\x1bOF", b"\x1b[4~", b"e")


class Screen:
    """Place in the history that the user looks at, held or moving along."""

    def __init__(self, watcher: Watcher, folder: Path) -> None:
        self.watcher, self.folder = watcher, folder
        self.over = False
        self._held_t: float | None = None
        self._note, self._noted_s = "", 0.0

    @property
    def _last_t(self) -> float:
        rows = self.watcher.history.rows
        return float(rows[-1][COLUMN["t"]]) if rows else 0.0

    @property
    def back_s(self) -> float:
        """Return how far before the last row the picture is."""
        if self._held_t is None:
            return 0.0
        rows = self.watcher.history.rows
        oldest = float(rows[0][COLUMN["t"]]) if rows else 0.0
        return max(0.0, self._last_t - max(self._held_t, oldest))

    def press(self, key: bytes) -> None:
        """Act on a key."""
        if key in (b"q", b"Q", b"\x03"):
            self.over = True
        elif key == b" ":
            self._held_t = self._last_t if self._held_t is None else None
        elif key in END:
            self._held_t = None
        elif key in STEPS_S:
            back = self.back_s + STEPS_S[key]
            self._held_t = self._last_t - back if back > 0.0 else None
        elif key == b"k":
            self._say(keep_now(self.watcher, self.folder))

    def _say(self, note: str) -> None:
        self._note, self._noted_s = note, time.monotonic()

    def draw(self, console: Console) -> object:
        """Return the picture for the console as wide and high as it is now."""
        if self._note and time.monotonic() - self._noted_s > NOTE_S:
            self._note = ""
        width, height = console.size
        return picture(self.watcher, width, height, self.back_s, self._note, self._held_t is not None)


@contextmanager
def _keys() -> Iterator[int]:
    """Deliver keys one by one, without echo."""
    handle = sys.stdin.fileno()
    before = termios.tcgetattr(handle)
    tty.setcbreak(handle)
    try:
        yield handle
    finally:
        termios.tcsetattr(handle, termios.TCSADRAIN, before)


def _pressed(handle: int, patience_s: float) -> bytes | None:
    """Return the next key (an arrow is one), None for none; end of input counts as q."""
    if not select.select([handle], [], [], patience_s)[0]:
        return None
    key = os.read(handle, 1)
    while key.startswith(b"\x1b") and len(key) < 4 and select.select([handle], [], [], 0.01)[0]:
        key += os.read(handle, 1)
        if key[-1:].isalpha() and key[-1:] not in b"O" and len(key) > 2:
            break
    return key or b"q"


def show(watcher: Watcher, folder: Path) -> int:
    """Show the watched daemon until q or Ctrl-C; return the exit code 0."""
    console = Console()
    screen = Screen(watcher, folder)
    watcher.turn()
    drawn_s = 0.0
    with _keys() as handle, Live(console=console, screen=True, auto_refresh=False) as live:
        try:
            while not screen.over:
                watcher.turn()
                key = _pressed(handle, PERIOD_S)
                if key is not None:
                    screen.press(key)
                if key is not None or time.monotonic() - drawn_s > DRAWN_S:
                    drawn_s = time.monotonic()
                    live.update(screen.draw(console), refresh=True)  # type: ignore[arg-type]
        except KeyboardInterrupt:
            pass
    return 0


def print_lines(watcher: Watcher, as_json: bool) -> int:
    """Print a line a second until Ctrl-C or until nobody reads it; return the exit code 0.

    That no cycles come is one line, whatever its figures count meanwhile.
    """
    printed_s, said = 0.0, ""
    try:
        while True:
            watcher.turn()
            trouble = watcher.trouble.translate(WITHOUT_DIGITS)
            if time.monotonic() - printed_s >= 1.0 and not (trouble and trouble == said):
                printed_s, said = time.monotonic(), trouble
                print(json_line(watcher) if as_json else text_line(watcher), flush=True)
            if trouble and are_unread():
                break
            time.sleep(PERIOD_S)
    except (KeyboardInterrupt, BrokenPipeError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 0
