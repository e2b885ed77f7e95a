"""Electro-hydraulic brake: A.17, A.18 against scipy, dead times, change of model, limits."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import signal

from brakelab.plant.hydraulics import BUILD_UP, RELEASE, advance_pressure, command_for, settled_pressure
from brakelab.plant.records import HISTORY, PARAMS, STATE, new_record
from brakelab.studies.physics.staircase import STEPS, measure_step

DT = 1e-3
BAR = 1e5


def respond(
    demand_bar: NDArray[np.float64],
    start_bar: float = 0.0,
    slope: float = 0.0,
    known: float = 0.0,
    rise_limit: float = np.inf,
    fall_limit: float = np.inf,
) -> NDArray[np.float64]:
    """Return the pressure [bar] after every step of a demand, from rest at `start_bar`."""
    params, state = new_record(PARAMS), new_record(STATE)
    params["pressure_limit"] = 180 * BAR
    params["offset_start"] = 60 * BAR
    params["offset_slope"], params["offset_known"] = slope, known
    params["build_up"], params["release"] = BUILD_UP, RELEASE
    params["rise_limit"], params["fall_limit"] = rise_limit * BAR, fall_limit * BAR
    state["pressure"] = state["turning_point"] = start_bar * BAR
    state["demand_history"] = start_bar * BAR
    pressure = []
    for demand in demand_bar:
        state["place"] = (state["place"] + 1) % HISTORY
        state["demand_history"][0, state["place"][0]] = demand * BAR
        advance_pressure(params[0], state[0], DT)
        pressure.append(state["pressure"][0, 0] / BAR)
    return np.array(pressure)


@pytest.mark.parametrize(
    ("start", "end", "denominator", "dead_steps"),
    [
        (0.0, 50.0, (0.00075, 0.037, 1.0), 26),
        (120.0, 130.0, (0.00075, 0.037, 1.0), 26),
        (50.0, 0.0, (0.00021, 0.045, 1.0), 15),
        (130.0, 120.0, (0.00021, 0.045, 1.0), 15),
    ],
)
def test_step_response_is_the_published_transfer_function(
    start: float, end: float, denominator: tuple[float, float, float], dead_steps: int
) -> None:
    found = respond(np.full(400, end), start)
    t = np.arange(1, 401) * DT - dead_steps * DT
    _, unit = signal.step(([1.0], denominator), T=np.arange(0, 0.5, DT / 4))
    expected = start + (end - start) * np.interp(t, np.arange(0, 0.5, DT / 4), unit, left=0.0)
    assert np.max(np.abs(found - expected)) < 0.005 * abs(end - start)


@pytest.mark.parametrize(("start", "end", "rate"), [(0.0, 80.0, 80.0), (100.0, 0.0, 200.0)])
def test_a_slow_unit_moves_at_its_rate_and_arrives(start: float, end: float, rate: float) -> None:
    found = respond(np.full(2000, end), start, rise_limit=80.0, fall_limit=200.0)
    slope = np.abs(np.diff(found)) / DT
    assert slope.max() == pytest.approx(rate)
    assert np.median(slope[slope > 0.5 * rate]) == pytest.approx(rate)
    assert found[-1] == pytest.approx(end, abs=0.1)


def test_overshoot_of_the_build_up_is_kept() -> None:
    assert 52.0 < respond(np.full(400, 50.0)).max() < 54.0  # damping 0.68: 5.6 %


def test_a_rise_after_a_release_waits_for_the_longer_dead_time() -> None:
    demand = np.concatenate((np.full(300, 20.0), np.full(100, 60.0)))
    found = respond(demand, 60.0)
    start = found[299]
    assert np.all(found[300:325] <= start + 1e-6)
    assert found[345] > start + 1.0


@pytest.mark.parametrize("period_s", [0.06, 0.1, 0.3, 1.0])
def test_changing_between_the_models_makes_no_jump(period_s: float) -> None:
    t = np.arange(3000) * DT
    demand = 60.0 + 30.0 * np.sign(np.sin(2 * np.pi * t / period_s))
    found = respond(demand)
    assert np.max(np.abs(np.diff(found))) < 120.0 / 0.037 * DT  # a first-order step has no steeper flank


def test_a_small_ripple_on_the_demand_does_not_change_the_model() -> None:
    ripple = 0.2 * np.where(np.arange(400) % 2 == 0, 1.0, -1.0)
    smooth, rippled = respond(np.full(400, 50.0)), respond(50.0 + ripple)
    assert np.max(np.abs(smooth - rippled)) < 0.3


@pytest.mark.parametrize(("demand", "reached"), [(400.0, 180.0), (-20.0, 0.0)])
def test_pressure_stays_between_zero_and_the_accumulator(demand: float, reached: float) -> None:
    found = respond(np.full(1000, demand))
    assert found.min() >= 0.0
    assert found.max() <= 180.0
    assert found[-1] == pytest.approx(reached, abs=0.1)


@given(st.floats(0.0, 2e7), st.floats(0.0, 0.9), st.floats(0.0, 3e7))
def test_the_offset_map_and_its_inverse_are_one(start: float, slope: float, wanted: float) -> None:
    command = command_for(start, slope, wanted)
    assert command >= wanted
    assert settled_pressure(start, slope, command) == pytest.approx(wanted, rel=1e-9, abs=1e-3)


@pytest.mark.parametrize(
    ("demand", "slope", "known", "reached"),
    [
        (50.0, 0.04, 0.0, 50.0),
        (130.0, 0.04, 0.0, 127.2),
        (130.0, 0.04, 0.04, 130.0),
        (130.0, 0.04, 0.08, 130.0 + 0.96 * 70 / 0.92 - 70),
        (180.0, 0.04, 0.04, 180.0),
        (400.0, 0.04, 0.04, 180.0),
    ],
)
def test_high_demands_settle_lower_unless_the_unit_knows_its_offset(
    demand: float, slope: float, known: float, reached: float
) -> None:
    assert respond(np.full(1000, demand), 0.0, slope, known)[-1] == pytest.approx(reached, abs=1e-3)


@pytest.mark.parametrize("number", range(1, STEPS + 1))
@pytest.mark.study
def test_every_step_of_the_staircase_has_the_dead_and_rise_times_of_its_model(number: int) -> None:
    low, high = 10.0 * (number - 1), 10.0 * number
    up, down = measure_step(low, high), measure_step(high, low)
    fine = np.arange(0, 0.5, 1e-5)
    for step, denominator, dead in ((up, (0.00075, 0.037, 1.0), 0.026), (down, (0.00021, 0.045, 1.0), 0.015)):
        _, unit = signal.step(([1.0], denominator), T=fine)
        assert step.dead_time == pytest.approx(dead + fine[np.argmax(unit >= 0.1)], abs=2e-3)
        assert step.rise_time == pytest.approx(dead + fine[np.argmax(unit >= 0.9)], abs=2e-3)
    assert up.dead_time > down.dead_time
    assert up.overshoot == pytest.approx(0.53, abs=0.05)  # bar; damping 0.68


def test_dead_time_to_one_bar_falls_with_the_size_of_the_step() -> None:
    found = [measure_step(0.0, 10.0 * number).dead_time for number in range(1, STEPS + 1)]
    assert all(later <= earlier for earlier, later in pairwise(found))
    assert found[0] - found[-1] > 5e-3
