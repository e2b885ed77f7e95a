"""Services of the diagnostic server (ISO 14229-1): bytes of a request to bytes of a response.

`respond` is a function of session, request, time and what `Ecu` gives: it sends and waits for nothing.
Refused whatever the session: ECUReset while the ECU is armed (its demands would be gone until it is back),
and CommunicationControl (its frames are the demands: a tester's word must not end them). What a workshop
writes or does to the learned values reaches the loop while the car stands with released brakes alone: the
loop itself decides that.
"""

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

from ecu.contract.signals import CORNERS
from ecu.contract.work import Kind
from ecu.diagnostics import read_faults
from ecu.diagnostics.identifiers import PAD_THICKNESS, SESSION, length_of, to_values
from ecu.diagnostics.session import (
    DEFAULT,
    EXTENDED,
    KEY_BYTES,
    P2_MS,
    P2_STAR_MS,
    SILENT_WHEN_FUNCTIONAL,
    Ecu,
    Reason,
    Refused,
    Session,
    begin,
    give_seed,
    in_time,
    take_key,
)

SESSION_CONTROL: Final = 0x10
RESET: Final = 0x11
CLEAR: Final = 0x14
READ_FAULTS: Final = 0x19
READ_DATA: Final = 0x22
SECURITY_ACCESS: Final = 0x27
COMMUNICATION_CONTROL: Final = 0x28
WRITE_DATA: Final = 0x2E
ROUTINE_CONTROL: Final = 0x31
TESTER_PRESENT: Final = 0x3E
DTC_SETTING: Final = 0x85
NEGATIVE: Final = 0x7F
POSITIVE: Final = 0x40
"""Added to a service in its positive response."""
SUPPRESS: Final = 0x80
"""suppressPosRspMsgIndicationBit of a sub-function."""

ALL_GROUPS: Final = 0xFFFFFF
MOST_IDENTIFIERS: Final = 32
LONGEST_MESSAGE: Final = 4095
"""Bytes of a message of ISO-TP with classical frames."""

SELF_TEST: Final = 0x0200
NEW_PADS: Final = 0x0201
FORGET: Final = 0x0202
ROUTINES: Final = {
    SELF_TEST: "self-test",
    NEW_PADS: "new pads",
    FORGET: "forget what was learned",
}
START, RESULTS = 0x01, 0x03
WORKS: Final = {NEW_PADS: (Kind.NEW_PADS, 5), FORGET: (Kind.FORGET, 4)}
"""Routines of a workshop: what is done, bytes of the request; of new pads the last has a bit a corner."""
ON, OFF = 0x01, 0x02

Handler = Callable[[Session, bytes, Ecu, float], tuple[Session, bytes]]


class Service(NamedTuple):
    """One service: what it does, where it is allowed, its sub-functions."""

    handle: Handler
    """Returns the next session and what follows the service in the positive response."""
    subfunctions: tuple[int, ...] = ()
    in_default: bool = True


def _length(request: bytes, length: int) -> None:
    if len(request) != length:
        raise Refused(Reason.INCORRECT_LENGTH)


def _session_control(session: Session, request: bytes, ecu: Ecu, now_s: float) -> tuple[Session, bytes]:
    _length(request, 2)
    kind = request[1] & ~SUPPRESS
    timing = P2_MS.to_bytes(2, "big") + (P2_STAR_MS // 10).to_bytes(2, "big")
    return begin(session, kind), bytes([kind]) + timing


def _reset(session: Session, request: bytes, ecu: Ecu, now_s: float) -> tuple[Session, bytes]:
    _length(request, 2)
    if ecu.armed or not ecu.can_restart():
        raise Refused(Reason.CONDITIONS_NOT_CORRECT)
    return begin(session, DEFAULT)._replace(restarts=True), bytes([request[1] & ~SUPPRESS])


def _clear(session: Session, request: bytes, ecu: Ecu, now_s: float) -> tuple[Session, bytes]:
    _length(request, 4)
    group = int.from_bytes(request[1:4], "big")
    if group != ALL_GROUPS and group not in ecu.memory.entries:
        raise Refused(Reason.OUT_OF_RANGE)
    if not ecu.clear(None if group == ALL_GROUPS else group):
        raise Refused(Reason.PROGRAMMING_FAILURE)
    return session, b""


def _read_faults(session: Session, request: bytes, ecu: Ecu, now_s: float) -> tuple[Session, bytes]:
    return session, bytes([request[1] & ~SUPPRESS]) + read_faults.report(ecu.memory, request)


def _read_data(session: Session, request: bytes, ecu: Ecu, now_s: float) -> tuple[Session, bytes]:
    numbers = request[1:]
    if not numbers or len(numbers) % 2 or len(numbers) > 2 * MOST_IDENTIFIERS:
        raise Refused(Reason.INCORRECT_LENGTH)
    text = b""
    for at in range(0, len(numbers), 2):
        number = int.from_bytes(numbers[at : at + 2], "big")
        data = bytes([session.kind]) if number == SESSION else ecu.read(number)
        text += numbers[at : at + 2] + data if data is not None else b""
    if not text:
        raise Refused(Reason.OUT_OF_RANGE)
    return session, text


def _security_access(session: Session, request: bytes, ecu: Ecu, now_s: float) -> tuple[Session, bytes]:
    level = request[1] & ~SUPPRESS
    if level == 0x01:
        _length(request, 2)
        session, seed = give_seed(session, ecu, now_s)
        return session, bytes([level]) + seed
    _length(request, 2 + KEY_BYTES)
    return take_key(session, ecu, now_s, request[2:]), bytes([level])


def _communication_control(session: Session, request: bytes, ecu: Ecu, now_s: float) -> tuple[Session, bytes]:
    _length(request, 3)
    raise Refused(Reason.CONDITIONS_NOT_CORRECT)


def _routine_control(session: Session, request: bytes, ecu: Ecu, now_s: float) -> tuple[Session, bytes]:
    if len(request) < 4:
        raise Refused(Reason.INCORRECT_LENGTH)
    kind, routine = request[1] & ~SUPPRESS, int.from_bytes(request[2:4], "big")
    if routine not in ROUTINES:
        raise Refused(Reason.OUT_OF_RANGE)
    if routine in WORKS:
        ecu.work(*_work(session, request))
        return session, bytes([kind]) + request[2:4]
    _length(request, 4)
    if kind == START:
        session = session._replace(tested=ecu.self_test())
    elif not session.tested:
        raise Refused(Reason.SEQUENCE_ERROR)
    return session, bytes([kind]) + request[2:4] + session.tested


def _write_data(session: Session, request: bytes, ecu: Ecu, now_s: float) -> tuple[Session, bytes]:
    ecu.work(*_work(session, request))
    return session, request[1:3]


def _work(session: Session, request: bytes) -> tuple[Kind, dict[str, float]]:
    """Return the work that a request to write, or to start a routine, asks for. Raises Refused."""
    if request[0] == WRITE_DATA:
        if len(request) < 4:
            raise Refused(Reason.INCORRECT_LENGTH)
        if int.from_bytes(request[1:3], "big") != PAD_THICKNESS.number:
            raise Refused(Reason.OUT_OF_RANGE)
        kind, length = Kind.MEASURED_PADS, 3 + length_of(PAD_THICKNESS)
    elif request[1] & ~SUPPRESS != START:
        raise Refused(Reason.SUBFUNCTION_NOT_SUPPORTED)
    else:
        kind, length = WORKS[int.from_bytes(request[2:4], "big")]
    if not session.unlocked:
        raise Refused(Reason.ACCESS_DENIED)
    _length(request, length)
    values: Sequence[float | None] = ()
    if kind == Kind.MEASURED_PADS:
        values = to_values(PAD_THICKNESS, request[3:])
    elif kind == Kind.NEW_PADS and request[4] < 1 << len(CORNERS):
        values = [0.0 if request[4] >> i & 1 else None for i in range(len(CORNERS))]
    done = {corner: value for corner, value in zip(CORNERS, values, strict=False) if value is not None}
    if not done and kind != Kind.FORGET:
        raise Refused(Reason.OUT_OF_RANGE)
    return kind, done


def _tester_present(session: Session, request: bytes, ecu: Ecu, now_s: float) -> tuple[Session, bytes]:
    _length(request, 2)
    return session, b"\x00"


def _dtc_setting(session: Session, request: bytes, ecu: Ecu, now_s: float) -> tuple[Session, bytes]:
    _length(request, 2)
    kind = request[1] & ~SUPPRESS
    return session._replace(dtc_setting=kind == ON), bytes([kind])


SERVICES: Final = {
    SESSION_CONTROL: Service(_session_control, (DEFAULT, EXTENDED)),
    RESET: Service(_reset, (0x01,)),
    CLEAR: Service(_clear),
    READ_FAULTS: Service(_read_faults, tuple(read_faults.LENGTHS)),
    READ_DATA: Service(_read_data),
    SECURITY_ACCESS: Service(_security_access, (0x01, 0x02), in_default=False),
    COMMUNICATION_CONTROL: Service(_communication_control, (0x00, 0x01, 0x02, 0x03), in_default=False),
    WRITE_DATA: Service(_write_data, in_default=False),
    ROUTINE_CONTROL: Service(_routine_control, (START, RESULTS), in_default=False),
    TESTER_PRESENT: Service(_tester_present, (0x00,)),
    DTC_SETTING: Service(_dtc_setting, (ON, OFF), in_default=False),
}


def negative(service: int, code: int) -> bytes:
    """Return a negative response."""
    return bytes([NEGATIVE, service, code])


def respond(
    session: Session, request: bytes, ecu: Ecu, now_s: float, functional: bool = False
) -> tuple[Session, bytes]:
    """Return the next session and the response, empty: none is sent.

    Args:
        session: of the tester.
        request: from the service identifier on, any bytes; of a response's identifier it is not answered.
        ecu: what is read, cleared, tested.
        now_s: on any clock that does not go back.
        functional: sent to all ECUs, which do not all refuse what only one of them may have.
    """
    session = in_time(session, now_s)
    if not request or request[0] & POSITIVE:
        return session, b""
    session = session._replace(heard_s=now_s)
    try:
        service = _allowed(session, request)
        session, text = service.handle(session, request, ecu, now_s)
    except Refused as refused:
        session = refused.session or session
        silent = functional and refused.code in SILENT_WHEN_FUNCTIONAL
        return session, b"" if silent else negative(request[0], refused.code)
    if service.subfunctions and request[1] & SUPPRESS:
        return session, b""
    response = bytes([request[0] + POSITIVE]) + text
    if len(response) > LONGEST_MESSAGE:
        response = negative(request[0], Reason.RESPONSE_TOO_LONG)
    return session, response


def _allowed(session: Session, request: bytes) -> Service:
    """Return the service that a request asks for. Raises Refused."""
    service = SERVICES.get(request[0])
    if service is None:
        raise Refused(Reason.SERVICE_NOT_SUPPORTED)
    if session.kind == DEFAULT and not service.in_default:
        raise Refused(Reason.SERVICE_NOT_IN_SESSION)
    if service.subfunctions:
        if len(request) < 2:
            raise Refused(Reason.INCORRECT_LENGTH)
        if request[1] & ~SUPPRESS not in service.subfunctions:
            raise Refused(Reason.SUBFUNCTION_NOT_SUPPORTED)
    return service


def pending(session: Session, request: bytes, ecu: Ecu) -> bytes:
    """Return what to send before the response, as that may come later than P2; empty: it comes in time."""
    if _is_work(session, request):
        return negative(request[0], Reason.PENDING)
    group = int.from_bytes(request[1:4], "big")
    clears = request[:1] == bytes([CLEAR]) and len(request) == 4
    lasts = clears and ecu.clearing_lasts and (group == ALL_GROUPS or group in ecu.memory.entries)
    return negative(CLEAR, Reason.PENDING) if lasts else b""


def _is_work(session: Session, request: bytes) -> bool:
    """Return whether the loop will be asked."""
    if not session.unlocked or not request:
        return False
    try:
        service = _allowed(session, request)
        routine = service.handle is _routine_control and int.from_bytes(request[2:4], "big") in WORKS
        return (service.handle is _write_data or routine) and bool(_work(session, request))
    except Refused:
        return False
