"""A bus as the cycle sees it: drain what waits, send without blocking, say how the line is."""

from typing import NamedTuple, Protocol

from ecu.contract.records import RecordArray


class BusStatus(NamedTuple):
    """State of the bus."""

    bus_off: bool
    error_passive: bool
    send_failures: int
    """Frames that were not taken, or not acknowledged, so far."""
    dropped: int
    """Received frames that the kernel dropped so far."""


class Channel(Protocol):
    """One open bus."""

    name: str

    def drain(self, frames: RecordArray, start: int) -> int:
        """Write every frame that waits, from `frames[start]` on; return how many, at most what fits."""

    def send(self, frames: RecordArray, count: int) -> int:
        """Hand over the first `count` frames without blocking; return how many were taken."""

    def status(self) -> BusStatus:
        """Return how the line is now."""

    def close(self) -> None:
        """Leave the bus."""
