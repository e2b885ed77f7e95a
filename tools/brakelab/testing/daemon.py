"""`brake-ecu run` as a child process that a test starts, reads and ends."""

import json
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

PATIENCE_S: Final = 300.0
"""A cold cache compiles every kernel."""


class Daemon:
    """`brake-ecu run` as a child process; its log is read line by line."""

    def __init__(
        self, *arguments: object, stderr: int = subprocess.PIPE, program: str = "", **environment: str
    ) -> None:
        paths = os.pathsep.join(filter(None, sys.path))  # the child takes the modules that the test takes
        command = [sys.executable, *(["-c", program] if program else ["-m", "ecu.cli"]), "run"]
        self.process = subprocess.Popen(
            [*command, *map(str, arguments)],
            stdout=subprocess.DEVNULL,
            stderr=stderr,
            text=True,
            env={**os.environ, "PYTHONPATH": paths, **environment},
            preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL),  # the tests may run under nohup
        )
        self._lines: queue.Queue[str | None] = queue.Queue()
        self.seen: list[dict[str, Any]] = []
        self.other: list[str] = []
        if stderr == subprocess.PIPE:
            threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self.process.stderr is not None
        for line in self.process.stderr:
            self._lines.put(line)
        self._lines.put(None)

    def wait_for(self, event: str, **content: Any) -> dict[str, Any]:
        """Return the first line of `event` with `content`, read already or to come."""
        wanted = {"event": event, **content}
        for line in self.seen:
            if wanted.items() <= line.items():
                return line
        while self._next():
            if self.seen and wanted.items() <= self.seen[-1].items():
                return self.seen[-1]
        raise AssertionError(f"ended without {wanted}: {self.seen} {self.other}")

    def said(self, event: str, **content: Any) -> bool:
        """Whether a line of `event` with `content` was written by now."""
        while not self._lines.empty() and self._next():
            pass
        return any({"event": event, **content}.items() <= line.items() for line in self.seen)

    def family(self) -> list[int]:
        """Process ids of the loop, the supervisor and the recorder, as far as they are there."""
        family = [self.process.pid]
        for pid in family:
            with suppress(OSError):
                family += map(int, Path(f"/proc/{pid}/task/{pid}/children").read_text().split())
        return family

    def _next(self) -> bool:
        line = self._lines.get(timeout=PATIENCE_S)
        if line is None:
            self._lines.put(None)
            return False
        try:
            self.seen.append(json.loads(line))
        except json.JSONDecodeError:
            self.other.append(line.strip())
        return True

    def end(self, number: int | None = signal.SIGTERM) -> int:
        """Send a signal, wait for the end and return the exit code."""
        if number is not None and self.process.poll() is None:
            self.process.send_signal(number)
        while self._next():
            pass
        return self.process.wait(PATIENCE_S)


def patience() -> Iterator[None]:
    """Turns of a loop that waits for a fact: how long that takes is the machine's affair."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        yield
    raise AssertionError(f"not in {PATIENCE_S} s")


def wait_for(fact: Callable[[], bool]) -> None:
    """Look again and again until `fact` holds."""
    for _ in patience():
        if fact():
            return
        time.sleep(0.01)
