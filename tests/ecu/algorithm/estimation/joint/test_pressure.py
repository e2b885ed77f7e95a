"""The followed pressure against hydraulics of second order with a dead time (A.17, A.18), solved by scipy."""

import math

import numpy as np
import pytest
from scipy.signal import lsim

from ecu.algorithm.brake import correct_pressure
from ecu.algorithm.estimation.joint.pressure import (
    AGREED_S,
    DEAD_CYCLES,
    LAG,
    PRESSURE_STATE,
    follow_demand,
    follows,
)

DT = 0.01
SIGMA = 1.8  # bar, Table 4.1
BUILD_UP = (0.00075, 0.037, 0.026)  # T2 [s^2], T1 [s], dead time [s] (A.17)
RELEASE = (0.00021, 0.045, 0.015)  # (A.18)
SENT = DT  # a demand is known here in the cycle after it was sent
RAMPS = {
    # time [s] and pressure [bar] at the corners of the demand
    "gentle": (BUILD_UP, [0, 1, 2, 4], [0, 0, 30, 30]),
    "brisk": (BUILD_UP, [0, 1, 1.3, 4], [0, 0, 60, 60]),
    "in two steps": (BUILD_UP, [0, 0.5, 0.7, 2, 2.2, 4], [0, 0, 25, 25, 50, 50]),
    "release": (RELEASE, [0, 1.5, 2.2, 4], [60, 60, 20, 20]),
}


def hydraulics(kind, demand: np.ndarray) -> np.ndarray:
    """Return the pressure [bar] at the cycles, by a demand handed in then and sent the cycle before."""
    second, first, dead = kind
    fine = np.arange(0, len(demand) * DT, DT / 10)
    held = demand[np.clip(((fine - dead + SENT) / DT + 1e-9).astype(int), 0, len(demand) - 1)]
    system = ([1.0], [second, first, 1.0])
    _, out, _ = lsim(system, held - held[0], fine)
    return (out + held[0])[::10]


def follow(demand: np.ndarray, pressure: np.ndarray, seed: int):
    """Return value, variance, whether it follows and the raw sample, after each cycle."""
    state, random, rows = np.zeros(1, PRESSURE_STATE)[0], np.random.default_rng(seed), []
    state["demand"], state["model"][0], state["value"][0] = demand[0], demand[0], demand[0]
    for target, truth in zip(demand, pressure, strict=True):
        sample = truth + SIGMA * random.standard_normal()
        follow_demand(state, 0, target, DT)
        correct_pressure(state, 0, sample, SIGMA, DT)
        rows.append((state["value"][0], state["variance"][0], follows(state, 0), sample))
    return np.array(rows).T


def rms(errors) -> float:
    return float(np.sqrt(np.mean(np.square(errors))))


def test_the_model_is_a_dead_time_and_a_lag() -> None:
    state = np.zeros(1, PRESSURE_STATE)[0]
    for k in range(60):
        follow_demand(state, 2, 40.0, DT)
        since = max(k + 2 - DEAD_CYCLES, 0) * DT
        assert state["model"][2] == pytest.approx(40.0 * (1 - math.exp(-since / LAG)))
        assert state["value"][2] == state["model"][2]
    assert state["value"][0] == 0.0


@pytest.mark.parametrize("name", RAMPS)
def test_it_follows_with_less_error_than_the_samples(name: str) -> None:
    kind, times, bars = RAMPS[name]
    demand = np.interp(np.arange(0, 4, DT), times, bars)
    pressure = hydraulics(kind, demand)
    errors, raw, share = [], [], []
    for seed in range(20):
        value, _, following, sample = follow(demand, pressure, seed)
        on = following > 0
        errors.append(value[on] - pressure[on])
        raw.append(sample[on] - pressure[on])
        share.append(on[50:].mean())
    got, before = rms(np.concatenate(errors)), rms(np.concatenate(raw))
    print(f"{name}: {got:.2f} bar, samples {before:.2f} bar; follows for {100 * np.mean(share):.0f} %")
    assert got < 0.5 * before
    assert np.mean(share) > 0.95


AS_MODELLED = (1e-6, LAG, (DEAD_CYCLES - 1) * DT)
HONEST = [
    # hydraulics, gain of the demand, course
    ("as modelled", AS_MODELLED, 1.00, "in two steps"),
    ("as modelled", AS_MODELLED, 1.00, "gentle"),
    ("2 % more", AS_MODELLED, 1.02, "in two steps"),
    ("5 % more", AS_MODELLED, 1.05, "in two steps"),
    ("lag of 30 ms", (1e-6, 0.030, 0.020), 1.00, "in two steps"),
    ("lag of 50 ms", (1e-6, 0.050, 0.020), 1.00, "in two steps"),
    ("A.17", BUILD_UP, 1.00, "gentle"),
    ("A.17", BUILD_UP, 1.00, "brisk"),
    ("A.17", BUILD_UP, 1.00, "in two steps"),
    ("A.18", RELEASE, 1.00, "release"),
]


@pytest.mark.parametrize(("name", "kind", "gain", "course"), HONEST)
def test_its_variance_is_honest(name: str, kind, gain: float, course: str) -> None:
    demand = np.interp(np.arange(0, 4, DT), *RAMPS[course][1:])
    pressure = hydraulics(kind, gain * demand)
    ratios = []
    for seed in range(30):
        value, variance, following, _ = follow(demand, pressure, seed)
        on = following > 0
        ratios.append((value[on] - pressure[on]) / np.sqrt(variance[on]))
    inside = float(np.mean(np.abs(np.concatenate(ratios)) < 2))
    print(f"{name}, gain {gain}, {course}: {100 * inside:.1f} % inside two sigma (85 … 99.7)")
    assert 0.85 < inside < 0.997


FOREIGN = [
    # what the pressure does from 2 s on while the demand rests at 40 bar; stops following within [s]
    ("rises by 10 bar/s", lambda t: 40 + 10 * t, 0.5),
    ("falls by 20 bar/s", lambda t: 40 - 20 * t, 0.35),
    ("stands 10 bar higher", lambda t: 50 + 0 * t, 0.10),
    ("stands 5 bar higher", lambda t: 45 + 0 * t, 0.20),
    ("is released", lambda t: 0 * t, 0.03),
    ("swings", lambda t: 40 + 15 * np.sin(6 * t), 0.15),
]


@pytest.mark.parametrize(("name", "course", "within"), FOREIGN, ids=[row[0] for row in FOREIGN])
def test_it_stops_following_a_pressure_that_does_something_else(name: str, course, within: float) -> None:
    demand = np.full(300, 40.0)
    pressure = np.where(np.arange(300) < 200, 40.0, course((np.arange(300) - 199) * DT))
    stopped = []
    for seed in range(20):
        _, _, following, _ = follow(demand, pressure, seed)
        assert following[100:200].mean() > 0.97
        stopped.append(np.argmin(following[200:]) * DT + DT if (following[200:] == 0).any() else math.inf)
    print(f"{name}: stops after {min(stopped):.2f} to {max(stopped):.2f} s ({within})")
    assert max(stopped) <= within


def test_a_pressure_that_keeps_swinging_is_not_followed() -> None:
    time = np.arange(0, 5, DT)
    demand = np.full(len(time), 40.0)
    pressure = np.where(time < 1.0, 40.0, 40 + 15 * np.sin(6 * (time - 1.0)))
    share = [follow(demand, pressure, seed)[2][120:].mean() for seed in range(10)]
    print(f"still follows for {100 * np.mean(share):.0f} % of the time")
    assert np.mean(share) < 0.15


def test_it_takes_up_again() -> None:
    """A second after both agree again, and not before they have agreed for a while."""
    time = np.arange(0, 5, DT)
    demand = np.full(len(time), 40.0)
    pressure = np.where((time > 1) & (time < 2), 40 + 20 * np.sin(8 * (time - 1.0)), 40.0)
    for seed in range(10):
        following = follow(demand, pressure, seed)[2]
        assert not following[199]
        again = 200 + int(np.argmax(following[200:]))
        assert AGREED_S / 2 < (again - 200) * DT < 1.0
        assert following[300:].mean() > 0.97


def test_it_does_not_follow_before_it_has_agreed() -> None:
    following = follow(np.full(100, 20.0), np.full(100, 20.0), 1)[2]
    assert int(np.argmax(following)) == pytest.approx(AGREED_S / DT, abs=1)
