"""Loop's end of its side process: starts and monitors it without ever waiting for it.

The two ends of a socket: the supervisor (`supervisor.py`) and the recorder (`ecu/recording/recorder.py`) hold
one, the loop the other. The death of either end is an end of file at the other. The side process sends `KEPT`
or `NOT_KEPT` with the number of the last cycle it handled, ten times a second.
"""

import os
import socket
import struct
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from ecu.errors import UserError

READY, KEPT, NOT_KEPT, AWAY, REFUSED = b"r", b"+", b"-", b"x", b"!"
SILENCE_NS: Final = 5_000_000_000
"""Silent for that long, it hangs. The ring holds 24 s."""
START_PATIENCE_S: Final = 20.0
_WORDS_AT_ONCE: Final = 16


def word(kind: bytes, followed: int) -> bytes:
    """Return the message of the side process after the cycle `followed`."""
    return kind + struct.pack("=q", followed)


class Side:
    """The side process as the loop sees it."""

    def __init__(self, ring: Path, arguments: Sequence[str]) -> None:
        self._socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        paths = [str(Path(__file__).parents[2]), *filter(None, [os.environ.get("PYTHONPATH")])]
        command = [
            sys.executable,
            "-m",
            "ecu.runtime.supervisor",
            str(theirs.fileno()),
            "--ring",
            str(ring),
            *arguments,
        ]
        with theirs:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                pass_fds=[theirs.fileno()],
                env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
            )
        self.followed = -1
        """The last cycle that it handled."""
        self._kept, self._heard_ns = False, 0

    def await_ready(self) -> None:
        """Wait until it has opened the ring and its files; one that does not answer counts as lost.

        Raises:
            UserError: an error that it reports for the user to mend.
        """
        self._socket.settimeout(START_PATIENCE_S)
        try:
            answer = self._socket.recv(4096)
        except TimeoutError:
            answer = AWAY
        if answer[:1] == REFUSED:
            raise UserError("", "", answer[1:].decode(errors="replace"))
        self._kept = answer == READY
        self._socket.setblocking(False)

    def look(self, now_ns: int) -> bool:
        """Return whether data of the loop are being stored; `now_ns` on the monotonic clock."""
        self._heard_ns = self._heard_ns or now_ns
        for _ in range(_WORDS_AT_ONCE):
            try:
                heard = self._socket.recv(64)
            except OSError:
                break
            if not heard:
                self._kept = False
                break
            if heard[:1] in (KEPT, NOT_KEPT):
                self._heard_ns = now_ns
                self.followed = struct.unpack("=q", heard[1:9])[0]
            self._kept = heard[:1] == KEPT
        return self._kept and now_ns - self._heard_ns < SILENCE_NS

    def await_end(self, patience_s: float) -> bool:
        """Wait until every side process has ended, at most `patience_s`; return whether they have."""
        self._socket.settimeout(patience_s)
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_WR)
        try:
            while self._socket.recv(4096):
                pass
        except TimeoutError:
            return False
        except OSError:
            pass
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(patience_s)
        return True

    def abandon(self) -> None:
        """Close the socket: the process then ends by itself."""
        self._socket.close()
