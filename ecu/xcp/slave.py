"""XCP slave (ASAM MCD-1 XCP 1.5): answers the commands of one master. It knows no transport and no clock.

Numbers of several bytes are little-endian (Intel), addresses are of bytes, one command has one response. A
slave that is not connected answers CONNECT alone. Without a calibration nothing can be written.
"""

import struct
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

from ecu.xcp.calibration import Calibration
from ecu.xcp.daq import EVENT_CYCLE, TICK_NS, DaqLists
from ecu.xcp.memory import EPK, Image, base_of, place_of
from ecu.xcp.protocol import (
    CAL_PAG_RESOURCE,
    DAQ_RESOURCE,
    ERROR,
    EV_DAQ_OVERLOAD,
    EV_SESSION_TERMINATED,
    EVENT,
    RESPONSE,
    Command,
    Error,
    Refused,
)

CYCLE_NAME: Final = "cycle"
OPTIONAL_COMM_MODE: Final = 0x80
DAQ_RUNNING: Final = 0x40
DYNAMIC, PRESCALER, TIMESTAMPS, OVERLOAD_EVENT = 0x01, 0x02, 0x10, 0x80
STAMP_OF_FOUR_US: Final = 0x34
"""TIMESTAMP_MODE: four bytes, unit of a microsecond."""
UNIT_1_MS, CYCLE_MS, MOST_LISTS = 6, 10, 0xFF
DAQ_EVENT: Final = 0x84
"""DAQ_EVENT_PROPERTIES: measured, all of a cycle together (CONSISTENCY_EVENT)."""
VERSION: Final = 0x01
"""Major version of protocol layer and transport layers."""


class Size(NamedTuple):
    """Greatest packets of a transport."""

    command: int
    """MAX_CTO."""
    data: int
    """MAX_DTO."""


def largest_entry(size: Size) -> int:
    """Return MAX_ODT_ENTRY_SIZE_DAQ: an entry leaves room for the packet's number."""
    return min(size.data - 1, 0xF8)


class Slave:
    """State towards one master."""

    def __init__(
        self,
        size: Size,
        latest: Callable[[], Image | None],
        clock_ns: Callable[[], int],
        a2l: Callable[[], str],
        calibration: Calibration | None = None,
    ) -> None:
        """Take what it reads: the image of the last cycle, the monotonic clock, and the A2L file's text.

        `calibration`: of the run, None: measurement alone.
        """
        self._size, self._latest, self._clock_ns, self._calibration = size, latest, clock_ns, calibration
        self.connected = False
        self.daq = DaqLists(size.data, largest_entry(size))
        self._text: bytes | None = None
        """What UPLOAD reads where it is not memory."""
        self._mta = 0
        self._identifications: Mapping[int, Callable[[], str]] = {
            0: lambda: "brake-ecu",
            1: lambda: "brake_ecu",
            4: a2l,
            5: lambda: EPK,
        }

    def answer(self, command: bytes) -> bytes | None:
        """Return the response to a command, None: there is none to give."""
        if not command or not (self.connected or command[0] == Command.CONNECT):
            return None
        length, method = _COMMANDS.get(command[0], (0, Slave._unknown))
        try:
            if len(command) < length:
                raise Refused(Error.CMD_SYNTAX)
            return bytes([RESPONSE]) + method(self, command)
        except Refused as refused:
            return bytes([ERROR, refused.error])

    def events(self) -> list[bytes]:
        """Return the events that the last command led to."""
        if self._calibration is None:
            return []
        found, self._calibration.events = self._calibration.events, []
        return found

    def overload(self) -> bytes:
        """Return the event that cycles were lost."""
        return struct.pack("<BBH", EVENT, EV_DAQ_OVERLOAD, EVENT_CYCLE)

    def end(self) -> bytes:
        """End the session; return the event that says so."""
        self._disconnect(b"")
        return bytes([EVENT, EV_SESSION_TERMINATED])

    def _unknown(self, command: bytes) -> bytes:
        raise Refused(Error.CMD_UNKNOWN)

    def _connect(self, command: bytes) -> bytes:
        if command[1] != 0:
            raise Refused(Error.OUT_OF_RANGE)
        self._disconnect(b"")
        self.connected = True
        size, resource = self._size, DAQ_RESOURCE
        if self._calibration is not None:
            self._calibration.begin()
            resource |= CAL_PAG_RESOURCE
        return struct.pack("<BBBHBB", resource, OPTIONAL_COMM_MODE, size.command, size.data, VERSION, VERSION)

    def _disconnect(self, command: bytes) -> bytes:
        self.connected = False
        self.daq = DaqLists(self._size.data, largest_entry(self._size))
        self._text, self._mta = None, 0
        return b""

    def _status(self, command: bytes) -> bytes:
        protection = 0 if self._calibration is None else self._calibration.protection
        return struct.pack("<BBBH", DAQ_RUNNING if self.daq.running else 0, protection, 0, 0)

    def _synch(self, command: bytes) -> bytes:
        raise Refused(Error.CMD_SYNCH)

    def _comm_mode(self, command: bytes) -> bytes:
        return bytes([0, 0, 0, 0, 0, 0, VERSION << 4])

    def _id(self, command: bytes) -> bytes:
        text = self._identifications[command[1]]().encode() if command[1] in self._identifications else b""
        self._text, self._mta = text, 0
        return struct.pack("<BHL", 0, 0, len(text))

    def _seed(self, command: bytes) -> bytes:
        if command[1] > 1:
            raise Refused(Error.OUT_OF_RANGE)
        if self._calibration is None or command[1:3] == bytes([0, DAQ_RESOURCE]):
            return b"\x00"
        return self._calibration.seed(command[1], command[2], self._size.command - 2)

    def _unlock(self, command: bytes) -> bytes:
        if self._calibration is None:
            raise Refused(Error.SEQUENCE)
        response = self._calibration.unlock(command[1], command[2 : 2 + command[1]])
        if response is None:
            self._disconnect(b"")
            raise Refused(Error.ACCESS_LOCKED)
        return response

    def _set_mta(self, command: bytes) -> bytes:
        extension, address = struct.unpack_from("<BL", command, 3)
        if extension:
            raise Refused(Error.ACCESS_DENIED)
        self._text, self._mta = None, address
        return b""

    def _upload(self, command: bytes) -> bytes:
        length = command[1]
        if not 0 < length < self._size.command:
            raise Refused(Error.OUT_OF_RANGE)
        if self._text is None:
            found = self._read(self._mta, length)
        else:
            found = self._text[self._mta : self._mta + length]
            if len(found) < length:
                raise Refused(Error.ACCESS_DENIED)
        self._mta += length
        return found

    def _short_upload(self, command: bytes) -> bytes:
        self._set_mta(b"\x00" + command[1:])
        return self._upload(command)

    def _read(self, address: int, length: int) -> bytes:
        place = place_of(address, length)
        if place is None:
            raise Refused(Error.ACCESS_DENIED)
        found = None if self._calibration is None else self._calibration.read(place, length)
        if found is not None:
            return found
        image = self._latest()
        if image is None:
            raise Refused(Error.RESOURCE_TEMPORARY_NOT_ACCESSIBLE)
        return image[place : place + length].tobytes()

    def _download(self, command: bytes) -> bytes:
        if self._calibration is None:
            raise Refused(Error.WRITE_PROTECTED)
        length, data = command[1], command[2 : 2 + command[1]]
        if not length or len(data) != length:
            raise Refused(Error.OUT_OF_RANGE if len(data) == length else Error.CMD_SYNTAX)
        place = None if self._text is not None else place_of(self._mta, length)
        if place is None:
            raise Refused(Error.ACCESS_DENIED)
        self._calibration.write(place, data)
        self._mta += length
        return b""

    def _short_download(self, command: bytes) -> bytes:
        self._set_mta(b"\x00" + command[1:])
        return self._download(command[:2] + command[8:])

    def _calibrating(self) -> Calibration:
        if self._calibration is None:
            raise Refused(Error.CMD_UNKNOWN)
        return self._calibration

    def _set_page(self, command: bytes) -> bytes:
        return self._calibrating().set_page(*command[1:4])

    def _get_page(self, command: bytes) -> bytes:
        return self._calibrating().get_page(*command[1:3])

    def _pages_info(self, command: bytes) -> bytes:
        self._calibrating()
        return bytes([1, 0])

    def _segment_info(self, command: bytes) -> bytes:
        mode, segment, what = command[1:4]
        return self._calibrating().segment_info(mode, segment, what, base_of("parameters"))

    def _page_info(self, command: bytes) -> bytes:
        return self._calibrating().page_info(*command[2:4])

    def _copy_page(self, command: bytes) -> bytes:
        return self._calibrating().copy_page(*command[1:5])

    def _request(self, command: bytes) -> bytes:
        return self._calibrating().request(command[1])

    def _processor_info(self, command: bytes) -> bytes:
        properties = DYNAMIC | PRESCALER | TIMESTAMPS | OVERLOAD_EVENT
        return struct.pack("<BHHBB", properties, len(self.daq.lists), 1, 0, 0)

    def _resolution_info(self, command: bytes) -> bytes:
        return struct.pack("<BBBBBH", 1, largest_entry(self._size), 1, 0, STAMP_OF_FOUR_US, 1)

    def _event_info(self, command: bytes) -> bytes:
        if struct.unpack_from("<H", command, 2)[0] != EVENT_CYCLE:
            raise Refused(Error.OUT_OF_RANGE)
        self._text, self._mta = CYCLE_NAME.encode(), 0
        return bytes([DAQ_EVENT, MOST_LISTS, len(CYCLE_NAME), CYCLE_MS, UNIT_1_MS, 0])

    def _clock(self, command: bytes) -> bytes:
        return struct.pack("<BBBL", 0, 0, 0, self._clock_ns() // TICK_NS & 0xFFFFFFFF)

    def _free(self, command: bytes) -> bytes:
        self.daq.free()
        return b""

    def _allocate(self, command: bytes) -> bytes:
        self.daq.allocate(*struct.unpack_from("<H", command, 2))
        return b""

    def _allocate_odts(self, command: bytes) -> bytes:
        self.daq.allocate_odts(*struct.unpack_from("<HB", command, 2))
        return b""

    def _allocate_entries(self, command: bytes) -> bytes:
        self.daq.allocate_entries(*struct.unpack_from("<HBB", command, 2))
        return b""

    def _point(self, command: bytes) -> bytes:
        self.daq.point(*struct.unpack_from("<HBB", command, 2))
        return b""

    def _write(self, command: bytes) -> bytes:
        self.daq.write(*struct.unpack_from("<BBBL", command, 1))
        return b""

    def _write_several(self, command: bytes) -> bytes:
        if len(command) < 2 + 8 * command[1]:
            raise Refused(Error.CMD_SYNTAX)
        for number in range(command[1]):
            bit, length, address, extension = struct.unpack_from("<BBLB", command, 2 + 8 * number)
            self.daq.write(bit, length, extension, address)
        return b""

    def _clear_list(self, command: bytes) -> bytes:
        self.daq.clear(*struct.unpack_from("<H", command, 2))
        return b""

    def _list_mode(self, command: bytes) -> bytes:
        mode, number, event, prescaler, _ = struct.unpack_from("<BHHBB", command, 1)
        self.daq.set_mode(number, mode, event, prescaler)
        return b""

    def _start_stop(self, command: bytes) -> bytes:
        mode, number = struct.unpack_from("<BH", command, 1)
        return bytes([self.daq.start_stop(mode, number)])

    def _start_stop_selected(self, command: bytes) -> bytes:
        self.daq.start_stop_selected(command[1])
        return b""


_COMMANDS: Final[Mapping[int, tuple[int, Callable[[Slave, bytes], bytes]]]] = {
    Command.CONNECT: (2, Slave._connect),
    Command.DISCONNECT: (1, Slave._disconnect),
    Command.GET_STATUS: (1, Slave._status),
    Command.SYNCH: (1, Slave._synch),
    Command.GET_COMM_MODE_INFO: (1, Slave._comm_mode),
    Command.GET_ID: (2, Slave._id),
    Command.GET_SEED: (3, Slave._seed),
    Command.UNLOCK: (2, Slave._unlock),
    Command.SET_MTA: (8, Slave._set_mta),
    Command.UPLOAD: (2, Slave._upload),
    Command.SHORT_UPLOAD: (8, Slave._short_upload),
    Command.DOWNLOAD: (2, Slave._download),
    Command.SHORT_DOWNLOAD: (8, Slave._short_download),
    Command.SET_CAL_PAGE: (4, Slave._set_page),
    Command.GET_CAL_PAGE: (3, Slave._get_page),
    Command.GET_PAG_PROCESSOR_INFO: (1, Slave._pages_info),
    Command.GET_SEGMENT_INFO: (5, Slave._segment_info),
    Command.GET_PAGE_INFO: (4, Slave._page_info),
    Command.COPY_CAL_PAGE: (5, Slave._copy_page),
    Command.SET_REQUEST: (4, Slave._request),
    Command.GET_DAQ_PROCESSOR_INFO: (1, Slave._processor_info),
    Command.GET_DAQ_RESOLUTION_INFO: (1, Slave._resolution_info),
    Command.GET_DAQ_EVENT_INFO: (4, Slave._event_info),
    Command.GET_DAQ_CLOCK: (1, Slave._clock),
    Command.FREE_DAQ: (1, Slave._free),
    Command.ALLOC_DAQ: (4, Slave._allocate),
    Command.ALLOC_ODT: (5, Slave._allocate_odts),
    Command.ALLOC_ODT_ENTRY: (6, Slave._allocate_entries),
    Command.SET_DAQ_PTR: (6, Slave._point),
    Command.WRITE_DAQ: (8, Slave._write),
    Command.WRITE_DAQ_MULTIPLE: (2, Slave._write_several),
    Command.CLEAR_DAQ_LIST: (4, Slave._clear_list),
    Command.SET_DAQ_LIST_MODE: (8, Slave._list_mode),
    Command.START_STOP_DAQ_LIST: (4, Slave._start_stop),
    Command.START_STOP_SYNCH: (2, Slave._start_stop_selected),
}
"""Of each command its least length and what does it."""

_NOT_OPTIONAL: Final = (Command.CONNECT, Command.DISCONNECT, Command.GET_STATUS, Command.SYNCH)
OPTIONAL_COMMANDS: Final = tuple(one for one in Command if one not in _NOT_OPTIONAL)
"""Those that an A2L file lists."""
