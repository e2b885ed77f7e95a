"""The zero of a pressure sensor that cannot report less than zero, against scipy's normal distribution."""

import math

import numpy as np
import pytest
from scipy.stats import norm, truncnorm

from ecu.algorithm.estimation.zero import (
    LEAST_SHARE,
    LEAST_SIGMA,
    LIMIT,
    NEARLY_ALL,
    START,
    UNKNOWN,
    ZERO_STATE,
    floored_zero,
    note_rest,
    quantile,
    settle_zero,
)
from ecu.jit import kernel


def settled(readings: np.ndarray, wheel: int = 0):
    """Return `ZERO_STATE` after readings [bar] at rest of one wheel."""
    state = np.zeros(1, ZERO_STATE)[0]
    note_rests(state, wheel, np.asarray(readings, float))
    settle_zero(state, wheel)
    return state


@kernel
def note_rests(state, wheel, readings):
    for reading in readings:
        note_rest(state, wheel, reading)


def known(count: int) -> float:
    """Return by how much a zero is drawn to nothing: as though `START` readings of zero had come first."""
    return count / (count + START)


def test_a_quantile_is_that_of_the_normal_distribution() -> None:
    shares = np.concatenate([np.geomspace(1e-6, 0.5, 100), 1 - np.geomspace(1e-6, 0.5, 100)])
    assert [quantile(share) for share in shares] == pytest.approx(norm.ppf(shares), abs=5e-4)


FLOORED = [
    # zero and noise [bar]
    (0.0, 1.8),
    (0.5, 1.8),
    (-1.0, 1.8),
    (-2.0, 1.8),
    (0.3, 0.3),
    (-0.3, 0.3),
    (1.5, 1.0),
]


@pytest.mark.parametrize(("zero", "sigma"), FLOORED)
def test_zero_and_noise_come_back_from_mean_and_share_at_the_floor(zero: float, sigma: float) -> None:
    """The mean is that of a normal variable truncated at zero, times the share above it."""
    at_floor = norm.cdf(-zero / sigma)
    above = truncnorm.mean(-zero / sigma, math.inf, loc=zero, scale=sigma)
    got = floored_zero((1 - at_floor) * above, at_floor)
    assert got == pytest.approx((zero, sigma), abs=2e-3 * sigma)


def test_the_mean_of_a_floored_sensor_at_rest_is_not_its_zero() -> None:
    """With 1.8 bar of noise (Table 4.1) it is 0.7 bar."""
    assert 0.5 * truncnorm.mean(0.0, math.inf, scale=1.8) == pytest.approx(0.72, abs=0.01)
    assert floored_zero(1.8 / math.sqrt(2 * math.pi), 0.5) == pytest.approx((0.0, 1.8), abs=1e-3)


AT_REST = [
    # zero and noise [bar], floored
    (0.0, 0.9, True),
    (0.25, 0.9, True),
    (-0.5, 0.9, True),
    (-1.0, 0.9, True),
    (0.15, 0.15, True),
    (-0.15, 0.15, True),
    (0.0, 0.9, False),
    (0.25, 0.9, False),
    (-0.5, 0.9, False),
    (0.15, 0.15, False),
    (0.0, 1.8, False),
    (-0.5, 1.8, True),
    (0.0, 1.8, True),
    (1.0, 1.8, True),
    (1.0, 1.8, False),
    (-1.0, 1.8, False),
]


@pytest.mark.parametrize(("zero", "sigma", "floored"), AT_REST)
def test_noise_at_rest_gives_the_true_zero_as_well_as_it_says(
    zero: float, sigma: float, floored: bool
) -> None:
    """A minute at 100 Hz, many seeds."""
    errors, said = [], []
    for seed in range(30):
        readings = zero + sigma * np.random.default_rng(seed).standard_normal(6000)
        state = settled(np.maximum(readings, 0.0) if floored else readings)
        errors.append(state["value"][0] / known(6000) - zero)
        said.append(math.sqrt(state["variance"][0]))
    rms = float(np.sqrt(np.mean(np.square(errors))))
    print(f"{zero} bar, noise {sigma} bar: {np.mean(errors):+.3f}, rms {rms:.3f}, said {np.mean(said):.3f}")
    assert abs(np.mean(errors)) < 0.02
    assert rms < np.mean(said)


@pytest.mark.parametrize("count", [1, 20, 100, 1000])
def test_a_zero_is_drawn_to_nothing_by_few_readings(count: int) -> None:
    readings = -0.8 + 0.1 * np.random.default_rng(3).standard_normal(count)
    state = settled(readings, wheel=2)
    share = known(count)
    assert state["value"] == pytest.approx([0.0, 0.0, share * readings.mean(), 0.0])
    spread = readings.var() / count + ((1 - share) * UNKNOWN) ** 2 + LEAST_SIGMA**2
    assert state["variance"][2] == pytest.approx(spread)


AT_THE_FLOOR = [
    # share of the readings that are zero, the others 0.1 bar; its zero is taken for unknown, below nothing
    ("all", 1.0, True),
    ("nearly all", 0.5 * (1 + NEARLY_ALL), True),
    ("many", 0.9, False),
    ("few", 0.5 * LEAST_SHARE, False),
]


@pytest.mark.parametrize(("name", "share", "unknown"), AT_THE_FLOOR, ids=[row[0] for row in AT_THE_FLOOR])
def test_where_nearly_all_readings_are_zero_little_is_known(name: str, share: float, unknown: bool) -> None:
    readings = np.where(np.arange(2000) < share * 2000, 0.0, 0.1)
    state = settled(readings)
    assert (state["value"][0] == -UNKNOWN) == unknown
    assert (state["variance"][0] == UNKNOWN**2) == unknown
    if name == "few":  # not cut off: its zero is its mean
        assert state["value"][0] == pytest.approx(known(2000) * readings.mean())


def test_a_zero_is_never_far_below_what_nothing_tells() -> None:
    readings = np.where(np.arange(2000) < 0.96 * 2000, 0.0, 2.5)
    assert settled(readings)["value"][0] == pytest.approx(-2 * UNKNOWN * known(2000))


@pytest.mark.parametrize("reading", [LIMIT, -LIMIT, 1.01 * LIMIT, 60.0, math.inf, math.nan])
def test_a_reading_too_far_from_zero_is_not_a_zero(reading: float) -> None:
    state = np.zeros(1, ZERO_STATE)[0]
    note_rest(state, 1, reading)
    assert state.tobytes() == np.zeros(1, ZERO_STATE)[0].tobytes()


@pytest.mark.parametrize("zero", [-0.5, 0.0, 0.3])
def test_a_sensor_of_coarse_steps_that_reads_below_zero_is_not_cut_off(zero: float) -> None:
    """It reads zero often too, but its zero is its mean."""
    readings = 0.5 * np.round((zero + 0.5 * np.random.default_rng(1).standard_normal(6000)) / 0.5)
    assert (readings == 0.0).mean() > 2 * LEAST_SHARE
    assert settled(readings)["value"][0] == pytest.approx(known(6000) * readings.mean())
