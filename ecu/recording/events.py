"""Events from the cycles' records: one line per change of mode, fault or counter."""

import re
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import structlog

from ecu.contract.faults import E2E_REJECTIONS, FAULTS, fault_mask
from ecu.contract.records import STAGE_SHARES_NS, STAGES, RecordArray, e2e_counts
from ecu.contract.signals import STARTING
from ecu.recording.log import Throttle

INPUT_FAULTS: Final = 0xFFFF
"""Of what is received: while starting nothing was yet, which is no event."""
MODES: Final = ("starting", "ready", "active", "degraded", "failed")


def in_names_of(messages: Mapping[str, Sequence[str]], remedy: str) -> str:
    """Return a remedy with the bus's own names in place of the contract's: `check CalliperPressure*`."""

    def named(word: re.Match[str]) -> str:
        return ", ".join(messages.get(word[1], [word[0]]))

    return re.sub(r"\b(\w+)(, \1\b)+", r"\1", re.sub(r"\b(\w+)\b\*?", named, remedy))


class EventLog:
    """Event log of one run, written batch by batch to `log`, with structlog's methods (None: structlog).

    `messages`: those of the bus by those of the contract, where a map names others.
    """

    def __init__(
        self,
        throttle: Throttle | None = None,
        log: Any = None,
        messages: Mapping[str, Sequence[str]] | None = None,
    ) -> None:
        self._messages = messages or {}
        self._log = log or structlog.get_logger("ecu")
        self._throttle = throttle or Throttle()
        self._mode, self._faults, self._overruns, self._dropped, self._lost = 0, 0, 0, 0, 0
        self._speaks: bool | None = None
        self._clock_set_ns = 0

    def begin_after(self, record: RecordArray, lost: int = 0) -> None:
        """Continue after an earlier log that ended with `record` (`RECORDED`, shape (1,)); `lost`: cycles and
        frames that the reader had missed by then."""
        cycle, outputs = record["cycle"][0], record["outputs"][0]
        self._mode, self._faults = int(np.nan_to_num(outputs["mode"])), int(fault_mask(outputs))
        self._overruns, self._dropped = int(cycle["overruns"]), int(cycle["dropped"])
        self._speaks = bool(cycle["speaks"])
        self._clock_set_ns = int(cycle["clock_set_ns"])
        self._lost = lost

    def look(self, records: RecordArray, lost_cycles: int, lost_frames: int) -> None:
        """Log the changes within `records` (`RECORDED`, shape (n,)); `lost_*`: missed by the reader."""
        cycles, outputs = records["cycle"], records["outputs"]
        mode = np.nan_to_num(outputs["mode"]).astype(np.int64)
        faults = fault_mask(outputs)
        faults[mode == STARTING] &= ~INPUT_FAULTS
        changed = (mode != np.r_[self._mode, mode[:-1]]) | (faults != np.r_[self._faults, faults[:-1]])
        for row in np.flatnonzero(changed):
            self._look_at(cycles[row : row + 1], int(mode[row]), int(faults[row]))
        speaks = cycles["speaks"] != 0
        if self._speaks is None:
            self._speaks = bool(speaks[0])
        for row in np.flatnonzero(speaks != np.r_[self._speaks, speaks[:-1]]):
            self._say("takes_over" if speaks[row] else "falls_silent", cycle=int(cycles["number"][row]))
        self._speaks = bool(speaks[-1])
        last = cycles[-1]
        overruns, dropped = int(last["overruns"]), int(last["dropped"])
        if (set_ns := int(last["clock_set_ns"])) != self._clock_set_ns:
            self._say("clock_set", by_s=(set_ns - self._clock_set_ns) / 1e9, since_start_s=set_ns / 1e9)
            self._clock_set_ns = set_ns
        self._look_at_stages(cycles)
        if overruns > self._overruns:
            self._say("missed", missed=overruns - self._overruns, total=overruns)
            self._overruns = overruns
        if dropped > self._dropped:
            self._say("frames_dropped", dropped=dropped - self._dropped, total=dropped)
            self._dropped = dropped
        if lost_cycles + lost_frames > self._lost:
            self._say("ring_overtaken", lost_cycles=lost_cycles, lost_frames=lost_frames)
            self._lost = lost_cycles + lost_frames

    def _look_at_stages(self, cycles: RecordArray) -> None:
        """Name each stage that took more than its share, with the worst cycle."""
        taken = cycles["stage_ns"]
        beyond = taken > STAGE_SHARES_NS
        for place in np.flatnonzero(beyond.any(axis=0)):
            worst = int(taken[:, place].argmax())
            self._say(
                "slow",
                STAGES[place],
                cycle=int(cycles["number"][worst]),
                stage=STAGES[place],
                took_ms=taken[worst, place] / 1e6,
                share_ms=STAGE_SHARES_NS[place] / 1e6,
                cycles=int(beyond[:, place].sum()),
            )

    def _look_at(self, record: RecordArray, mode: int, faults: int) -> None:
        cycle, frames = int(record["number"][0]), e2e_counts(record)
        if mode != self._mode:
            self._say("mode", MODES[mode], cycle=cycle, was=MODES[self._mode], now=MODES[mode])
        for fault in FAULTS:
            if fault.bit & faults & ~self._faults:
                counted = {"frames": frames} if fault.bit == E2E_REJECTIONS else {}
                remedy = in_names_of(self._messages, fault.remedy)
                self._say("fault", fault.name, cycle=cycle, fault=fault.name, remedy=remedy, **counted)
        for fault in FAULTS:
            if fault.bit & self._faults & ~faults:
                counted = {"frames": frames} if fault.bit == E2E_REJECTIONS else {}
                self._say("fault_gone", fault.name, cycle=cycle, fault=fault.name, **counted)
        self._mode, self._faults = mode, faults

    def _say(self, event: str, cause: str = "", **content: Any) -> None:
        held = self._throttle.passes(f"{event} {cause}")
        if held is None:
            return
        if held:
            content["held_back"] = held
        serious = event in (
            "missed",
            "slow",
            "frames_dropped",
            "ring_overtaken",
            "fault",
            "takes_over",
            "falls_silent",
        )
        (self._log.warning if serious else self._log.info)(event, **content)
