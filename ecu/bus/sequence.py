"""Counter of a protected message: whose frame it is.

A sender keeps a grid, one count a period. At times it is late: frames that are held up, or caught up in a
burst, count on from those before them, and their sender keeps its grid. A frame that is early belongs to
another stream, or to a new grid. So two streams are followed: the *sender*, whose frames are accepted, and a
*rival*, of the frames that are not its. The sender's is a frame

    on its grid, within half a period or its usual jitter; a quarter early if a count was claimed twice
    or later, by any time
    unless it is on the grid of a living rival and nearer to that

A stream replayed beside its sender is thus a rival, however many frames the sender loses, unless it is in
phase with it: then two frames claim one count, which is reported (CROSSED), and the nearer one keeps the
grid. A rival of `CONFIRMED` frames in sequence succeeds a sender that is gone, as AUTOSAR's P01 check
synchronises again; one that was heard beside it only after `DOUBT_NS`. A grid on which `LIVING` frames in a
row were as late has shifted. A successor, or a shifted sender, is not *established* until it was alone for
`DOUBT_NS`; until then frames on the former sender's grid get that its place back. `link.py` judges the
stream, `request.py` uses what rivals ask for.
"""

from typing import Any, Final

import numpy as np

from ecu.jit import Record, kernel

# Results of the check
IN_SEQUENCE, SOME_LOST, RESYNCHRONISED, REPEATED, WRONG_SEQUENCE, CROSSED = range(6)
ESTABLISHED, EQUAL, UNKNOWN = range(3)
LIVING: Final = 6.5
"""Periods without a frame that a sender may lose, five frames and their jitter, before it is gone."""
CONFIRMED: Final = 3
"""Frames in sequence that make a rival: the first one out of the sender's sequence and two more."""
DOUBT_NS: Final = 1_000_000_000
"""Duration of the doubt after one frame out of place, and for which a successor has to be alone."""
_GRID_GAIN: Final = 0.25  # of a frame's lateness in the grid: slower than jitter, faster than drift
_DOUBTED_GAIN: Final = 0.0625  # five frames of another sender do not shift it
_JITTER_OVER: Final = 16  # frames of the mean distance from the grid
_JITTERS: Final = (
    5  # mean distances that a frame may be off the grid, where that is more than half a period …
)
_WIDEST_WINDOW: Final = 2  # … and at most so many periods

STREAM: Final = np.dtype(
    [
        ("grid_ns", "i8"),  # place of its last frame on its grid
        ("heard_ns", "i8"),  # stamp of its last frame
        ("since_ns", "i8"),  # stamp of its first frame
        ("counter", "i8"),
        ("frames", "i8"),  # in sequence, at most CONFIRMED; 0: there is no such stream
    ],
    align=True,
)
# Stored state of a message's counter between frames; wide types, since kernels compute with them
SEQUENCE: Final = [
    ("sender", STREAM),
    ("rival", STREAM),
    ("former", STREAM),  # the established sender before the present one
    ("expected_ns", "i8"),  # place of the last accepted frame on the grid before it
    ("disputed_ns", "i8"),  # stamp of the last frame whose place another one had taken
    ("doubted_ns", "i8"),  # stamp of the last reason to doubt the sender of accepted frames
    ("beside_ns", "i8"),  # stamp since which the sender has been alone
    ("contested_ns", "i8"),  # stamp since which a sender that is not established has had a rival; 0: none
    ("turns", "i8"),  # whole turns of the counter by which frames after a gap may be late
    ("regular_ns", "i8"),  # stamp of the last accepted frame that was on the grid
    ("lateness_ns", "i8"),  # of the last late frame
    ("late_run", "i8"),  # frames in a row that were as late
    ("late", "i8"),  # frames accepted that were late
    ("jitter_ns", "i8"),  # mean distance of frames from the grid
    ("established", "u1"),
    ("started", "u1"),
]


@kernel
def _lasts(reported_ns: int, stamp_ns: int) -> bool:
    """Return whether a report is still in force; 0: never made."""
    return reported_ns > 0 and stamp_ns - reported_ns < DOUBT_NS


@kernel
def in_doubt(state: Record, stamp_ns: int) -> bool:
    """Return whether accepted frames may have more than one sender: reported within the last second."""
    return _lasts(state.doubted_ns, stamp_ns)


@kernel
def rival_spoke(state: Record, stamp_ns: int) -> bool:
    """Return whether the frame just rejected, stamped so, is of an intact stream beside the sender's."""
    rival = state.rival
    beside: bool = rival.since_ns <= state.sender.heard_ns
    return beside and rival.frames == CONFIRMED and rival.heard_ns == stamp_ns


@kernel
def standing(state: Record, stamp_ns: int) -> Any:
    """Return the sender's standing beside a rival: ESTABLISHED, EQUAL or, after a second of that, UNKNOWN."""
    if state.established:
        return ESTABLISHED
    return EQUAL if _lasts(state.contested_ns, stamp_ns) else UNKNOWN


@kernel
def _lateness(stream: Record, counter: int, modulo: int, stamp_ns: int, period_ns: int) -> int:
    """Return how long after its next place on a stream's grid a frame comes; negative: before it."""
    late: int = stamp_ns - stream.grid_ns - (counter - stream.counter) % modulo * period_ns
    return late


@kernel
def _distance(stream: Record, counter: int, modulo: int, stamp_ns: int, period_ns: int) -> int:
    """Return the time between a frame and its nearest place on a stream's grid."""
    turn = modulo * period_ns
    late = _lateness(stream, counter, modulo, stamp_ns, period_ns) % turn
    return min(late, turn - late)


@kernel
def _hear(stream: Record, counter: int, stamp_ns: int, grid_ns: int) -> None:
    stream.counter, stream.heard_ns, stream.grid_ns = counter, stamp_ns, grid_ns


@kernel
def _begin(stream: Record, counter: int, stamp_ns: int) -> None:
    _hear(stream, counter, stamp_ns, stamp_ns)
    stream.since_ns, stream.frames = stamp_ns, 1


@kernel
def _copy(target: Record, stream: Record) -> None:
    _hear(target, stream.counter, stream.heard_ns, stream.grid_ns)
    target.since_ns, target.frames = stream.since_ns, stream.frames


@kernel
def _leave(state: Record, stamp_ns: int) -> None:
    """Keep an established sender's grid: the stream accepted from now on may be another one's."""
    if state.established:
        _copy(state.former, state.sender)
    state.established = 0
    state.beside_ns = stamp_ns


@kernel
def _establish(state: Record) -> None:
    state.established = 1
    state.contested_ns = state.former.frames = 0


@kernel
def _confirm_rival(
    state: Record, counter: int, modulo: int, stamp_ns: int, period_ns: int, slowest_ns: int
) -> bool:
    """Add a frame that is not the sender's to the rival; return whether it confirms that."""
    rival = state.rival
    lives = rival.frames > 0 and stamp_ns - rival.heard_ns <= LIVING * slowest_ns
    late = _lateness(rival, counter, modulo, stamp_ns, period_ns)
    if lives and counter != rival.counter and late >= -(period_ns // 2):
        on_grid = late <= period_ns // 2
        _hear(rival, counter, stamp_ns, stamp_ns - late + int(_GRID_GAIN * late) if on_grid else stamp_ns)
        rival.frames = min(rival.frames + 1, CONFIRMED)
        confirmed: bool = rival.frames == CONFIRMED
        return confirmed
    if not lives or rival.frames < CONFIRMED:
        _begin(rival, counter, stamp_ns)
    return False


@kernel
def _takes_over(
    state: Record, counter: int, modulo: int, stamp_ns: int, period_ns: int, slowest_ns: int
) -> bool:
    """Return whether the rival, confirmed by this frame, becomes the sender."""
    sender, rival, former = state.sender, state.rival, state.former
    silent = stamp_ns - sender.heard_ns
    beside = rival.since_ns <= sender.heard_ns
    known = former.frames > 0 and stamp_ns - former.heard_ns < DOUBT_NS
    if known and _distance(former, counter, modulo, stamp_ns, period_ns) <= period_ns // 2:
        _copy(former, sender)
        _copy(sender, rival)
        _copy(rival, former)
        rival.frames = CONFIRMED
        _establish(state)
    elif silent > LIVING * slowest_ns and (not beside or silent >= DOUBT_NS):
        _leave(state, stamp_ns)
        _copy(sender, rival)
        rival.frames = 0
    else:
        return False
    state.late_run = state.turns = 0
    state.expected_ns = state.regular_ns = stamp_ns
    return True


@kernel
def _reject(state: Record, counter: int, modulo: int, stamp_ns: int, period_ns: int, slowest_ns: int) -> Any:
    """Judge a frame that is not the sender's; accept it if its stream takes over."""
    sender = state.sender
    state.doubted_ns = stamp_ns
    found = WRONG_SEQUENCE
    behind = (sender.counter - counter) % modulo
    off = stamp_ns - (state.expected_ns - behind * period_ns)
    if abs(off) <= period_ns // 2:
        state.disputed_ns = stamp_ns  # another frame took its place
    if behind == 0:
        found = REPEATED
        if abs(off) <= period_ns // 2:
            found = CROSSED
            if abs(off) < abs(sender.heard_ns - state.expected_ns):
                _hear(sender, counter, stamp_ns, state.expected_ns + int(_DOUBTED_GAIN * off))
                return found
    if not _confirm_rival(state, counter, modulo, stamp_ns, period_ns, slowest_ns):
        return found
    if _takes_over(state, counter, modulo, stamp_ns, period_ns, slowest_ns):
        return RESYNCHRONISED
    state.beside_ns = stamp_ns
    if not state.established and state.contested_ns == 0:
        state.contested_ns = stamp_ns
    return found


@kernel
def _rival_lives(state: Record, stamp_ns: int, slowest_ns: int) -> bool:
    lives: bool = state.rival.frames == CONFIRMED and stamp_ns - state.rival.heard_ns <= LIVING * slowest_ns
    return lives


@kernel
def _is_rivals(state: Record, counter: int, modulo: int, stamp_ns: int, period_ns: int, off: int) -> bool:
    """Return whether a frame `off` the sender's grid is on the rival's and nearer to it."""
    distance = _distance(state.rival, counter, modulo, stamp_ns, period_ns)
    return off > period_ns // 4 and distance <= period_ns // 2 and distance < off


@kernel
def _has_shifted(state: Record, late: int, period_ns: int) -> bool:
    """Note a late frame; return whether so many were as late that the grid has shifted."""
    as_late = abs(late - state.lateness_ns) <= period_ns // 4
    state.late_run = state.late_run + 1 if as_late else 1
    state.lateness_ns = late
    shifted: bool = state.late_run > LIVING
    return shifted


@kernel
def _start(state: Record, counter: int, stamp_ns: int, period_ns: int, established: int) -> None:
    _begin(state.sender, counter, stamp_ns)
    state.rival.heard_ns, state.rival.frames, state.former.frames = stamp_ns, 0, 0
    state.expected_ns = state.regular_ns = state.beside_ns = stamp_ns
    state.disputed_ns = state.doubted_ns = state.contested_ns = 0
    state.late_run = state.turns = 0
    state.jitter_ns = period_ns // 2
    state.established, state.started = established, 1


@kernel
def check_counter(
    state: Record, counter: int, modulo: int, stamp_ns: int, period_ns: int, slowest_ns: int
) -> Any:
    """Judge a frame's counter and store it in `state` (fields of `SEQUENCE`); the first frame is accepted.

    Args:
        state: fields of `SEQUENCE`, overwritten.
        counter: of the frame.
        modulo: of the counter.
        stamp_ns: of the frame.
        period_ns: between two frames.
        slowest_ns: the longest period of a sender with a variable one; with it there is no grid.

    Returns IN_SEQUENCE, SOME_LOST or RESYNCHRONISED (accepted), REPEATED, WRONG_SEQUENCE or CROSSED: a second
    frame at the sequence position of the last accepted one (rejected).
    """
    if counter >= modulo:
        return WRONG_SEQUENCE
    sender = state.sender
    since = stamp_ns - sender.heard_ns
    if not state.started or since < -period_ns:  # the clock was set back
        _start(state, counter, stamp_ns, period_ns, 1)
        return IN_SEQUENCE
    silence = min(since, stamp_ns - state.rival.heard_ns)
    if silence > DOUBT_NS + LIVING * slowest_ns:
        _start(state, counter, stamp_ns, period_ns, 0)
        return RESYNCHRONISED
    has_grid = slowest_ns == period_ns
    beside = has_grid and _rival_lives(state, stamp_ns, slowest_ns)
    if not has_grid:
        tolerance = period_ns  # the frame before may have been the late one
    elif _lasts(state.disputed_ns, stamp_ns):
        tolerance = period_ns // 4
    else:
        tolerance = min(max(period_ns // 2, _JITTERS * state.jitter_ns), _WIDEST_WINDOW * period_ns)
    step = (counter - sender.counter) % modulo
    late, turn = _lateness(sender, counter, modulo, stamp_ns, period_ns), modulo * period_ns
    if late >= turn - period_ns // 2:
        if silence > LIVING * slowest_ns or beside:
            step = step or modulo
        if has_grid:
            state.turns = (late + period_ns // 2) // turn
            late -= state.turns * turn
    elif -turn <= late < -tolerance and state.turns > 0:
        state.turns -= 1
        late += turn
    rivals = beside and _is_rivals(state, counter, modulo, stamp_ns, period_ns, abs(late))
    if step == 0 or late < -tolerance or rivals:
        return _reject(state, counter, modulo, stamp_ns, period_ns, slowest_ns)
    if not state.established and stamp_ns - state.beside_ns >= DOUBT_NS:
        _establish(state)
    state.expected_ns = grid_ns = stamp_ns - late if has_grid else stamp_ns
    if late - step * (slowest_ns - period_ns) > max(tolerance, period_ns // 2):
        state.late += 1
        state.doubted_ns = stamp_ns
        if _has_shifted(state, late, period_ns):
            grid_ns, state.late_run = stamp_ns, 0
            if not beside or state.rival.since_ns > state.regular_ns:  # else the other one is known
                _leave(state, stamp_ns)
    else:
        state.late_run, state.regular_ns = 0, stamp_ns
        if period_ns * 3 // 4 < since <= LIVING * slowest_ns and abs(late) <= period_ns // 4:
            state.turns = 0  # regular again
        if has_grid:
            gain = _DOUBTED_GAIN if in_doubt(state, stamp_ns) else _GRID_GAIN
            grid_ns += int(gain * late)
            state.jitter_ns += (abs(late) - state.jitter_ns) // _JITTER_OVER
            if abs(late) > period_ns // 4:
                state.doubted_ns = stamp_ns
    _hear(sender, counter, stamp_ns, grid_ns)
    return IN_SEQUENCE if step == 1 else SOME_LOST
