"""Attach to a running daemon, follow its ring, notice its end, attach to the next one.

The ring is mapped read-only and read at the watcher's own pace; the daemon does not know of it.
"""

import time
from collections.abc import Callable
from typing import Final

from ecu.errors import UserError
from ecu.recording.ring import RingReader
from ecu.watch.daemons import Daemon, choose, is_held, running
from ecu.watch.history import History

PERIOD_S: Final = 0.04
LOOK_S: Final = 0.5
BATCH: Final = 100
"""Cycles that are looked at at once when it catches up: events are throttled by the second."""
STALLED_S: Final = 0.5
"""Without a new cycle for that long, the writer's lock is looked at."""
NONE_RUNS: Final = "no daemon of this user runs; start one with brake-ecu run, it is attached to by itself"


class Watcher:
    """One watched daemon at a time."""

    def __init__(self, wanted: str | None, now_s: Callable[[], float] = time.monotonic) -> None:
        self.history = History()
        self.daemon: Daemon | None = None
        """Attached to, or the last one."""
        self.reader: RingReader | None = None
        self.source: RingReader | None = None
        """Of the cycles in `history`, also after the end of the run."""
        self.trouble = NONE_RUNS
        """State of the connection in words, empty while cycles come."""
        self._wanted, self._now_s = wanted, now_s
        self._looked_s = self._seen_s = -LOOK_S

    def turn(self) -> int:
        """Read new cycles, or look for a daemon; return their number.

        Raises:
            UserError: several daemons run, and none is named.
        """
        if self.reader is None:
            if self._now_s() - self._looked_s < LOOK_S:
                return 0
            self._looked_s = self._now_s()
            self._attach()
            if self.reader is not None and self.daemon is not None:
                count = self._follow(self.reader)  # what the ring holds is older than this
                self.history.tell(f"attached to {self.daemon.label}")
                return count
        return self._follow(self.reader) if self.reader else 0

    def _attach(self) -> None:
        daemons = running()
        if self.daemon is None:
            found = choose(daemons, self._wanted)
        else:  # it ended: the next one for the same car, whatever its process
            last = self.daemon
            found = next((daemon for daemon in reversed(daemons) if daemon.follows(last)), None)
        if found is None:
            if daemons and self.daemon is None:
                others = "; ".join(daemon.label for daemon in daemons)
                self.trouble = f"no daemon answers to {self._wanted}; there run: {others}"
            return
        try:
            reader = RingReader(found.path)
        except UserError:  # it ended just now
            return
        self.daemon, self.reader, self.source = found, reader, reader
        self.history.begin_run()
        self.trouble, self._seen_s = "", self._now_s()

    def _follow(self, reader: RingReader) -> int:
        count = 0
        while len((batch := reader.read(BATCH)).records):
            self.history.take(batch, reader)
            count += len(batch.records)
        if count:
            self.trouble, self._seen_s = "", self._now_s()
        elif reader.closed:
            words = reader.last_words
            self._part(f"stopped by {words.get('by', '?')} after {words.get('cycles', '?')} cycles")
        elif (silent_s := self._now_s() - self._seen_s) > STALLED_S:
            if is_held(reader.ring.path):
                self.trouble = f"no cycle for {silent_s:.0f} s, yet the process lives"
            else:
                self._part("was killed")
        return count

    def _part(self, how: str) -> None:
        assert self.daemon is not None
        line = f"{self.daemon.label}: {how}"
        self.history.tell(line, serious=True)
        self.trouble, self.reader = f"{line}; waiting for the next one", None


def follow(watcher: Watcher, turn: Callable[[], object]) -> int:
    """Take `turn` after turn until Ctrl-C, and print what becomes of the connection; return 0."""
    trouble = watcher.trouble
    try:
        while True:
            turn()
            if watcher.trouble != trouble:
                trouble = watcher.trouble
                print(trouble or f"attached to {watcher.daemon and watcher.daemon.label}", flush=True)
            time.sleep(PERIOD_S)
    except KeyboardInterrupt:
        return 0
