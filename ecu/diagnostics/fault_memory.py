"""Fault memory: status of each trouble code (ISO 14229-1, Annex D.2), debounce, ageing. It reads no file.

A test result is a fault bit of one cycle. Debounce is a counter of cycles: from 0 up by one while the bit
is set (one below 0 begins at 0), down by one while it is not. At `fail_cycles` of its code the test has
failed, at -`PASS_CYCLES` it has passed; between these the status stays.

| bit | set | reset (all: by clearing) |
| --- | --- | --- |
| testFailed | with failed | with passed, and when an operation cycle begins |
| testFailedThisOperationCycle | with failed | when an operation cycle begins |
| pendingDTC | with failed | when a cycle begins after one that passed and never failed |
| confirmedDTC | with failed, the first time (one trip) | by ageing |
| testNotCompletedSinceLastClear | by clearing | with failed or passed |
| testFailedSinceLastClear | with failed | |
| testNotCompletedThisOperationCycle | when an operation cycle begins | with failed or passed |
| warningIndicatorRequested | never: the ECU has no lamp | |

Ageing: after `AGEING_CYCLES` operation cycles in a row that passed and never failed a confirmed code is
forgotten with its snapshots. An operation cycle is a start of the daemon, and ends when the next one
begins: a process that is killed cannot end it.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final

from ecu.diagnostics.trouble_codes import PASS_CYCLES, TROUBLE_CODES, TroubleCode

TEST_FAILED: Final = 1 << 0
FAILED_THIS_CYCLE: Final = 1 << 1
PENDING: Final = 1 << 2
CONFIRMED: Final = 1 << 3
NOT_COMPLETED_SINCE_CLEAR: Final = 1 << 4
FAILED_SINCE_CLEAR: Final = 1 << 5
NOT_COMPLETED_THIS_CYCLE: Final = 1 << 6
AVAILABLE: Final = 0x7F
"""DTCStatusAvailabilityMask: all but the warning indicator."""
CLEARED: Final = NOT_COMPLETED_SINCE_CLEAR | NOT_COMPLETED_THIS_CYCLE
STATUS_NAMES: Final = (
    "testFailed",
    "testFailedThisOperationCycle",
    "pendingDTC",
    "confirmedDTC",
    "testNotCompletedSinceLastClear",
    "testFailedSinceLastClear",
    "testNotCompletedThisOperationCycle",
    "warningIndicatorRequested",
)

AGEING_CYCLES: Final = 40
MOST_OCCURRENCES: Final = 255


@dataclass(slots=True)
class Entry:
    """What is known of one trouble code."""

    status: int = CLEARED
    occurrences: int = 0
    """How often testFailed was set since the last clear, at most `MOST_OCCURRENCES`."""
    ageing: int = 0
    """Operation cycles in a row that passed and never failed, while confirmed."""
    first: bytes = b""
    """Snapshot of the first occurrence, empty: none."""
    last: bytes = b""


class FaultMemory:
    """Entries of all trouble codes, by their numbers."""

    def __init__(self, codes: Iterable[TroubleCode] = TROUBLE_CODES) -> None:
        self.codes = {code.number: code for code in codes}
        self.entries = {number: Entry() for number in self.codes}
        self.changes = 0
        """Counts what is worth keeping: every change of an entry."""
        self.enabled = True
        """False: results are left out (ControlDTCSetting)."""
        self._of_bit = {code.fault.bit: code for code in self.codes.values()}
        self._all = sum(self._of_bit)
        self._counters = dict.fromkeys(self._of_bit, 0)
        self._at_top = self._at_bottom = 0

    def begin_operation_cycle(self) -> None:
        """End an operation cycle and begin the next."""
        for entry in self.entries.values():
            if not entry.status & (FAILED_THIS_CYCLE | NOT_COMPLETED_THIS_CYCLE):
                entry.status &= ~PENDING
                if entry.status & CONFIRMED:
                    entry.ageing += 1
                    if entry.ageing >= AGEING_CYCLES:
                        entry.status &= ~CONFIRMED
                        entry.occurrences, entry.ageing, entry.first, entry.last = 0, 0, b"", b""
            entry.status &= ~(TEST_FAILED | FAILED_THIS_CYCLE)
            entry.status |= NOT_COMPLETED_THIS_CYCLE
        self._counters = dict.fromkeys(self._of_bit, 0)
        self._at_top = self._at_bottom = 0
        self.changes += 1

    def add(self, failed: int, tested: int, snapshot: Callable[[], bytes]) -> None:
        """Add the results of one cycle.

        Args:
            failed: mask of the fault bits that are set.
            tested: mask of those that were tested in this cycle; bits without a code are left out.
            snapshot: returns what is stored with a code that fails now.
        """
        if not self.enabled:
            return
        moving = tested & self._all & ~(failed & self._at_top | ~failed & self._at_bottom)
        while moving:
            bit = moving & -moving
            moving ^= bit
            self._count(self._of_bit[bit], bit & failed != 0, snapshot)

    def _count(self, code: TroubleCode, failed: bool, snapshot: Callable[[], bytes]) -> None:
        bit = code.fault.bit
        counter = max(self._counters[bit], 0) + 1 if failed else self._counters[bit] - 1
        self._counters[bit] = counter
        self._at_top &= ~bit
        self._at_bottom &= ~bit
        if counter >= code.fail_cycles:
            self._counters[bit] = code.fail_cycles
            self._at_top |= bit
            self._fail(self.entries[code.number], snapshot)
        elif counter <= -PASS_CYCLES:
            self._counters[bit] = -PASS_CYCLES
            self._at_bottom |= bit
            self._complete(self.entries[code.number], ~TEST_FAILED, 0)

    def _fail(self, entry: Entry, snapshot: Callable[[], bytes]) -> None:
        if not entry.status & TEST_FAILED:
            entry.occurrences = min(entry.occurrences + 1, MOST_OCCURRENCES)
            entry.last = snapshot()
            entry.first = entry.first or entry.last
            entry.ageing = 0
        self._complete(entry, ~0, TEST_FAILED | FAILED_THIS_CYCLE | PENDING | CONFIRMED | FAILED_SINCE_CLEAR)

    def _complete(self, entry: Entry, kept: int, added: int) -> None:
        status = entry.status & kept & ~(NOT_COMPLETED_SINCE_CLEAR | NOT_COMPLETED_THIS_CYCLE) | added
        if status != entry.status:
            entry.status = status
            self.changes += 1

    def clear(self, number: int | None = None) -> None:
        """Forget one trouble code, None: all; a fault that is still there fails anew after its debounce."""
        for one in self.codes.values() if number is None else [self.codes[number]]:
            self.entries[one.number] = Entry()
            bit = one.fault.bit
            self._counters[bit] = 0
            self._at_top &= ~bit
            self._at_bottom &= ~bit
        self.changes += 1
