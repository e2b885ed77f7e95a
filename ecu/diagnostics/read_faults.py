"""ReadDTCInformation (ISO 14229-1, service 0x19): reports of the fault memory as bytes."""

from typing import Final

from ecu.diagnostics.fault_memory import AVAILABLE, FaultMemory
from ecu.diagnostics.identifiers import OF_SNAPSHOT
from ecu.diagnostics.session import Reason, Refused
from ecu.diagnostics.trouble_codes import FORMAT

NUMBER_BY_MASK: Final = 0x01
BY_MASK: Final = 0x02
SNAPSHOT: Final = 0x04
EXTENDED_DATA: Final = 0x06
SUPPORTED: Final = 0x0A
LENGTHS: Final = {NUMBER_BY_MASK: 3, BY_MASK: 3, SNAPSHOT: 6, EXTENDED_DATA: 6, SUPPORTED: 2}
"""Bytes of a request, by its sub-function."""

FIRST: Final = 0x01
LAST: Final = 0x02
"""Snapshot records."""
OCCURRENCES: Final = 0x01
AGEING: Final = 0x02
"""Extended data records, of a byte each."""
ALL: Final = 0xFF


def report(memory: FaultMemory, request: bytes) -> bytes:
    """Return what follows the service and the sub-function in the response.

    Raises:
        Refused: the request has another length, or asks for a code or a record that there is not.
    """
    kind = request[1] & 0x7F
    if len(request) != LENGTHS[kind]:
        raise Refused(Reason.INCORRECT_LENGTH)
    if kind == NUMBER_BY_MASK:
        count = len(_matching(memory, request[2]))
        return bytes([AVAILABLE, FORMAT]) + count.to_bytes(2, "big")
    if kind == BY_MASK:
        return _listed(memory, _matching(memory, request[2]))
    if kind == SUPPORTED:
        return _listed(memory, list(memory.entries))
    number, record = int.from_bytes(request[2:5], "big"), request[5]
    known = (FIRST, LAST) if kind == SNAPSHOT else (OCCURRENCES, AGEING)
    if number not in memory.entries or record not in (*known, ALL):
        raise Refused(Reason.OUT_OF_RANGE)
    entry = memory.entries[number]
    text = request[2:5] + bytes([entry.status & AVAILABLE])
    for one in known if record == ALL else [record]:
        if kind == SNAPSHOT:
            stored = entry.first if one == FIRST else entry.last
            text += bytes([one, len(OF_SNAPSHOT)]) + stored if stored else b""
        else:
            text += bytes([one, entry.occurrences if one == OCCURRENCES else entry.ageing])
    return text


def _matching(memory: FaultMemory, mask: int) -> list[int]:
    return [number for number, entry in memory.entries.items() if entry.status & mask & AVAILABLE]


def _listed(memory: FaultMemory, numbers: list[int]) -> bytes:
    records = (number.to_bytes(3, "big") + bytes([memory.entries[number].status]) for number in numbers)
    return bytes([AVAILABLE]) + b"".join(records)
