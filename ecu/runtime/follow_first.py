"""A standby does to what it has learned what a workshop does to the first one's; a process of its own.

`python -m ecu.runtime.follow_first --ring RING --parent PID [--pause S]`. It reads the first one's ring, if
that runs on this machine, and asks the standby's own loop, which decides as it does for a tester: both stand
with released brakes. What it refuses is asked for again until it is done. Work before the standby's start is
in what it learned from that ring.
"""

import os
import time
from pathlib import Path
from typing import Final

import structlog

from ecu.recording.calibration import Note, in_force
from ecu.recording.ring import RingReader
from ecu.runtime.asking import Busy, Sleep, worked
from ecu.runtime.companion import await_ring, begin_companion
from ecu.runtime.standby import rings_beside

PERIOD_S: Final = 0.05
"""A loop takes over ten changes a second at most."""
LOOK_FOR_FIRST_S: Final = 5.0


class Follower:
    """Follows the daemon that speaks while that of the ring `own` is silent."""

    def __init__(self, own: RingReader, sleep: Sleep = time.sleep) -> None:
        self.own, self._sleep = own, sleep
        self._start_ns = int(own.description["start_ns"])
        self._first: RingReader | None = None
        self._done: dict[tuple[Path, int], int] = {}
        """Number of the last change that is done here, by path and start of the first one's ring."""
        self._waits = 0
        self._log = structlog.get_logger("standby")

    def look(self) -> float:
        """Do what a workshop did to the first one since the last look; return when to look again [s].

        A first one that is killed makes this one speak.
        """
        if _speaks(self.own):
            self._first = None
        elif self._first is None or self._first.closed:
            self._first = self._found()
        if self._first is None:
            return LOOK_FOR_FIRST_S
        note = in_force(self._first.ring)
        number = 0 if note is None else note.number
        key = self._first.ring.path, int(self._first.description["start_ns"])
        if key not in self._done:
            self._done[key] = number if note is None or self._is_done(note) else number - 1
        if note is not None and number != self._done[key] and self._does(note, self._done[key]):
            self._done[key] = number
        return PERIOD_S

    def _found(self) -> RingReader | None:
        own = self.own.ring.path
        others = (one for one in rings_beside(self.own.description) if one.ring.path != own)
        return next((one for one in others if _speaks(one)), None)

    def _is_done(self, note: Note) -> bool:
        """Return whether it was done before this standby's start: the ring holds the last 24 s."""
        assert self._first is not None
        slot = self._first.ring.slots[note.cycle % len(self._first.ring.slots)]
        return bool(slot["number"] != note.cycle or slot["recorded"]["cycle"]["t_ns"] < self._start_ns)

    def _does(self, note: Note, done: int) -> bool:
        """Do the work of a change; return whether nothing of it is left to do."""
        if note.number > done + 1 and self._waits != note.number:
            remedy = "start the standby anew: it may have missed work on what the first one learned"
            self._log.warning("work_missed", changes=note.number - done - 1, remedy=remedy)
        if note.work is None:
            return True
        try:
            if worked(self.own, note.work, self._sleep) is not None:
                return True
        except Busy:
            return False
        if self._waits != note.number:
            self._waits = note.number
            self._log.warning("work_waits", number=note.number, remedy="it is done when the car stands again")
        return False


def _speaks(reader: RingReader) -> bool:
    last = reader.newest()
    return last is not None and bool(last["cycle"]["speaks"][0])


def main() -> int:
    """Follow until the run has ended or the parent has gone."""
    options, goes_on = begin_companion("ecu.runtime.follow_first")
    if not await_ring(options.ring, goes_on):
        return 0
    from ecu.recording.log import configure_logging

    configure_logging()
    follower = Follower(RingReader(options.ring, asks=True))
    while goes_on() and not follower.own.closed:
        time.sleep(follower.look())
    return 0


if __name__ == "__main__":
    code = main()
    os._exit(code)  # the end of the run waits for this process, not for the modules it takes down
