"""Diagnostic session (ISO 14229-1): what one is, its timing, security access and negative responses.

A session is a value: a service takes one and returns the next, so that a request is a function of bytes.
"""

import hmac
import math
from collections.abc import Callable
from typing import Final, NamedTuple

from ecu.contract.work import Kind
from ecu.diagnostics.fault_memory import FaultMemory

DEFAULT: Final = 0x01
EXTENDED: Final = 0x03
S3_S: Final = 5.0
"""Without a request for that long a session ends."""
P2_MS: Final = 50
P2_STAR_MS: Final = 5000

SERVICE_NOT_SUPPORTED: Final = 0x11
SUBFUNCTION_NOT_SUPPORTED: Final = 0x12
INCORRECT_LENGTH: Final = 0x13
RESPONSE_TOO_LONG: Final = 0x14
BUSY: Final = 0x21
CONDITIONS_NOT_CORRECT: Final = 0x22
SEQUENCE_ERROR: Final = 0x24
OUT_OF_RANGE: Final = 0x31
ACCESS_DENIED: Final = 0x33
INVALID_KEY: Final = 0x35
ATTEMPTS_EXCEEDED: Final = 0x36
DELAY_NOT_EXPIRED: Final = 0x37
PROGRAMMING_FAILURE: Final = 0x72
PENDING: Final = 0x78
SUBFUNCTION_NOT_IN_SESSION: Final = 0x7E
SERVICE_NOT_IN_SESSION: Final = 0x7F
REASONS: Final = {
    SERVICE_NOT_SUPPORTED: "serviceNotSupported",
    SUBFUNCTION_NOT_SUPPORTED: "subFunctionNotSupported",
    INCORRECT_LENGTH: "incorrectMessageLengthOrInvalidFormat",
    RESPONSE_TOO_LONG: "responseTooLong",
    BUSY: "busyRepeatRequest",
    CONDITIONS_NOT_CORRECT: "conditionsNotCorrect",
    SEQUENCE_ERROR: "requestSequenceError",
    OUT_OF_RANGE: "requestOutOfRange",
    ACCESS_DENIED: "securityAccessDenied",
    INVALID_KEY: "invalidKey",
    ATTEMPTS_EXCEEDED: "exceededNumberOfAttempts",
    DELAY_NOT_EXPIRED: "requiredTimeDelayNotExpired",
    PROGRAMMING_FAILURE: "generalProgrammingFailure",
    PENDING: "requestCorrectlyReceived-ResponsePending",
    SUBFUNCTION_NOT_IN_SESSION: "subFunctionNotSupportedInActiveSession",
    SERVICE_NOT_IN_SESSION: "serviceNotSupportedInActiveSession",
}
SILENT_WHEN_FUNCTIONAL: Final = (
    SERVICE_NOT_SUPPORTED,
    SUBFUNCTION_NOT_SUPPORTED,
    OUT_OF_RANGE,
    SUBFUNCTION_NOT_IN_SESSION,
    SERVICE_NOT_IN_SESSION,
)
"""Not sent in answer to a request to all ECUs."""

SEED_BYTES: Final = 16
KEY_BYTES: Final = 16
ATTEMPTS: Final = 3
DELAY_S: Final = 10.0


class Refused(Exception):
    """A negative response, by its code."""

    def __init__(self, code: int, session: "Session | None" = None) -> None:
        self.code, self.session = code, session
        """The session after it, None: as before."""
        super().__init__(REASONS[code])


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
        raise Refused(CONDITIONS_NOT_CORRECT)
    if now_s < session.delayed_until_s:
        raise Refused(DELAY_NOT_EXPIRED)
    if session.unlocked:
        return session, bytes(SEED_BYTES)
    seed = session.seed or ecu.new_seed()
    return session._replace(seed=seed), seed


def take_key(session: Session, ecu: Ecu, now_s: float, key: bytes) -> Session:
    """Return the session after a key: a seed is good for one. Raises Refused."""
    if not session.seed:
        raise Refused(SEQUENCE_ERROR)
    if hmac.compare_digest(key, key_of(ecu.secret, session.seed)):
        return session._replace(unlocked=True, seed=b"", wrong_keys=0)
    wrong = session.wrong_keys + 1
    if wrong < ATTEMPTS:
        raise Refused(INVALID_KEY, session._replace(seed=b"", wrong_keys=wrong))
    later = session._replace(seed=b"", wrong_keys=0, delayed_until_s=now_s + DELAY_S)
    raise Refused(ATTEMPTS_EXCEEDED, later)
