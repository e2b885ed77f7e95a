"""A process beside the recorder that nothing depends on, such as that of `--metrics-port`.

The supervisor starts it again when it ends, ever later while it ends soon.
"""

import os
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Final

PAUSE_S: Final = 1.0
LONGEST_PAUSE_S: Final = 60.0
CALM_S: Final = 60.0


class Companion:
    """`python -m MODULE ARGUMENTS --parent PID [--pause S]`, from now until `end`."""

    def __init__(self, module: str, arguments: Sequence[str]) -> None:
        self._command = [sys.executable, "-m", module, *arguments, "--parent", str(os.getpid())]
        self._pause_s = 0.0
        self._start()

    def _start(self) -> None:
        self._began_s = time.monotonic()
        pause = ["--pause", str(self._pause_s)] if self._pause_s else []
        self._process = subprocess.Popen([*self._command, *pause], stdin=subprocess.DEVNULL)

    def await_end_of(self, other: "subprocess.Popen[bytes]") -> int:
        """Wait until `other` ends and return its exit code, as `other.wait()` does."""
        while True:
            pid, status = os.wait()
            if pid == other.pid:
                other.returncode = os.waitstatus_to_exitcode(status)
                return other.returncode
            if pid == self._process.pid:
                self._process.returncode = os.waitstatus_to_exitcode(status)
                calm = time.monotonic() - self._began_s > CALM_S + self._pause_s
                self._pause_s = PAUSE_S if calm else min(LONGEST_PAUSE_S, max(PAUSE_S, 2 * self._pause_s))
                self._start()

    def end(self) -> None:
        """Kill it: it has nothing to write."""
        with suppress(OSError):
            self._process.kill()
        self._process.wait()
