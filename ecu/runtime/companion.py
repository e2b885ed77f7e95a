"""Processes beside the recorder that nothing depends on: of `--metrics-port`, `--diagnostics` and `--xcp`.

The supervisor starts one again when it ends, ever later while it ends soon; with exit code 0 it is done.
"""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final

from ecu.recording.sink import free_output
from ecu.runtime.start import leave_signals, lower_priority

if TYPE_CHECKING:  # the supervisor imports next to nothing
    import argparse

PAUSE_S: Final = 1.0
LONGEST_PAUSE_S: Final = 60.0
CALM_S: Final = 60.0
LOOK_FOR_RING_S: Final = 0.05


class Companion:
    """`python -m MODULE ARGUMENTS --parent PID [--pause S]`, from now until `end`."""

    def __init__(self, module: str, arguments: Sequence[str], patience_s: float = 0.0) -> None:
        """Start it; `patience_s`: what it may take to end by itself, once the run has ended."""
        self._patience_s = patience_s
        self._command = [sys.executable, "-m", module, *arguments, "--parent", str(os.getpid())]
        self._pause_s = 0.0
        self._start()

    def _start(self) -> None:
        self._began_s = time.monotonic()
        pause = ["--pause", str(self._pause_s)] if self._pause_s else []
        self._process = subprocess.Popen([*self._command, *pause], stdin=subprocess.DEVNULL)

    def look(self, pid: int, status: int) -> None:
        """Start it again if it is the process `pid` that ended with `status` (`os.wait`)."""
        if pid != self._process.pid:
            return
        self._process.returncode = os.waitstatus_to_exitcode(status)
        if self._process.returncode == 0:
            return
        calm = time.monotonic() - self._began_s > CALM_S + self._pause_s
        self._pause_s = PAUSE_S if calm else min(LONGEST_PAUSE_S, max(PAUSE_S, 2 * self._pause_s))
        self._start()

    def end(self) -> None:
        """Wait for its end as long as it may take, then kill it."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(self._patience_s)
        with suppress(OSError):
            self._process.kill()
        self._process.wait()


def begin_companion(module: str, *own: str) -> "tuple[argparse.Namespace, Callable[[], bool]]":
    """In the process of a `Companion`: take its options, leave priority and signals to the loop, and pause.

    `own`: options of the module. Returns all of them, and a check whether the supervisor is there.
    """
    import argparse

    parser = argparse.ArgumentParser(prog=f"python -m {module}")
    for name in own:
        parser.add_argument(name)
    parser.add_argument("--ring", type=Path, required=True)
    parser.add_argument("--parent", type=int, required=True)
    parser.add_argument("--pause", type=float, default=0.0)
    options = parser.parse_args()
    free_output()
    leave_signals()
    lower_priority()
    time.sleep(options.pause)
    return options, lambda: os.getppid() == options.parent


def await_ring(ring: Path, goes_on: Callable[[], bool]) -> bool:
    """Wait until the ring is there, for a starting daemon goes first; return False: `goes_on` says no."""
    while not ring.exists():
        if not goes_on():
            return False
        time.sleep(LOOK_FOR_RING_S)
    return True


def await_end_of(other: "subprocess.Popen[bytes]", companions: Sequence[Companion]) -> int:
    """Wait until `other` ends and return its exit code; meanwhile keep the companions running."""
    while companions:
        pid, status = os.wait()
        if pid == other.pid:
            other.returncode = os.waitstatus_to_exitcode(status)
            return other.returncode
        for companion in companions:
            companion.look(pid, status)
    return other.wait()
