"""Signals of different rates and ages at one common time: on straight lines nothing may be lost."""

import numpy as np
import pytest

from ecu.algorithm.estimation.joint.sampling import (
    ACCEL,
    CHANNELS,
    LEAST_ADVANCE_S,
    OLDEST_S,
    SAMPLING_STATE,
    accelerate_by_speed,
    add_sample,
    add_speed,
    advance_common_time,
    at_common_time,
    close_sampling,
    open_sampling,
    slope,
)

DT = 0.005
WINDOW = 10  # cycles
START = np.array([10.0, 12.0, 8.0, 9.0, -1.0])
RAMP = np.array([40.0, -25.0, 30.0, 0.0, -6.0])  # per second
CAR = {
    # samples per second of four pressures and acceleration, and their ages [s]
    "all in every cycle": ([200.0] * 5, [0.0] * 5),
    "pressures of 100, acceleration of 50 Hz": ([100.0] * 4 + [50.0], [0.0] * 5),
    "pressures of 20, acceleration of 200 Hz": ([20.0] * 4 + [200.0], [0.0] * 5),
    "pressures of 5, acceleration of 100 Hz": ([5.0] * 4 + [100.0], [0.0] * 5),
    "every signal its own": ([5.0, 10.0, 20.0, 50.0, 200.0], [0.0] * 5),
    "old pressures": ([50.0] * 4 + [100.0], [0.04, 0.03, 0.02, 0.0, 0.003]),
}


def drive(rates, ages, seconds: float, signals=None, stop: int | None = None):
    """Return rows (now, common time, values there) of the windows with something new.

    `signals` gives all channels at a time [s], straight lines by default; `stop`: a channel without samples
    after half of the drive.
    """
    state, rows = np.zeros(1, SAMPLING_STATE)[0], []
    signals = signals or (lambda time: START + RAMP * time)
    every = np.round(1 / (np.array(rates) * DT)).astype(int)
    cycles = round(seconds / DT)
    for k in range(1, cycles + 1):
        if k % WINDOW == 1:
            open_sampling(state)
        state["now"] += DT
        for i in range(CHANNELS):
            if k % every[i] == 0 and not (i == stop and k > cycles / 2):
                add_sample(state, i, signals(k * DT - ages[i])[i], ages[i])
        if k % WINDOW == 0:
            close_sampling(state)
            if advance_common_time(state):
                values = [at_common_time(state, i) for i in range(CHANNELS)]
                rows.append((k * DT, float(state["common"]), np.array(values)))
    return state, rows


@pytest.mark.parametrize("name", CAR)
def test_on_straight_lines_every_signal_is_exact_at_the_common_time(name: str) -> None:
    rates, ages = CAR[name]
    _, rows = drive(rates, ages, 4.0)
    late = [row for row in rows if row[0] > 2.5 / min(rates)]  # two samples of each
    assert len(late) > 0.8 * min(min(rates), 1 / (WINDOW * DT)) * (4.0 - 2.5 / min(rates))
    for _, common, values in late:
        np.testing.assert_allclose(values, START + RAMP * common, atol=1e-9)


@pytest.mark.parametrize("name", CAR)
def test_the_common_time_advances_and_is_never_ahead_of_a_signal(name: str) -> None:
    rates, ages = CAR[name]
    _, rows = drive(rates, ages, 4.0)
    now, common = np.array([row[0] for row in rows]), np.array([row[1] for row in rows])
    assert (np.diff(common) >= LEAST_ADVANCE_S - 1e-9).all()
    newest = now - max(ages)
    assert (common <= newest + 1e-9).all()
    assert (now - common <= max(ages) + 1 / min(rates) + WINDOW * DT).all()


def test_where_all_come_in_every_cycle_it_is_the_middle_of_the_window() -> None:
    _, rows = drive([200.0] * 5, [0.0] * 5, 1.0)
    middle = [now - 0.5 * (WINDOW - 1) * DT for now, _, _ in rows]
    np.testing.assert_allclose([row[1] for row in rows], middle, rtol=1e-9)


def test_nothing_is_extrapolated() -> None:
    """Between its last two means a signal stays between them, whatever it does."""
    random = np.random.default_rng(1)
    rough = random.standard_normal((2000, CHANNELS))
    _, rows = drive([20.0, 50.0, 100.0, 200.0, 200.0], [0.0] * 5, 9.0, lambda time: rough[round(time / DT)])
    assert max(np.abs(values).max() for _, _, values in rows) <= np.abs(rough).max()


@pytest.mark.parametrize("lost", [0, ACCEL])
def test_with_a_signal_lost_nothing_is_new(lost: int) -> None:
    _, rows = drive([100.0] * 5, [0.0] * 5, 4.0, stop=lost)
    assert rows[-1][0] == pytest.approx(2.0, abs=WINDOW * DT)


def test_a_signal_older_than_half_a_second_is_set_against_nothing() -> None:
    _, rows = drive([100.0] * 5, [0.0, 0.0, OLDEST_S + 0.01, 0.0, 0.0], 2.0)
    assert not rows


def test_a_gap_is_not_bridged_by_a_line() -> None:
    """Two means farther apart than half a second say nothing of how it went in between."""
    state = np.zeros(1, SAMPLING_STATE)[0]
    for now, value in [(0.0, 10.0), (OLDEST_S + 0.05, 40.0)]:
        state["now"] = now
        open_sampling(state)
        add_sample(state, 2, value, 0.0)
        close_sampling(state)
    assert slope(state, 2) == 0.0


def test_a_window_without_samples_keeps_the_last_mean() -> None:
    state = np.zeros(1, SAMPLING_STATE)[0]
    for values in [(3.0, 5.0), ()]:
        open_sampling(state)
        for value in values:
            state["now"] += DT
            add_sample(state, 1, value, 0.0)
        close_sampling(state)
    assert (state["value"][1], state["samples"][1]) == (4.0, 2)
    assert state["at"][1] == pytest.approx(1.5 * DT)


@pytest.mark.parametrize(
    ("rate", "age", "step"), [(100.0, 0.0, 0.0), (20.0, 0.2, 1 / 3.6), (10.0, 0.0, 0.0), (3.0, 0.1, 0.0)]
)
def test_the_change_of_speed_stands_for_an_accelerometer(rate: float, age: float, step: float) -> None:
    """v = 30 - t^2: of a(t) = -2 t nothing is lost at its time, of a speed in steps nothing in the mean."""
    state, rows, every = np.zeros(1, SAMPLING_STATE)[0], [], round(1.0 / (rate * DT))
    for k in range(1, round(4.0 / DT) + 1):
        if k % WINDOW == 1:
            open_sampling(state)
        state["now"] += DT
        if k % every == 0:
            speed = 30.0 - (k * DT - age) ** 2
            add_speed(state, round(speed / step) * step if step else speed, age)
        if k % WINDOW == 0:
            accelerate_by_speed(state)
            rows.append((state["count"][ACCEL], state["sum"][ACCEL], state["sum_at"][ACCEL]))
            close_sampling(state)
    count, accel, at = np.array([row for row in rows if row[0]][1:]).T
    assert (count == 1).all()
    error = accel + 2.0 * at
    assert abs(error.mean()) < 0.1
    assert step or np.abs(error).max() < 1e-6
    assert len(at) > 0.8 * min(rate, 20.0) * 4.0 - 3
