"""Quality of a protected stream: AUTOSAR's E2E state machine, and detection of excess frames.

The machine (PRS E2E Protocol, E2E_SMCheck) looks at the last `WINDOW` checks of a message:

    NODATA   no intact frame yet
    INIT     -> VALID with MIN_OK checks OK, -> INVALID with more than MAX_ERROR errors
    VALID    -> INVALID with fewer than MIN_OK OK, or more than MAX_ERROR errors
    INVALID  -> VALID with MIN_OK_AGAIN OK and at most MAX_ERROR_AGAIN errors

A check is one frame, or one period without any (NONEWDATA; counted when the next frame arrives: until then
freshness reports the silence). OK is an accepted frame, ERROR a wrong checksum or length; a frame repeated or
out of sequence is neither, as in AUTOSAR. One window serves all states, so MIN_OK holds for INIT too.

A stream is loud, and a fault for `REPORTED_NS`, if `MANY_REJECTED` frames of the window were rejected
for any reason, or if it carries more frames than one sender makes: those beyond `FASTER` times its rate fill
a bucket, whose limit is `CROWD` periods; as many periods without a frame may be caught up.
"""

from typing import Any, Final

from ecu.jit import Record, kernel

NODATA, INIT, VALID, INVALID = range(4)
P_OK, P_ERROR, P_REPEATED, P_WRONG_SEQUENCE, P_NONEWDATA = range(5)

WINDOW: Final = 16  # checks; the windows are kept as bits
MIN_OK, MAX_ERROR = 9, 5
MIN_OK_AGAIN, MAX_ERROR_AGAIN = 12, 2
MANY_REJECTED: Final = 8
FASTER: Final = 1.25  # times its rate, limit of one sender: clock error, and late frames caught up
CROWD: Final = 16.0  # periods
REPORTED_NS: Final = 1_000_000_000
_MASK: Final = (1 << WINDOW) - 1

LINK: Final = [
    ("ok_window", "i8"),  # the last checks as bits, the newest is bit 0
    ("error_window", "i8"),
    ("rejected_window", "i8"),
    ("ok_count", "i8"),  # number of bits set
    ("error_count", "i8"),
    ("rejected_count", "i8"),
    ("link", "i8"),  # NODATA, INIT, VALID or INVALID
    ("crowd", "f8"),  # frames in excess of one sender
    ("checked_ns", "i8"),  # stamp of the last frame checked
    ("reported_ns", "i8"),  # stamp of the last frame that made it loud
]


@kernel
def add_check(state: Record, status: int) -> None:
    """Add one check to the window and run the state machine.

    Args:
        state: fields of `LINK`, overwritten.
        status: P_OK, P_ERROR, P_REPEATED, P_WRONG_SEQUENCE or P_NONEWDATA.
    """
    if state.link == NODATA and status in (P_ERROR, P_NONEWDATA):
        return
    ok = 1 if status == P_OK else 0
    error = 1 if status == P_ERROR else 0
    rejected = 0 if ok or status == P_NONEWDATA else 1
    last = WINDOW - 1
    state.ok_count += ok - ((state.ok_window >> last) & 1)
    state.error_count += error - ((state.error_window >> last) & 1)
    state.rejected_count += rejected - ((state.rejected_window >> last) & 1)
    state.ok_window = (state.ok_window << 1 | ok) & _MASK
    state.error_window = (state.error_window << 1 | error) & _MASK
    state.rejected_window = (state.rejected_window << 1 | rejected) & _MASK
    if state.link == NODATA:
        state.link = INIT
    elif state.link == INIT:
        if state.error_count > MAX_ERROR:
            state.link = INVALID
        elif state.ok_count >= MIN_OK:
            state.link = VALID
    elif state.link == VALID:
        if state.error_count > MAX_ERROR or state.ok_count < MIN_OK:
            state.link = INVALID
    elif state.error_count <= MAX_ERROR_AGAIN and state.ok_count >= MIN_OK_AGAIN:
        state.link = VALID


@kernel
def judge_link(state: Record, status: int, stamp_ns: int, period_ns: int, slowest_ns: int) -> Any:
    """Judge one frame's check and the silence before it; return whether the stream is loud by this frame.

    Args:
        state: fields of `LINK`, overwritten.
        status: of the frame's check.
        stamp_ns: of the frame.
        period_ns: between two frames.
        slowest_ns: longest period, where the sender's is variable.
    """
    elapsed = max(stamp_ns - state.checked_ns, 0)
    periods, missed = elapsed / period_ns, max(-state.crowd, 0.0)
    if state.link != NODATA and elapsed >= slowest_ns + slowest_ns // 2:
        missed = min(max(periods - 1.0, missed), CROWD)
        for _ in range(min((elapsed + slowest_ns // 2) // slowest_ns - 1, WINDOW)):
            add_check(state, P_NONEWDATA)
    state.checked_ns = stamp_ns
    add_check(state, status)
    state.crowd = max(state.crowd - FASTER * periods, -missed) + 1.0
    loud = state.crowd > CROWD or state.rejected_count >= MANY_REJECTED
    state.crowd = min(state.crowd, CROWD + 1.0)
    if loud:
        state.reported_ns = stamp_ns
    return loud
