"""Watchers beside the daemon for `bench lateness`: on for some seconds, stopped for as many, and so on.

Both kinds of cycles come from one run on one machine in one state, with the same other load.
"""

import math
import os
import signal
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from threading import Thread
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.errors import RunFault

BLOCK_S: Final = 5.0
AFTER_CHANGE_S: Final = 0.5
"""Of a block, not counted: watchers that go on catch up first."""
VIEWERS: Final = 2
PORTS: Final = (48760, 48761)
"""Of page and metrics."""


class Block(NamedTuple):
    """A stretch of the monotonic clock [ns]."""

    begin_ns: int
    end_ns: int
    watched: bool


class Watchers:
    """`watch --json`, `watch --web` with viewers, and a scraper of the metrics, of the daemon `pid`.

    Raises:
        RunFault: the page did not open.
    """

    def __init__(self, pid: int) -> None:
        watch = [sys.executable, "-m", "ecu.cli", "watch", str(pid)]
        page = f"http://127.0.0.1:{PORTS[0]}"
        self._processes: list[subprocess.Popen[Any]] = [
            subprocess.Popen([*watch, "--json"], stdout=subprocess.DEVNULL),
            subprocess.Popen([*watch, "--web", "--port", str(PORTS[0])], stdout=subprocess.PIPE, text=True),
        ]
        self._messages = 0
        web = self._processes[1]
        if not (web.stdout and web.stdout.readline().startswith("http")):
            self.end()
            raise RunFault(f"{page}: the page did not open; is the port taken?")
        for _ in range(VIEWERS):
            Thread(target=self._view, args=(f"{page}/stream",), daemon=True).start()
        self._scraping = True
        Thread(target=self._scrape, daemon=True).start()

    def _scrape(self) -> None:
        while True:
            time.sleep(1.0)
            if self._scraping:
                with suppress(OSError), urllib.request.urlopen(metrics_address(), timeout=5) as answer:
                    answer.read()

    def run(self, on: bool) -> None:
        """Let them go on, or stop them where they are."""
        self._scraping = on
        for pid in [*(process.pid for process in self._processes), *_metrics_processes()]:
            os.kill(pid, signal.SIGCONT if on else signal.SIGSTOP)

    def _view(self, address: str) -> None:
        while True:
            with suppress(OSError), urllib.request.urlopen(address, timeout=60) as stream:
                while line := stream.readline():
                    self._messages += line.startswith(b"data")
            time.sleep(0.5)

    def messages_a_second(self, blocks: list[Block]) -> float:
        """Return the messages that each viewer got for a second of being watched; NaN without a block."""
        watched_s = sum(block.end_ns - block.begin_ns for block in blocks if block.watched) * 1e-9
        watched_s += AFTER_CHANGE_S * sum(block.watched for block in blocks)
        return self._messages / VIEWERS / watched_s if watched_s else math.nan

    def end(self) -> None:
        """End them, and let the metrics go on."""
        for pid in _metrics_processes():
            os.kill(pid, signal.SIGCONT)
        for process in self._processes:
            process.kill()
            process.wait()


def metrics_address() -> str:
    """Return where the daemon serves its metrics."""
    return f"http://127.0.0.1:{PORTS[1]}/metrics"


def _metrics_processes() -> list[int]:
    """Return the processes that serve metrics at our port."""
    place = f"127.0.0.1:{PORTS[1]}".encode()
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):
            words = path.read_bytes().split(b"\0")
            if b"ecu.watch.metrics_process" in words and place in words:
                found.append(int(path.parent.name))
    return found


def alternate(watchers: Watchers, seconds: float, goes_on: Callable[[], bool]) -> list[Block]:
    """Stop the watchers for a block, let them go on for one, and so on for `seconds`; return the blocks."""
    blocks: list[Block] = []
    end = time.monotonic() + seconds
    watched = False
    while time.monotonic() < end and goes_on():
        watchers.run(watched)
        begin_ns = time.monotonic_ns()
        time.sleep(max(0.0, min(BLOCK_S, end - time.monotonic())))
        blocks.append(Block(begin_ns + round(1e9 * AFTER_CHANGE_S), time.monotonic_ns(), watched))
        watched = not watched
    return blocks


def inside(blocks: list[Block], t_ns: NDArray[np.int64], watched: bool) -> NDArray[np.bool_]:
    """Return which instants lie in blocks of one kind."""
    found = np.zeros(len(t_ns), np.bool_)
    for block in blocks:
        if block.watched == watched:
            found |= (t_ns >= block.begin_ns) & (t_ns < block.end_ns)
    return found
