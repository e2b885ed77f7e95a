"""Standard output and error that never block and never raise.

A lost or stalled reader or a full disk costs lines of output, never a cycle. Lost lines are counted, and the
next line written is preceded by their number.
"""

import io
import os
import select
import socket
import stat
import sys
from typing import Final

_ATOMIC: Final = select.PIPE_BUF  # a pipe that is ready takes that much at once


class Sink(io.TextIOBase):
    """A text stream over the file descriptor `handle`."""

    def __init__(self, handle: int) -> None:
        self.dropped = 0
        self._handle, self._torn = handle, False
        self._socket: socket.socket | None = None
        self._free = False
        try:
            kind = os.fstat(handle).st_mode
            if stat.S_ISSOCK(kind):
                self._socket = socket.socket(fileno=os.dup(handle))
            else:  # a regular file never blocks, and its offset is shared with who gave it
                self._free = stat.S_ISREG(kind) or _set_free(handle)
        except OSError:  # closed, and soon perhaps another file's: every line is dropped
            self._handle = -1

    def write(self, text: str) -> int:
        """Write as much as possible now; return the length of `text` in any case."""
        data = text.encode(errors="replace")
        if self.dropped:
            data = b'{"event": "lines_dropped", "count": %d}\n' % self.dropped + data
        if self._torn:
            data = b"\n" + data
        try:
            taken = self._put(data)
        except OSError:
            taken = 0
        if taken == len(data):
            self.dropped, self._torn = 0, False
        else:
            self.dropped += 1
            self._torn = self._torn or taken > 0
        return len(text)

    def _put(self, data: bytes) -> int:
        if self._socket is not None:
            return self._socket.send(data, socket.MSG_DONTWAIT | socket.MSG_NOSIGNAL)
        if self._free:
            return os.write(self._handle, data)
        if self._handle < 0 or not select.select([], [self._handle], [], 0)[1]:
            return 0
        return os.write(self._handle, data[:_ATOMIC])

    def writable(self) -> bool:
        """Return True."""
        return True

    def isatty(self) -> bool:
        """Return whether it is a terminal."""
        return self._handle >= 0 and os.isatty(self._handle)

    def fileno(self) -> int:
        """Return the file descriptor."""
        return self._handle


def _set_free(handle: int) -> bool:
    """Make the descriptor non-blocking on the same file; return whether that was possible.

    It is opened anew: O_NONBLOCK on the old description would hold for the shell that gave it, too.
    """
    try:
        own = os.open(f"/proc/self/fd/{handle}", os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY)
    except OSError:
        return False
    os.dup2(own, handle)
    os.close(own)
    return True


def free_output() -> None:
    """Replace standard output and error of this process, and of those it starts, by sinks.

    Where one is closed, /dev/null takes its number, so that no socket or file gets it.
    """
    for handle in range(3):
        try:
            os.fstat(handle)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    sys.stdout, sys.stderr = Sink(1), Sink(2)
