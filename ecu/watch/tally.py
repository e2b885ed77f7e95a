"""Counts of a run for its metrics, from the ring: cycles, lateness, frames by message, the last state.

Frames are checked once more by the daemon's own code (`receive`), so what it rejected is known by reason.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ecu.bus.freshness import begin_cycle
from ecu.bus.receive import Reception, new_reception, receive
from ecu.bus.receive_plan import ReceivePlan
from ecu.bus.signal_map import receive_plan
from ecu.contract.records import INPUTS, STAGE_SHARES_NS, STAGES, RecordArray, new_record
from ecu.contract.signals import CYCLE_NS
from ecu.errors import UserError
from ecu.recording.ring import Batch, RingReader
from ecu.runtime.clock import monotonic_s
from ecu.watch.health import ailment

EDGES_S: Final = (20e-6, 50e-6, 100e-6, 200e-6, 500e-6, 1e-3, 2e-3, 5e-3, 10e-3, 100e-3)
"""Upper edges of the histogram of lateness; the last bin has none."""


class Tally:
    """Counts of one run, from the oldest cycle that the ring holds."""

    def __init__(self, ring: Path, now_s: Callable[[], float] = monotonic_s) -> None:
        """Raises UserError: there is no ring (yet)."""
        self.reader = RingReader(ring)
        self._now_s = now_s
        self.last: RecordArray | None = None
        """RECORDED, shape (1,): the last cycle."""
        self.lateness: NDArray[np.int64] = np.zeros(len(EDGES_S) + 1, np.int64)
        self.lateness_sum_s = 0.0
        self.stages_s = np.zeros(len(STAGES))
        self.stages_slow: NDArray[np.int64] = np.zeros(len(STAGES), np.int64)
        self.late_frames = 0
        self.plan: ReceivePlan | None = None
        self.reception: Reception | None = None
        self._inputs = new_record(INPUTS)
        source = self.reader.description.get("map")
        try:
            self.plan = receive_plan(Path(source) if source else None)
            self.reception = new_reception(self.plan)
        except UserError:  # the map is gone: nothing is known by message
            pass

    def follow(self) -> None:
        """Count the new cycles of the ring."""
        while len((batch := self.reader.read(2400)).records):
            self._add(batch)

    def _add(self, batch: Batch) -> None:
        cycles = batch.records["cycle"]
        late_s = cycles["lateness_ns"] * 1e-9
        self.lateness += np.bincount(np.searchsorted(EDGES_S, late_s), minlength=len(self.lateness))
        self.lateness_sum_s += float(late_s.sum())
        self.stages_s += cycles["stage_ns"].sum(axis=0) * 1e-9
        self.stages_slow += (cycles["stage_ns"] > STAGE_SHARES_NS).sum(axis=0)
        self.late_frames += int(cycles["late_frames"].sum())
        self.last = batch.records[-1:]
        if self.plan is not None and self.reception is not None and len(batch.frames):
            begin_cycle(self._inputs[0], int(batch.frames["stamp_ns"].max()), CYCLE_NS)
            receive(self.plan, self.reception, batch.frames, 0, len(batch.frames), self._inputs[0])

    @property
    def age_s(self) -> float:
        """Return how long ago the last cycle began; infinite before the first."""
        if self.last is None:
            return float("inf")
        return self._now_s() - 1e-9 * float(self.last["cycle"]["t_mono_ns"][0])

    def ailment(self) -> str:
        """Return why the loop is not healthy, empty while its cycles advance."""
        return ailment(self.reader, self.age_s)
