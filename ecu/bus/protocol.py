"""Bus interface of the cycle: drain received frames, send without blocking, report the line's status."""

from typing import Final, NamedTuple, Protocol

import numpy as np

from ecu.contract.records import RecordArray


class BusStatus(NamedTuple):
    """State of the bus."""

    bus_off: bool
    error_passive: bool
    send_failures: int
    """Frames that were not taken, or not acknowledged, so far."""
    dropped: int
    """Received frames that the kernel dropped so far."""


STATUS: Final = np.dtype([(name, "i8") for name in BusStatus._fields])
"""The same as kernels have it."""


class Channel(Protocol):
    """One open bus."""

    name: str

    def drain(self, frames: RecordArray, start: int) -> int:
        """Write all waiting frames, from `frames[start]` on; return their number, at most the free places."""

    def send(self, frames: RecordArray, count: int) -> int:
        """Hand over the first `count` frames without blocking; return how many were taken."""

    def status(self) -> BusStatus:
        """Return the present status of the line."""

    def close(self) -> None:
        """Leave the bus."""
