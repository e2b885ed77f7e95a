"""The E2E state machine beside a plain model of AUTOSAR's description, and when a stream is loud."""

from collections import Counter, deque
from itertools import chain
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ecu.bus.link import (
    INIT,
    INVALID,
    LINK,
    NODATA,
    P_ERROR,
    P_NONEWDATA,
    P_OK,
    P_REPEATED,
    P_WRONG_SEQUENCE,
    VALID,
    add_check,
    judge_link,
)

MS = 1_000_000
PERIOD = 10 * MS
NAMES = {NODATA: "NODATA", INIT: "INIT", VALID: "VALID", INVALID: "INVALID"}
STATUS = {
    P_OK: "OK",
    P_ERROR: "ERROR",
    P_REPEATED: "REPEATED",
    P_WRONG_SEQUENCE: "WRONGSEQUENCE",
    P_NONEWDATA: "NONEWDATA",
}


class Model:
    """E2E_SMCheckInit and E2E_SMCheck of PRS E2E Protocol, the window as a list of names."""

    window_size, min_ok, max_error, min_ok_invalid, max_error_invalid = 16, 9, 5, 12, 2

    def __init__(self) -> None:
        self.state = "NODATA"
        self.window = deque(["NOTAVAILABLE"] * self.window_size, maxlen=self.window_size)

    def check(self, status: str) -> str:
        if self.state == "NODATA" and status in ("ERROR", "NONEWDATA"):
            return self.state
        self.window.append(status)
        count = Counter(self.window)
        good = count["OK"] >= self.min_ok and count["ERROR"] <= self.max_error
        if self.state == "NODATA":
            self.state = "INIT"
        elif self.state == "INIT":
            if count["ERROR"] > self.max_error:
                self.state = "INVALID"
            elif good:
                self.state = "VALID"
        elif self.state == "VALID":
            self.state = "VALID" if good else "INVALID"
        elif count["OK"] >= self.min_ok_invalid and count["ERROR"] <= self.max_error_invalid:
            self.state = "VALID"
        return self.state


def new_link() -> Any:
    return np.zeros(1, np.dtype(LINK, align=True))[0]


# Mostly good, mostly bad and mixed stretches: uniform draws would hardly ever be VALID.
STRETCH = st.one_of(
    st.lists(st.just(P_OK), min_size=5, max_size=20),
    st.lists(st.sampled_from([P_OK, P_OK, P_OK, *STATUS]), max_size=30),
    st.lists(st.sampled_from([P_ERROR, P_OK]), max_size=20),
    st.lists(st.sampled_from(list(STATUS)), max_size=20),
)


@given(stretches=st.lists(STRETCH, max_size=8))
@pytest.mark.requirement("REQ-E2E-6")
def test_machine_beside_the_description(stretches: list[list[int]]) -> None:
    state, model = new_link(), Model()
    for status in chain.from_iterable(stretches):
        add_check(state, status)
        assert NAMES[int(state["link"])] == model.check(STATUS[status])
        assert state["ok_count"] == Counter(model.window)["OK"]
        assert state["error_count"] == Counter(model.window)["ERROR"]


G, E, R, W, N = P_OK, P_ERROR, P_REPEATED, P_WRONG_SEQUENCE, P_NONEWDATA
# Checks, and the state behind the last of them.
HISTORIES = {
    "nothing came": ([N] * 20, NODATA),
    "nothing intact came": ([E] * 20, NODATA),
    "the first frame": ([G], INIT),
    "a first frame that is repeated": ([R], INIT),
    "eight good ones": ([G] * 8, INIT),
    "nine good ones": ([G] * 9, VALID),
    "five errors beside the start": ([G] + [E] * 5 + [G] * 8, VALID),
    "six errors beside the start": ([G] + [E] * 6, INVALID),
    "five errors of sixteen": ([G] * 16 + [E] * 5, VALID),
    "six errors of sixteen": ([G] * 16 + [E] * 6, INVALID),
    "errors long ago": ([G] * 9 + [E] * 5 + [G] * 16 + [E] * 5, VALID),
    "seven missing of sixteen": ([G] * 16 + [N] * 7, VALID),
    "eight missing of sixteen": ([G] * 16 + [N] * 8, INVALID),
    "eight out of sequence": ([G] * 16 + [W] * 8, INVALID),
    "back with twelve of sixteen": ([G] * 16 + [N] * 8 + [G] * 12, VALID),
    "not with eleven": ([G] * 16 + [N] * 16 + [G] * 11, INVALID),
    "two errors among them": ([G] * 16 + [N] * 16 + [E] * 2 + [G] * 12, VALID),
    "three errors among them": ([G] * 16 + [N] * 16 + [E] * 3 + [G] * 12, INVALID),
}


@pytest.mark.parametrize("name", HISTORIES)
def test_states(name: str) -> None:
    checks, expected = HISTORIES[name]
    state = new_link()
    for status in checks:
        add_check(state, status)
    assert NAMES[int(state["link"])] == NAMES[expected]


def loud_after(intervals_ms: list[float], statuses: list[int], period_ms: float = 10.0) -> float | None:
    """Milliseconds until frames with these intervals and checks are loud, None: not in 60 s."""
    state, t = new_link(), 1000.0
    period = int(period_ms * MS)
    for k in range(200):
        assert not judge_link(state, P_OK, int((t + k * period_ms) * MS), period, period)
    t = start = t + 200 * period_ms
    k = 0
    while t - start < 60_000.0:
        if judge_link(state, statuses[k % len(statuses)], int(t * MS), period, period):
            assert state["reported_ns"] == int(t * MS)
            return t - start
        t += intervals_ms[k % len(intervals_ms)]
        k += 1
    return None


@pytest.mark.parametrize(
    ("what", "intervals", "statuses", "low", "high"),
    [
        ("as it should be", [10.0], [G], None, None),
        ("a clock 20 % fast", [8.0], [G], None, None),
        ("one frame in twenty spoilt", [10.0], [E] + [G] * 19, None, None),
        ("a restart: six frames not taken", [10.0], [W] * 6 + [G] * 50, None, None),
        ("150 ms held up, then all at once", [150.0] + [0.2] * 15 + [10.0] * 50, [G], None, None),
        ("300 ms held up, then all at once", [300.0] + [0.2] * 30 + [10.0] * 50, [G], None, None),
        ("300 ms held up, then more than that", [300.0] + [0.2] * 40 + [10.0] * 50, [G], 300.0, 320.0),
        ("a second stream of the same rate", [5.0, 5.0], [G, W], 50.0, 160.0),
        ("a second stream of half the rate", [5.0, 5.0, 10.0], [G, W, G], 200.0, 700.0),
        ("frames of another identity all the time", [1.0], [E], 5.0, 20.0),
        ("every second frame spoilt", [10.0], [E, G], 100.0, 200.0),
        ("a burst that does not end", [0.25], [W], 1.0, 10.0),
    ],
)
@pytest.mark.requirement("REQ-E2E-6")
def test_when_a_stream_is_loud(
    what: str, intervals: list[float], statuses: list[int], low: float | None, high: float | None
) -> None:
    after = loud_after(intervals, statuses)
    if low is None or high is None:
        assert after is None, f"{what}: reported after {after} ms"
    else:
        assert after is not None, what
        assert low <= after <= high, f"{what}: reported after {after} ms"


def test_a_period_without_a_frame_is_a_check() -> None:
    state = new_link()
    for k in range(30):
        judge_link(state, P_OK, (1000 + 10 * k) * MS, PERIOD, PERIOD)
    assert (NAMES[int(state["link"])], state["ok_count"]) == ("VALID", 16)
    judge_link(state, P_OK, (1290 + 60) * MS, PERIOD, PERIOD)
    assert state["ok_count"] == 11, "five periods of silence"
    judge_link(state, P_OK, (1350 + 10_000) * MS, PERIOD, PERIOD)
    assert (NAMES[int(state["link"])], state["ok_count"]) == ("INVALID", 1)


def test_a_sender_that_may_choose_is_silent_only_behind_its_slowest_rate() -> None:
    state = new_link()
    for k in range(30):
        judge_link(state, P_OK, (1000 + 100 * k) * MS, PERIOD, 10 * PERIOD)
    assert (NAMES[int(state["link"])], state["ok_count"]) == ("VALID", 16)


@pytest.mark.parametrize(
    ("periods", "silent"), [(1.4, 0), (1.45, 0), (1.5, 1), (1.55, 1), (2.4, 1), (2.6, 2)]
)
def test_silence_is_counted_in_whole_periods(periods: float, silent: int) -> None:
    state = new_link()
    for k in range(30):
        judge_link(state, P_OK, (1000 + 10 * k) * MS, PERIOD, PERIOD)
    judge_link(state, P_OK, 1290 * MS + int(periods * PERIOD), PERIOD, PERIOD)
    assert state["ok_count"] == 16 - silent


@pytest.mark.parametrize(
    ("silent_ms", "frames"), [(10, 16), (14.9, 16), (15.1, 16), (25, 17), (100, 25), (170, 32), (10_000, 32)]
)
def test_as_many_periods_as_were_missed_may_be_caught_up(silent_ms: float, frames: int) -> None:
    """Sixteen at most, beside the sixteen of a crowd."""
    state, t = new_link(), 1000.0
    for k in range(50):
        judge_link(state, P_OK, int((t + 10 * k) * MS), PERIOD, PERIOD)
    t += 490 + silent_ms
    loud = [bool(judge_link(state, P_OK, int(t * MS), PERIOD, PERIOD)) for _ in range(50)]
    assert loud.index(True) == frames


@pytest.mark.parametrize(("periods", "crowd"), [(1.0, 1.0), (1.25, 1.0), (1.45, 1.0), (1.5, 0.5), (2.0, 0.0)])
def test_a_period_counts_as_missed_from_its_half_on(periods: float, crowd: float) -> None:
    state = new_link()
    for k in range(50):
        judge_link(state, P_OK, (1000 + 10 * k) * MS, PERIOD, PERIOD)
    judge_link(state, P_OK, 1490 * MS + int(periods * PERIOD), PERIOD, PERIOD)
    assert state["crowd"] == pytest.approx(crowd)


def test_a_pause_that_is_not_caught_up_is_forgotten_frame_by_frame() -> None:
    state = new_link()
    for k in range(50):
        judge_link(state, P_OK, (1000 + 10 * k) * MS, PERIOD, PERIOD)
    for k in range(20):
        judge_link(state, P_OK, (1600 + 10 * k) * MS, PERIOD, PERIOD)
    assert state["crowd"] == 1.0


def test_errors_alone_are_no_crowd_at_the_senders_rate() -> None:
    state = new_link()
    assert not any(judge_link(state, P_ERROR, (1000 + 10 * k) * MS, PERIOD, PERIOD) for k in range(100))


def test_the_seventeenth_frame_of_a_crowd_is_reported_and_four_more_at_its_rate() -> None:
    """Beyond 16 periods; it empties by 1.25 a period, and each frame adds one."""
    state = new_link()
    loud = [bool(judge_link(state, P_OK, 1000 * MS, PERIOD, PERIOD)) for _ in range(100)]
    assert loud == [False] * 16 + [True] * 84
    after = [bool(judge_link(state, P_OK, (1010 + 10 * k) * MS, PERIOD, PERIOD)) for k in range(8)]
    assert after == [True] * 3 + [False] * 5
    assert state["reported_ns"] == 1030 * MS
