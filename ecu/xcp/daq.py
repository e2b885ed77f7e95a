"""Dynamic DAQ lists (ASAM MCD-1 XCP 1.5): how a master allocates and fills them, and the packets of a cycle.

A list has object descriptor tables (ODT), each a packet of a cycle; an ODT has entries, each a piece of
memory. ODTs are numbered through all lists (absolute ODT number): the first byte of a packet is its number,
then follow the time stamp, in the first packet of a list and where it is wanted, and the entries.

    FREE_DAQ → ALLOC_DAQ → ALLOC_ODT of each list → ALLOC_ODT_ENTRY of each ODT → WRITE_DAQ → start
"""

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ecu.xcp.memory import Image, place_of
from ecu.xcp.protocol import Error, Refused

MOST_ODTS: Final = 0xFC
"""Packet identifiers from 0xFC on are those of responses, events and services."""
MOST_ENTRIES: Final = 4096
"""Of all ODTs: more than there are variables on the bus, 32 kB of a master's wishes."""
STAMP: Final = struct.Struct("<L")
TICK_NS: Final = 1000
"""Of time stamps: a microsecond; they begin anew after 71 minutes."""
EVENT_CYCLE: Final = 0
"""The only event channel: a cycle of the loop."""

TIMESTAMP: Final = 0x10
_FREE, _LISTS, _ODTS, _ENTRIES = range(4)


@dataclass(slots=True)
class Entry:
    """A piece of memory in an ODT."""

    place: int = 0
    """In an image."""
    length: int = 0
    """0: not written."""


@dataclass(slots=True)
class DaqList:
    """One list."""

    odts: list[list[Entry]] = field(default_factory=list)
    mode: int = 0
    prescaler: int = 1
    selected: bool = False
    running: bool = False
    first_pid: int = 0
    gathered: list[NDArray[np.intp]] = field(default_factory=list)
    """Of a running list: for each ODT the places of its bytes in an image."""


class DaqLists:
    """All lists of a master. Every command raises Refused where it may not or cannot be done."""

    def __init__(self, max_dto: int, max_entry: int) -> None:
        self.lists: list[DaqList] = []
        self._max_dto, self._max_entry = max_dto, max_entry
        self._stage = _FREE
        self._pointer: tuple[int, int, int] | None = None

    @property
    def running(self) -> bool:
        """True while a list runs."""
        return any(one.running for one in self.lists)

    def free(self) -> None:
        """FREE_DAQ: stop and forget all lists."""
        self.lists, self._stage, self._pointer = [], _LISTS, None

    def allocate(self, count: int) -> None:
        """ALLOC_DAQ."""
        self._begin(_LISTS)
        if count > MOST_ODTS:
            raise Refused(Error.MEMORY_OVERFLOW)
        self.lists, self._stage = [DaqList() for _ in range(count)], _ODTS

    def allocate_odts(self, number: int, count: int) -> None:
        """ALLOC_ODT."""
        self._begin(_ODTS)
        one = self._list(number)
        if sum(len(each.odts) for each in self.lists) - len(one.odts) + count > MOST_ODTS:
            raise Refused(Error.MEMORY_OVERFLOW)
        one.odts = [[] for _ in range(count)]

    def allocate_entries(self, number: int, odt: int, count: int) -> None:
        """ALLOC_ODT_ENTRY."""
        if self._stage == _ODTS and any(one.odts for one in self.lists):
            self._stage = _ENTRIES
        self._begin(_ENTRIES)
        one = self._odt(number, odt)
        if sum(len(each) for daq in self.lists for each in daq.odts) - len(one) + count > MOST_ENTRIES:
            raise Refused(Error.MEMORY_OVERFLOW)
        one[:] = [Entry() for _ in range(count)]

    def _begin(self, stage: int) -> None:
        if self.running:
            raise Refused(Error.DAQ_ACTIVE)
        if self._stage != stage:
            raise Refused(Error.SEQUENCE)

    def _list(self, number: int) -> DaqList:
        if number >= len(self.lists):
            raise Refused(Error.OUT_OF_RANGE)
        return self.lists[number]

    def _odt(self, number: int, odt: int) -> list[Entry]:
        one = self._list(number)
        if odt >= len(one.odts):
            raise Refused(Error.OUT_OF_RANGE)
        return one.odts[odt]

    def point(self, number: int, odt: int, entry: int) -> None:
        """SET_DAQ_PTR: where `write` goes on."""
        if entry >= len(self._odt(number, odt)):
            raise Refused(Error.OUT_OF_RANGE)
        if self.lists[number].running:
            raise Refused(Error.DAQ_ACTIVE)
        self._pointer = (number, odt, entry)

    def write(self, bit: int, length: int, extension: int, address: int) -> None:
        """WRITE_DAQ: what the entry at the pointer has; the pointer goes on to the next one."""
        if self._pointer is None:
            raise Refused(Error.SEQUENCE)
        number, odt, entry = self._pointer
        entries = self._odt(number, odt)
        if self.lists[number].running:
            raise Refused(Error.DAQ_ACTIVE)
        if entry >= len(entries) or bit != 0xFF or not 0 < length <= self._max_entry:
            raise Refused(Error.OUT_OF_RANGE)
        place = None if extension else place_of(address, length)
        if place is None:
            raise Refused(Error.ACCESS_DENIED)
        entries[entry] = Entry(place, length)
        self._pointer = (number, odt, entry + 1)

    def clear(self, number: int) -> None:
        """CLEAR_DAQ_LIST: stop a list and empty its entries."""
        one = self._list(number)
        one.running = one.selected = False
        one.odts = [[Entry() for _ in odt] for odt in one.odts]

    def set_mode(self, number: int, mode: int, event: int, prescaler: int) -> None:
        """SET_DAQ_LIST_MODE."""
        one = self._list(number)
        if one.running:
            raise Refused(Error.DAQ_ACTIVE)
        if mode & ~TIMESTAMP:
            raise Refused(Error.MODE_NOT_VALID)
        if event != EVENT_CYCLE or prescaler == 0:
            raise Refused(Error.OUT_OF_RANGE)
        one.mode, one.prescaler = mode, prescaler

    def start_stop(self, mode: int, number: int) -> int:
        """START_STOP_DAQ_LIST (0 stop, 1 start, 2 select); return the number of its first packet."""
        one = self._list(number)
        if mode == 0:
            one.running = one.selected = False
        elif mode == 1:
            self._start([one])
        elif mode == 2:
            one.selected = True
        else:
            raise Refused(Error.MODE_NOT_VALID)
        return self._first_pid(one)

    def start_stop_selected(self, mode: int) -> None:
        """START_STOP_SYNCH (0 stop all, 1 start selected, 2 stop selected, 3 prepare selected)."""
        chosen = [one for one in self.lists if one.selected or mode == 0]
        if mode in (0, 2):
            for one in chosen:
                one.running = False
        elif mode == 1:
            self._start(chosen)
        elif mode == 3:
            for one in chosen:
                self._gathered(one)
            return
        else:
            raise Refused(Error.MODE_NOT_VALID)
        for one in chosen:
            one.selected = False

    def _start(self, chosen: Sequence[DaqList]) -> None:
        """Start lists together; none, where one of them is not complete."""
        gathered = [self._gathered(one) for one in chosen]
        for one, places in zip(chosen, gathered, strict=True):
            one.gathered, one.first_pid, one.running = places, self._first_pid(one), True

    def _first_pid(self, one: DaqList) -> int:
        before = self.lists[: [each is one for each in self.lists].index(True)]
        return sum(len(each.odts) for each in before)

    def _gathered(self, one: DaqList) -> list[NDArray[np.intp]]:
        found = []
        for number, odt in enumerate(one.odts):
            length = 1 + (STAMP.size if one.mode & TIMESTAMP and number == 0 else 0)
            length += sum(entry.length for entry in odt)
            if not odt or length > self._max_dto or any(not entry.length for entry in odt):
                raise Refused(Error.DAQ_CONFIG)
            found.append(np.concatenate([np.arange(one.place, one.place + one.length) for one in odt]))
        if not found:
            raise Refused(Error.DAQ_CONFIG)
        return found

    def packets(self, number: int, t_mono_ns: int, image: Image) -> Iterator[bytes]:
        """Yield the packets of cycle `number`, which began at `t_mono_ns`, in the order of the lists."""
        for one in self.lists:
            if not one.running or number % one.prescaler:
                continue
            stamp = STAMP.pack(t_mono_ns // TICK_NS & 0xFFFFFFFF) if one.mode & TIMESTAMP else b""
            for odt, places in enumerate(one.gathered):
                yield bytes([one.first_pid + odt]) + (b"" if odt else stamp) + image[places].tobytes()
