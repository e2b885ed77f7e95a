"""Diagnostic session (ISO 14229-1): what one is, its timing, security access and negative responses.

A session is a value: a service takes one and returns the next, so that a request is a function of bytes.
"""

import hmac
import math
from collections.abc import Callable
from enum import IntEnum
from typing import Final, NamedTuple

from ecu.contract.work import Kind
from ecu.diagnostics.fault_memory import FaultMemory

DEFAULT: Final = 0x01
EXTENDED: Final = 0x03
S3_S: Final = 5.0
"""Without a request for that long a session ends."""
P2_MS: Final = 50
P2_STAR_MS: Final = 5000


class Reason(IntEnum):
    """Code of a negative response, with its name in the standard."""

    text: str

    SERVICE_NOT_SUPPORTED = 0x11, "serviceNotSupported"
    SUBFUNCTION_NOT_SUPPORTED = 0x12, "subFunctionNotSupported"
    INCORRECT_LENGTH = 0x13, "incorrectMessageLengthOrInvalidFormat"
    RESPONSE_TOO_LONG = 0x14, "responseTooLong"
    BUSY = 0x21, "busyRepeatRequest"
    CONDITIONS_NOT_CORRECT = 0x22, "conditionsNotCorrect"
    SEQUENCE_ERROR = 0x24, "requestSequenceError"
    OUT_OF_RANGE = 0x31, "requestOutOfRange"
    ACCESS_DENIED = 0x33, "securityAccessDenied"
    INVALID_KEY = 0x35, "invalidKey"
    ATTEMPTS_EXCEEDED = 0x36, "exceededNumberOfAttempts"
    DELAY_NOT_EXPIRED = 0x37, "requiredTimeDelayNotExpired"
    PROGRAMMING_FAILURE = 0x72, "generalProgrammingFailure"
    PENDING = 0x78, "requestCorrectlyReceived-ResponsePending"
    SUBFUNCTION_NOT_IN_SESSION = 0x7E, "subFunctionNotSupportedInActiveSession"
    SERVICE_NOT_IN_SESSION = 0x7F, "serviceNotSupportedInActiveSession"

    def __new__(cls, code: int, text: str) -> "Reason":
        """Return a member that is the number."""
        member = int.__new__(cls, code)
        member._value_, member.text = code, text
        return member


REASONS: Final = {int(one): one.text for one in Reason}
SILENT_WHEN_FUNCTIONAL: Final = (
    Reason.SERVICE_NOT_SUPPORTED,
    Reason.SUBFUNCTION_NOT_SUPPORTED,
    Reason.OUT_OF_RANGE,
    Reason.SUBFUNCTION_NOT_IN_SESSION,
    Reason.SERVICE_NOT_IN_SESSION,
)
"""Not sent in answer to a request to all ECUs."""

SEED_BYTES: Final = 16
KEY_BYTES: Final = 16
ATTEMPTS: Final = 3
DELAY_S: Final = 10.0


class Refused(Exception):
    """A negative response, by its code."""

    def __init__(self, code: Reason, session: "Session | None" = None) -> None:
        self.code, self.session = code, session
        """The session after it, None: as before."""
        super().__init__(code.text)


class Session(NamedTuple):
    """State of the server towards its tester."""

    kind: int = DEFAULT
    unlocked: bool = False
    seed: bytes = b""
    """Sent, and not yet answered by a key."""
    wrong_keys: int = 0
    delayed_until_s: float = -math.inf
    """No seed before that time."""
    tested: bytes = b""
    """Result of the self-test, empty: not started."""
    dtc_setting: bool = True
    """False: the fault memory leaves results out."""
    restarts: bool = False
    """The daemon is to be restarted once the response has left."""
    heard_s: float = -math.inf


class Ecu(NamedTuple):
    """What the services reach of the ECU."""

    memory: FaultMemory
    armed: bool
    read: Callable[[int], bytes | None]
    """Data of an identifier, None: there is none."""
    clear: Callable[[int | None], bool]
    """Clear a trouble code (None: all); False: it could not be stored."""
    clearing_lasts: bool
    """A response may come later than P2: it is stored."""
    self_test: Callable[[], bytes]
    work: Callable[[Kind, dict[str, float]], None]
    """Do what a workshop does to the learned values, by corner: thicknesses of measured pads [mm].

    Raises Refused.
    """
    can_restart: Callable[[], bool]
    new_seed: Callable[[], bytes]
    secret: bytes
    """Of the key file, empty: there is none."""


def begin(session: Session, kind: int) -> Session:
    """Return the session after a change to `kind`: locked; the default one keeps nothing of the last."""
    setting = session.dtc_setting or kind == DEFAULT
    tested = session.tested if kind != DEFAULT else b""
    return session._replace(kind=kind, unlocked=False, seed=b"", tested=tested, dtc_setting=setting)


def in_time(session: Session, now_s: float) -> Session:
    """Return the session at `now_s`: the default one, if its tester has been silent for longer than S3."""
    if session.kind != DEFAULT and now_s - session.heard_s > S3_S:
        return begin(session, DEFAULT)
    return session


def key_of(secret: bytes, seed: bytes) -> bytes:
    """Return the key that answers a seed: the first 16 bytes of HMAC-SHA-256 (RFC 2104) over the seed."""
    return hmac.digest(secret, seed, "sha256")[:KEY_BYTES]


def give_seed(session: Session, ecu: Ecu, now_s: float) -> tuple[Session, bytes]:
    """Return the seed, zeros where access is granted already. Raises Refused.

    Asked for again before its key it is the same (ISO 14229-1): its first response may be late.
    """
    if not ecu.secret:
        raise Refused(Reason.CONDITIONS_NOT_CORRECT)
    if now_s < session.delayed_until_s:
        raise Refused(Reason.DELAY_NOT_EXPIRED)
    if session.unlocked:
        return session, bytes(SEED_BYTES)
    seed = session.seed or ecu.new_seed()
    return session._replace(seed=seed), seed


def take_key(session: Session, ecu: Ecu, now_s: float, key: bytes) -> Session:
    """Return the session after a key: a seed is good for one. Raises Refused."""
    if not session.seed:
        raise Refused(Reason.SEQUENCE_ERROR)
    if hmac.compare_digest(key, key_of(ecu.secret, session.seed)):
        return session._replace(unlocked=True, seed=b"", wrong_keys=0)
    wrong = session.wrong_keys + 1
    if wrong < ATTEMPTS:
        raise Refused(Reason.INVALID_KEY, session._replace(seed=b"", wrong_keys=wrong))
    later = session._replace(seed=b"", wrong_keys=0, delayed_until_s=now_s + DELAY_S)
    raise Refused(Reason.ATTEMPTS_EXCEEDED, later)
