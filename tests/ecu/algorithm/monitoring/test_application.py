"""Brake applications: start, end, and the noise of the pressure sensors (Table 4.1: 1.8 bar)."""

import numpy as np
import pytest

from ecu.algorithm.monitoring.application import APPLICATION_STATE, update_application
from ecu.contract.signals import CALLIPER_PRESSURE

PUSH_OUT = 0.5  # bar, config/suv.toml
DT = 0.01
SIGMA = 1.8  # bar


class Brake:
    """Runs the detector on pressures [bar]."""

    def __init__(self, params, feed) -> None:
        self.params, self.feed, self.inputs = params[0], feed, feed()
        self.state, self.zero = np.zeros(1, APPLICATION_STATE)[0], np.zeros(4)

    def hold(self, pressure, seconds: float, every: int = 1) -> list[tuple[bool, bool, bool]]:
        """Return (braking, started, ended) of each cycle; a sample arrives `every` so many."""
        rows = []
        for k in range(round(seconds / DT)):
            self.inputs["new"] = k % every == 0
            if k % every == 0:
                self.feed(self.inputs, calliper_pressure=pressure() if callable(pressure) else pressure)
            update_application(self.params, self.state, self.inputs[0], self.zero, DT)
            rows.append(tuple(bool(self.state[k]) for k in ("braking", "started", "ended")))
        return rows


@pytest.fixture
def brake(params, feed) -> Brake:
    return Brake(params, feed)


def first(rows, column: int) -> int | None:
    return next((k for k, row in enumerate(rows) if row[column]), None)


@pytest.mark.parametrize(
    ("case", "pressure", "starts"),
    [
        ("none", 0.0, False),
        ("just below 1 bar above push-out", PUSH_OUT + 0.99, False),
        ("just above", PUSH_OUT + 1.05, True),
        ("firm", 40.0, True),
        ("one wheel alone", [0.0, 0.0, 0.0, 20.0], True),
    ],
)
def test_what_is_an_application(brake: Brake, case, pressure, starts) -> None:
    brake.hold(0.0, 1.0)
    rows = brake.hold(pressure, 1.0)
    assert rows[-1][0] == starts, case
    assert sum(row[1] for row in rows) == starts, case


@pytest.mark.parametrize("zero", [-2.0, 2.0])
def test_a_pressure_counts_from_the_zero_of_its_sensor(brake: Brake, zero: float) -> None:
    brake.zero[:] = zero
    assert not any(row[0] for row in brake.hold(zero + PUSH_OUT + 0.99, 1.0))
    assert brake.hold(zero + PUSH_OUT + 1.05, 1.0)[-1][0]


def test_it_starts_a_tenth_of_a_second_after_a_firm_pressure(brake: Brake) -> None:
    brake.hold(0.0, 1.0)
    start = first(brake.hold(40.0, 1.0), 1)
    assert start is not None
    assert 8 <= start <= 16  # a filter may add a few cycles


@pytest.mark.parametrize("peak", [3.0, 10.0])
def test_a_short_peak_is_none(brake: Brake, peak: float) -> None:
    brake.hold(0.0, 1.0)
    assert not any(row[0] for row in brake.hold(peak, 0.04) + brake.hold(0.0, 1.0))


def test_it_ends_once_a_tenth_of_a_second_after_the_last_wheel_is_free(brake: Brake) -> None:
    brake.hold(40.0, 2.0)
    assert brake.hold([0.0, 0.0, 0.0, 10.0], 1.0)[-1][0]
    rows = brake.hold(0.0, 2.0)
    end = first(rows, 2)
    assert end is not None
    assert 8 <= end <= 60  # a filter has to fall first
    assert sum(row[2] for row in rows) == 1
    assert not any(row[0] for row in rows[end:])


def test_a_second_application_is_a_second_one(brake: Brake) -> None:
    rows = []
    for _ in range(3):
        rows += brake.hold(30.0, 1.0) + brake.hold(0.0, 1.0)
    assert sum(row[1] for row in rows) == sum(row[2] for row in rows) == 3


@pytest.mark.parametrize("rest", [0.0, PUSH_OUT])
def test_sensor_noise_at_rest_starts_none(brake: Brake, rest: float) -> None:
    random = np.random.default_rng(1)
    rows = brake.hold(lambda: rest + SIGMA * random.standard_normal(4), 300.0)
    print(f"rest at {rest} bar: {sum(r[1] for r in rows)} starts in 300 s")
    assert not any(row[1] for row in rows)


@pytest.mark.parametrize(("every", "sigma", "most"), [(5, 0.8, 0), (10, 0.8, 0), (5, 1.1, 3)])
def test_noise_of_a_slow_sensor_starts_hardly_one(brake: Brake, every: int, sigma: float, most: int) -> None:
    """A held sample is no second one: counted as such, 0.8 bar at 20 Hz would start 250."""
    random = np.random.default_rng(1)
    rows = brake.hold(lambda: PUSH_OUT + sigma * random.standard_normal(4), 300.0, every)
    starts = sum(row[1] for row in rows)
    print(f"a sample every {every} cycles, {sigma} bar: {starts} starts in 300 s")
    assert starts <= most


@pytest.mark.parametrize(("every", "pressure", "latest"), [(5, 13.0, 0.15), (10, 13.0, 0.2), (10, 4.0, 0.4)])
def test_a_slow_sensor_shows_a_braking(brake: Brake, every: int, pressure: float, latest: float) -> None:
    brake.hold(0.0, 1.0, every)
    start = first(brake.hold(pressure, 1.0, every), 1)
    assert start is not None
    assert start * DT <= latest


@pytest.mark.parametrize("rest", [0.0, PUSH_OUT])
def test_an_application_ends_soon_after_release_in_spite_of_noise(params, feed, rest: float) -> None:
    ends = []
    for seed in range(20):
        random = np.random.default_rng(seed)
        brake = Brake(params, feed)
        brake.hold(lambda random=random: 40.0 + SIGMA * random.standard_normal(4), 1.0)
        ends.append(first(brake.hold(lambda random=random: rest + SIGMA * random.standard_normal(4), 5.0), 2))
    late = [e for e in ends if e is None or e > 150]
    print(f"rest at {rest} bar: cycles until the end {ends}")
    assert not late


def test_noise_does_not_break_an_application(params, feed) -> None:
    """4 bar, a gentle braking, stays one application of 10 s."""
    for seed in range(5):
        random = np.random.default_rng(seed)
        brake = Brake(params, feed)
        rows = brake.hold(lambda random=random: 4.0 + SIGMA * random.standard_normal(4), 10.0)
        assert sum(row[1] for row in rows) == 1
        assert sum(row[2] for row in rows) == 0


def test_a_pressure_that_is_lost_while_braked_does_not_hold_the_application(brake: Brake) -> None:
    brake.hold(40.0, 1.0)
    brake.inputs[0]["verdict"][CALLIPER_PRESSURE] = 0
    rows = brake.hold([40.0, 0.0, 0.0, 0.0], 2.0)
    assert sum(row[2] for row in rows) == 1
