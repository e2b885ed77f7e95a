"""The output limiter, exhaustively: every limit swept densely, and anything at all thrown at it.

The limits, from the requirements: 0–180 bar; rise no faster than configured, which is at least 1500 bar/s;
fall unlimited when the demand falls; friction torque at nominal friction within 0.6–1.6 of the torque
demanded; a demand that is not finite or moves against the uncompensated one is replaced by that.
"""

import itertools
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ecu.algorithm.control.limiter import (
    LIMITER_STATE,
    available_pressure,
    limit_axle,
    reads_empty,
    watch_accumulator,
)
from ecu.algorithm.monitoring.witness import WITNESS_STATE, begin_watch
from ecu.contract.signals import ALIVE, INPUT, USABLE, VALID
from ecu.jit import kernel
from ecu.settings.config import load_config, new_params

BAR = 1e5
DT = 0.01
RATE = 3000.0 * BAR  # Pa/s, the default of the configuration
STEP = RATE * DT
WITNESS = np.zeros(1, WITNESS_STATE)[0]  # what is published does not matter here
NAN, INF = math.nan, math.inf

CONFIGS = Path(__file__).parents[4] / "config"
PARAMS = new_params(load_config(CONFIGS / "suv.toml"))
# Table D.1: N m per Pa above the push-out pressure, at nominal friction
PER_PASCAL = [
    2 * math.pi / 4 * d**2 * 0.45 * r
    for d, r in ((0.060, 0.1205), (0.060, 0.1205), (0.034, 0.1288), (0.034, 0.1288))
]
PUSH_OUT = 0.5 * BAR


def fresh(corner: int = 0, pressure: float = 0.0, uncompensated: float = 0.0, wanted: float = 0.0):
    state = np.zeros(1, LIMITER_STATE)
    state["pressure"][0, corner] = pressure
    state["uncompensated"][0, corner] = uncompensated
    state["wanted"][0, corner] = wanted
    return state


@kernel
def limit_both(params, state, left, wanted, uncompensated, torque, ceiling, dt):
    """The limiter on arrays of one record: five times as fast to call from Python as with records."""
    state[0].ceiling[:] = ceiling
    limit_axle(params[0], state[0], left, wanted, uncompensated, torque, dt)


def limit(params, state, corner, wanted, uncompensated, torque, dt, ceiling=180 * BAR):
    return limit_corner(params, state, corner, wanted, uncompensated, torque, ceiling, dt)


@kernel
def limit_corner(params, state, corner, wanted, uncompensated, torque, ceiling, dt):
    """One corner; nothing is asked of the other one, so there is nothing to level.

    A default of a kernel would not be here: numba takes every omitted float for the first one that it met,
    and resolves the types of a call anew, 2 ms, wherever it is another.
    """
    four = np.zeros((3, 4))
    four[0, corner], four[1, corner], four[2, corner] = wanted, uncompensated, torque
    limit_both(params, state, corner // 2 * 2, four[0], four[1], four[2], ceiling, dt)
    return state[0].pressure[corner]


def nominal(torque: float, corner: int = 0) -> float:
    """Return the pressure for a torque at nominal friction (5.4)."""
    return PUSH_OUT + torque / PER_PASCAL[corner]


def torque_at_nominal(pressure: float, corner: int = 0) -> float:
    return max(pressure - PUSH_OUT, 0.0) * PER_PASCAL[corner]


def settle(state, corner: int, wanted: float, uncompensated: float, torque: float) -> float:
    """Return the output after the rate no longer limits a demand that stands still."""
    return [limit(PARAMS, state, corner, wanted, uncompensated, torque, DT) for _ in range(20)][-1]


# ---------------------------------------------------------------- nothing to correct


@pytest.mark.parametrize("corner", range(4))
@pytest.mark.parametrize("torque", [1.0, 50.0, 300.0, 600.0])
@pytest.mark.parametrize("share", [0.75, 0.9, 1.0, 1.2, 1.4])
def test_a_plausible_demand_passes_unchanged(corner: int, torque: float, share: float) -> None:
    uncompensated = nominal(torque, corner)
    wanted = PUSH_OUT + share * (uncompensated - PUSH_OUT)
    state = fresh()
    assert settle(state, corner, wanted, uncompensated, torque) == pytest.approx(wanted, abs=1e-6)
    state["limited"] = 0
    limit(PARAMS, state, corner, wanted, uncompensated, torque, DT)
    assert state["limited"] == 0


@pytest.mark.parametrize("torque", [0.0, -0.0, -1.0, -1e9, NAN, INF, -INF])
@pytest.mark.parametrize("wanted", [0.0, 50 * BAR, NAN, INF])
def test_no_torque_is_no_pressure_at_once(torque: float, wanted: float) -> None:
    state = fresh(pressure=120 * BAR, uncompensated=120 * BAR, wanted=120 * BAR)
    assert limit(PARAMS, state, 0, wanted, 120 * BAR, torque, DT) == 0.0
    assert [state[k][0, 0] for k in ("pressure", "uncompensated", "wanted")] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("torque", [1e12, 5.5e304, 1.7e308])
@pytest.mark.parametrize("wanted", [0.0, 60 * BAR, 1e300, NAN])
@pytest.mark.parametrize("uncompensated", [0.0, -1e300, 1e300, NAN])
def test_a_torque_whose_pressure_is_no_number(torque: float, wanted: float, uncompensated: float) -> None:
    assert settle(fresh(), 0, wanted, uncompensated, torque) == 180 * BAR


def test_half_a_pascal_of_rounding_is_no_limit_and_two_are() -> None:
    """`limited` is reported from 1 Pa on."""
    for beyond, reported in ((0.95, 0), (1.05, 1)):
        state = fresh()
        wanted = PUSH_OUT + 1.6 * 400.0 / PER_PASCAL[0] + beyond
        limit(PARAMS, state, 0, wanted, nominal(400.0), 400.0, DT)
        assert state["limited"] == reported


def test_the_smallest_torque_is_a_demand() -> None:
    assert settle(fresh(), 0, nominal(0.01), nominal(0.01), 0.01) == pytest.approx(nominal(0.01))


# ---------------------------------------------------------------- torque at nominal friction, 0.6–1.6


@pytest.mark.parametrize("corner", range(4))
@pytest.mark.parametrize("torque", [20.0, 400.0, 900.0])
def test_torque_stays_within_its_window_in_a_dense_sweep(corner: int, torque: float) -> None:
    for share in np.concatenate(
        [np.linspace(0.55, 0.65, 41), np.linspace(1.55, 1.65, 41), [-5, 0, 0.3, 3, 50]]
    ):
        uncompensated = nominal(torque, corner)
        wanted = PUSH_OUT + share * torque / PER_PASCAL[corner]
        state = fresh()
        pressure = settle(state, corner, wanted, uncompensated, torque)
        expected = min(PUSH_OUT + min(max(share, 0.6), 1.6) * torque / PER_PASCAL[corner], 180 * BAR)
        assert pressure == pytest.approx(expected, abs=1.0)
        assert state["limited"] == (abs(expected - wanted) > 1.0), share


def test_the_window_holds_for_the_uncompensated_demand_too() -> None:
    """A learned friction of half the nominal one would ask for twice the pressure; none asks for none."""
    torque = 400.0
    for uncompensated, share in ((PUSH_OUT + 2 * torque / PER_PASCAL[0], 1.6), (0.0, 0.6)):
        sent = settle(fresh(), 0, NAN, uncompensated, torque)
        assert sent == pytest.approx(PUSH_OUT + share * torque / PER_PASCAL[0])


# ---------------------------------------------------------------- what the hydraulics can give, and slip


@pytest.mark.parametrize("corner", range(4))
def test_no_pressure_above_the_ceiling_in_a_dense_sweep(corner: int) -> None:
    torque = (80 * BAR - PUSH_OUT) * PER_PASCAL[corner]
    for ceiling in np.concatenate([np.linspace(78, 82, 81), [0, 1, 40, 179, 180]]) * BAR:
        state = fresh(corner, 80 * BAR, 80 * BAR, 80 * BAR)
        pressure = limit(PARAMS, state, corner, 80 * BAR, 80 * BAR, torque, DT, ceiling)
        assert pressure == pytest.approx(min(80 * BAR, ceiling))
        assert state["limited"] == 0  # what the hydraulics lack is no fault of the demand


@pytest.mark.parametrize("ceiling", [NAN, INF, -INF, -1.0, 181 * BAR])
def test_a_ceiling_that_cannot_be_is_none(ceiling: float) -> None:
    torque = (60 * BAR - PUSH_OUT) * PER_PASCAL[0]
    assert limit(PARAMS, fresh(0, 60 * BAR), 0, 60 * BAR, 60 * BAR, torque, DT, ceiling) == 60 * BAR


def test_from_below_a_ceiling_that_is_lifted_pressure_rises_from_where_it_was() -> None:
    torque = (90 * BAR - PUSH_OUT) * PER_PASCAL[0]
    state = fresh(0, 90 * BAR, 90 * BAR, 90 * BAR)
    ceilings = [30 * BAR, 30 * BAR, 180 * BAR, 180 * BAR]
    got = [limit(PARAMS, state, 0, 90 * BAR, 90 * BAR, torque, DT, ceiling) for ceiling in ceilings]
    assert got == pytest.approx([30 * BAR, 30 * BAR, 60 * BAR, 90 * BAR])


@pytest.mark.parametrize(
    ("case", "verdict", "accumulator", "available"),
    [
        ("full", USABLE, 180.0, 180.0),
        ("fuller than the demand may be", USABLE, 210.0, 180.0),
        ("low", USABLE, 95.5, 95.5),
        ("a little", USABLE, 10.01, 10.01),
        ("no more than the gas", USABLE, 10.0, 180.0),
        ("empty, or a sensor that lies", USABLE, 0.0, 180.0),
        ("stale", VALID, 20.0, 180.0),
        ("invalid", ALIVE, 20.0, 180.0),
        ("never came", 0, 0.0, 180.0),
    ],
)
def test_what_the_accumulator_can_give(feed, case, verdict, accumulator, available) -> None:
    """Once callipers have confirmed its reading, nothing before."""
    inputs, state = feed(accumulator_pressure=accumulator), np.zeros(1, LIMITER_STATE)[0]
    inputs[0]["verdict"][INPUT["accumulator_pressure"]] = verdict
    assert available_pressure(PARAMS[0], state, inputs[0]) == pytest.approx(180.0 * BAR), case
    state["confirmed"] = 1
    assert available_pressure(PARAMS[0], state, inputs[0]) == pytest.approx(available * BAR), case
    assert bool(reads_empty(inputs[0])) == (verdict == USABLE and accumulator <= 10.0)


ACCUMULATORS = [
    # case, accumulator reads, calliper, demand [bar], seconds, limits, denied
    ("holds enough", 180.0, 60.0, 60.0, 1.0, 0, 0),
    ("low, a calliper agrees", 40.0, 39.0, 60.0, 0.45, 1, 0),
    ("not yet", 40.0, 39.0, 60.0, 0.35, 0, 0),
    ("low, nothing more demanded", 40.0, 39.0, 45.0, 1.0, 0, 0),
    ("a calliper holds more", 11.0, 60.0, 60.0, 0.15, 0, 1),
    ("by 12 bar", 40.0, 52.0, 60.0, 0.15, 0, 1),
    ("for a moment", 11.0, 60.0, 60.0, 0.05, 0, 0),
    ("not by more than both sensors err", 40.0, 47.0, 60.0, 0.45, 1, 0),
    ("lost", math.nan, 60.0, 60.0, 1.0, 0, 0),
]


@pytest.mark.parametrize(
    ("case", "reads", "calliper", "asked", "seconds", "limits", "denied"),
    ACCUMULATORS,
    ids=[row[0] for row in ACCUMULATORS],
)
def test_an_accumulator_limits_once_callipers_confirm_it(
    feed, case, reads, calliper, asked, seconds, limits, denied
) -> None:
    inputs, state = feed(accumulator_pressure=reads), np.zeros(1, LIMITER_STATE)[0]
    feed(inputs, calliper_pressure=np.array([calliper, 0.0, 0.0, 0.0]))
    state["asked"] = asked * BAR
    for _ in range(round(seconds / DT)):
        watch_accumulator(state, WITNESS, inputs[0], DT)
    assert (state["confirmed"], state["denied"]) == (limits, denied), case


@pytest.mark.parametrize("corner", range(4))
@pytest.mark.parametrize("lost", [False, True])
def test_each_calliper_denies_an_accumulator_unless_it_is_lost(feed, corner, lost) -> None:
    inputs, state = feed(accumulator_pressure=11.0), np.zeros(1, LIMITER_STATE)[0]
    feed(inputs, calliper_pressure=60.0 * (np.arange(4) == corner))
    if lost:
        inputs[0]["verdict"][INPUT["calliper_pressure_fl"] + corner] = 0
    state["asked"] = 60.0 * BAR
    for _ in range(100):
        watch_accumulator(state, WITNESS, inputs[0], DT)
    assert (state["confirmed"], state["denied"]) == ((1, 0) if lost else (0, 1))


BELIEFS = [
    # case, accumulator reads, calliper, demand [bar], limits, denied before; limits, denied after a cycle
    ("callipers hold less, as it says", 40.0, 30.0, 60.0, 0, 1, 0, 0),
    ("nothing demanded: nothing is known", 40.0, 0.0, 0.0, 0, 1, 0, 1),
    ("it holds far more than is demanded", 60.0, 30.0, 30.0, 0, 1, 0, 0),
    ("hardly more", 33.0, 30.0, 30.0, 0, 1, 0, 1),
    ("a calliper holds a little more", 35.0, 40.0, 60.0, 0, 1, 0, 1),
    ("enough for the demand", 60.0, 30.0, 30.0, 1, 0, 0, 0),
    ("not enough, by less than sensors err", 40.0, 39.0, 45.0, 1, 0, 1, 0),
    ("not enough", 40.0, 39.0, 60.0, 1, 0, 1, 0),
    ("denied", 40.0, 45.0, 60.0, 1, 1, 0, 1),
]


@pytest.mark.parametrize(
    ("case", "reads", "calliper", "asked", "limits", "denied", "limits_then", "denied_then"),
    BELIEFS,
    ids=[row[0] for row in BELIEFS],
)
def test_how_long_an_accumulator_limits_or_is_denied(
    feed, case, reads, calliper, asked, limits, denied, limits_then, denied_then
) -> None:
    inputs, state = feed(accumulator_pressure=reads), np.zeros(1, LIMITER_STATE)[0]
    feed(inputs, calliper_pressure=np.array([calliper, 0.0, 0.0, 0.0]))
    state["asked"], state["confirmed"], state["denied"] = asked * BAR, limits, denied
    watch_accumulator(state, WITNESS, inputs[0], DT)
    assert (state["confirmed"], state["denied"]) == (limits_then, denied_then), case


def test_a_lost_accumulator_is_neither_confirmed_nor_denied(feed) -> None:
    inputs, state = feed(accumulator_pressure=40.0), np.zeros(1, LIMITER_STATE)[0]
    inputs[0]["verdict"][INPUT["accumulator_pressure"]] = 0
    names = ("confirmed", "denied", "short_s", "above_s")
    state["asked"], state["confirmed"], state["short_s"], state["above_s"] = 60.0 * BAR, 1, 0.3, 0.05
    watch_accumulator(state, WITNESS, inputs[0], DT)
    assert [float(state[name]) for name in names] == [0.0] * 4


@pytest.mark.parametrize(
    ("case", "reads", "calliper", "denied", "innovation", "left_out"),
    [
        ("a calliper holds more", 40.0, 60.0, 0, -20.0, 0),
        ("denied", 40.0, 60.0, 1, -20.0, 1),
        ("holds enough", 150.0, 60.0, 0, 0.0, 0),
        ("empty", 5.0, 0.0, 0, 0.0, 1),
    ],
)
def test_what_is_published_of_an_accumulator(
    feed, case, reads, calliper, denied, innovation, left_out
) -> None:
    """Only that a calliper holds more speaks against it: by 8 bar it is beyond three sigma."""
    inputs, state = feed(accumulator_pressure=reads), np.zeros(1, LIMITER_STATE)[0]
    witness, place = np.zeros(1, WITNESS_STATE)[0], INPUT["accumulator_pressure"]
    feed(inputs, calliper_pressure=np.array([calliper, 0.0, 0.0, 0.0]))
    state["asked"], state["denied"] = 60.0 * BAR, denied
    begin_watch(witness, DT)
    watch_accumulator(state, witness, inputs[0], DT)
    published = [float(witness["published"][name][place]) for name in ("innovation", "sigma", "rejected")]
    assert published == pytest.approx([innovation, 8.0 / 3.0, left_out]), case


def test_an_accumulator_that_agrees_again_is_believed_again(feed) -> None:
    inputs, state = feed(accumulator_pressure=11.0), np.zeros(1, LIMITER_STATE)[0]
    feed(inputs, calliper_pressure=np.full(4, 60.0))
    state["asked"] = 60.0 * BAR
    for reads, denied in ((11.0, 1), (150.0, 0)):
        feed(inputs, accumulator_pressure=reads)
        for _ in range(30):
            watch_accumulator(state, WITNESS, inputs[0], DT)
        assert state["denied"] == denied


# ---------------------------------------------------------------- 0–180 bar


@pytest.mark.parametrize("corner", range(4))
def test_the_ceiling_in_a_dense_sweep(corner: int) -> None:
    for target in np.concatenate([np.linspace(178, 182, 81), [150, 200, 1000, 1e6]]) * BAR:
        torque = (target - PUSH_OUT) * PER_PASCAL[corner]
        state = fresh(corner, 180 * BAR, target, target)
        pressure = limit(PARAMS, state, corner, target, target, torque, DT)
        assert pressure <= 180 * BAR
        if target >= 180 * BAR:
            assert pressure == 180 * BAR
        else:
            # a standing demand: the fall from 180 bar is rate limited
            assert settle(state, corner, target, target, torque) == pytest.approx(target)


def test_a_lower_ceiling_of_the_configuration_holds() -> None:
    params = new_params(load_config(CONFIGS / "suv.toml"))
    params["max_pressure"] = 60 * BAR
    state = fresh()
    torque = (100 * BAR - PUSH_OUT) * PER_PASCAL[0]
    outputs = [limit(params, state, 0, 100 * BAR, 100 * BAR, torque, DT) for _ in range(10)]
    assert max(outputs) == 60 * BAR


# ---------------------------------------------------------------- rate


@pytest.mark.parametrize("last", [0.0, 5 * BAR, 40 * BAR, 100 * BAR])
def test_the_rise_in_a_dense_sweep(last: float) -> None:
    for rise in np.concatenate([np.linspace(29, 31, 81), [0, 1, 10, 60]]) * BAR:
        target = last + rise
        torque = (target - PUSH_OUT) * PER_PASCAL[0]
        state = fresh(pressure=last, uncompensated=last, wanted=last)
        pressure = limit(PARAMS, state, 0, target, target, torque, DT)
        if torque > 0:
            assert pressure == pytest.approx(last + min(rise, STEP), abs=1e-3), rise / BAR


def test_an_emergency_stop_is_not_delayed() -> None:
    """150 bar are there within 0.1 s: 1500 bar/s are always allowed."""
    torque = (150 * BAR - PUSH_OUT) * PER_PASCAL[0]
    state = fresh()
    outputs = [limit(PARAMS, state, 0, 150 * BAR, 150 * BAR, torque, DT) / BAR for _ in range(10)]
    assert all(p >= min(15.0 * (k + 1), 150.0) - 1e-9 for k, p in enumerate(outputs)), outputs
    assert outputs == pytest.approx([30, 60, 90, 120, 150, 150, 150, 150, 150, 150])


@pytest.mark.parametrize("dt", [0.01, 0.02, 0.05])
def test_the_rise_is_per_second_not_per_cycle(dt: float) -> None:
    torque = (170 * BAR - PUSH_OUT) * PER_PASCAL[0]
    pressure = limit(PARAMS, fresh(), 0, 170 * BAR, 170 * BAR, torque, dt)
    assert pressure == pytest.approx(min(RATE * dt, 170 * BAR))


@pytest.mark.parametrize("to", [0.1, 1.0, 20.0, 60.0, 99.0, 119.9])
def test_the_pressure_falls_at_once_with_the_demand(to: float) -> None:
    state = fresh(pressure=120 * BAR, uncompensated=120 * BAR, wanted=120 * BAR)
    target = PUSH_OUT + to * BAR
    torque = to * BAR * PER_PASCAL[0]
    assert limit(PARAMS, state, 0, target, target, torque, DT) == pytest.approx(target)


@pytest.mark.parametrize("fall", [10.0, 29.9, 30.1, 45.0])
def test_a_fall_without_a_falling_demand_is_as_slow_as_a_rise(fall: float) -> None:
    torque = (100 * BAR - PUSH_OUT) * PER_PASCAL[0]
    state = fresh(pressure=110 * BAR, uncompensated=100 * BAR, wanted=0.0)
    wanted = (110 - fall) * BAR
    pressure = limit(PARAMS, state, 0, wanted, 100 * BAR, torque, DT)
    assert pressure == pytest.approx((110 - min(fall, 30.0)) * BAR)


# ---------------------------------------------------------------- fallback to the uncompensated demand


@pytest.mark.parametrize("wanted", [NAN, INF, -INF])
@pytest.mark.parametrize("corner", range(4))
def test_a_demand_that_is_not_finite_is_replaced(wanted: float, corner: int) -> None:
    torque = 300.0
    state = fresh()
    assert settle(state, corner, wanted, nominal(torque, corner), torque) == pytest.approx(
        nominal(torque, corner)
    )
    assert state["limited"] == 1


@pytest.mark.parametrize("uncompensated", [NAN, INF, -INF, -1.0, -1e9])
def test_an_uncompensated_demand_that_is_no_pressure_is_computed_anew(uncompensated: float) -> None:
    assert settle(fresh(), 0, NAN, uncompensated, 300.0) == pytest.approx(nominal(300.0))


@pytest.mark.parametrize(
    ("case", "demand_change", "wanted_change", "replaced"),
    [
        ("standing demand, compensation creeps", 0.0, 4.9, False),
        ("standing demand, compensation creeps down", 0.0, -4.9, False),
        ("standing demand, compensation jumps", 0.0, 5.1, True),
        ("standing demand, compensation drops", 0.0, -5.1, True),
        ("rising demand, compensation follows", 8.0, 9.0, False),
        ("rising demand, compensation falls a little", 8.0, -4.9, False),
        ("rising demand, compensation drops", 8.0, -5.1, True),
        ("falling demand, compensation follows", -8.0, -9.0, False),
        ("falling demand, compensation rises a little", -8.0, 4.9, False),
        ("falling demand, compensation jumps", -8.0, 5.1, True),
        ("just not against", 8.0, -5.0, False),
        ("just not against, rising", -8.0, 5.0, False),
    ],
)
def test_a_demand_that_moves_against_the_uncompensated_one_is_replaced(
    case: str, demand_change: float, wanted_change: float, replaced: bool
) -> None:
    before, wanted_before = 60.0, 52.0
    state = fresh(pressure=wanted_before * BAR, uncompensated=before * BAR, wanted=wanted_before * BAR)
    uncompensated, wanted = (before + demand_change) * BAR, (wanted_before + wanted_change) * BAR
    torque = (uncompensated - PUSH_OUT) * PER_PASCAL[0]
    pressure = limit(PARAMS, state, 0, wanted, uncompensated, torque, DT)
    assert pressure == pytest.approx(uncompensated if replaced else wanted), case
    assert state["limited"] == replaced


def test_the_first_demand_moves_against_nothing() -> None:
    """A compensated demand that appears beside a demand which already stood is a start, not a jump."""
    state = fresh(pressure=0.0, uncompensated=60 * BAR, wanted=0.0)
    torque = (60 * BAR - PUSH_OUT) * PER_PASCAL[0]
    limit(PARAMS, state, 0, 50 * BAR, 60 * BAR, torque, DT)
    assert state["limited"] == 0


@pytest.mark.parametrize("jump", [20.0, -20.0, NAN, INF])
def test_the_replacement_lasts_until_the_compensated_demand_comes_back(jump: float) -> None:
    torque = (60 * BAR - PUSH_OUT) * PER_PASCAL[0]
    state = fresh(pressure=54 * BAR, uncompensated=60 * BAR, wanted=54 * BAR)
    for _ in range(5):
        assert limit(PARAMS, state, 0, (54 + jump) * BAR, 60 * BAR, torque, DT) == pytest.approx(60 * BAR)
        assert state["limited"] == 1
    state["limited"] = 0
    assert limit(PARAMS, state, 0, 56 * BAR, 60 * BAR, torque, DT) == pytest.approx(56 * BAR)
    assert state["limited"] == 0


def test_axles_do_not_know_of_each_other() -> None:
    state = fresh()
    for left in (0, 2):
        before = state.copy()
        four = np.full((3, 4), 300.0)
        four[:2] = [nominal(300.0, corner) for corner in range(4)]
        limit_both(PARAMS, state, left, four[0], four[1], four[2], 180 * BAR, DT)
        for other in (2 - left, 3 - left):
            for field in ("pressure", "uncompensated", "wanted"):
                assert state[field][0, other] == before[field][0, other]
        assert state["wanted"][0, left] == state["uncompensated"][0, left] == nominal(300.0, left)


# ---------------------------------------------------------------- anything at all

SPECIAL = [
    0.0,
    -0.0,
    1e-300,
    -1.0,
    1.0,
    1e5,
    5e4,
    1.8e7,
    1.8e7 + 1,
    -1e7,
    1e9,
    1e30,
    1e300,
    -1e300,
    NAN,
    INF,
    -INF,
]
anything = st.sampled_from(SPECIAL) | st.floats() | st.floats(-1e7, 3e7)
any_torque = st.sampled_from(SPECIAL) | st.floats() | st.floats(0, 6000)
cycles = st.lists(st.tuples(anything, anything, any_torque, anything), min_size=1, max_size=12)


def check(
    last: float, pressure: float, torque: float, corner: int, dt: float = DT, ceiling: float = 180 * BAR
) -> None:
    """The limits that hold whatever the arguments were."""
    ceiling = ceiling if 0 <= ceiling <= 180 * BAR else 180 * BAR
    assert math.isfinite(pressure)
    assert 0.0 <= pressure <= 180 * BAR
    assert pressure <= last + RATE * dt + 1e-6
    if math.isfinite(torque) and torque > 0:
        least = PUSH_OUT + 0.6 * torque / PER_PASCAL[corner]
        assert pressure >= min(least, last + RATE * dt, ceiling) * (1 - 1e-12) - 1e-6
        assert pressure <= ceiling
        assert torque_at_nominal(pressure, corner) <= 1.6 * torque * (1 + 1e-9) + 1e-6
    else:
        assert pressure == 0.0


@settings(max_examples=500, deadline=None)
@given(cycles, st.integers(0, 3))
def test_every_limit_holds_whatever_comes(
    sequence: list[tuple[float, float, float, float]], corner: int
) -> None:
    state = fresh()
    last = 0.0
    for wanted, uncompensated, torque, ceiling in sequence:
        pressure = limit(PARAMS, state, corner, wanted, uncompensated, torque, DT, ceiling)
        check(last, pressure, torque, corner, DT, ceiling)
        last = pressure


def test_every_pair_of_special_values_in_two_cycles() -> None:
    torques = [NAN, 0.0, 1.0, 300.0, 5000.0, 1e300]
    for w1, u1, t1, w2, u2, t2 in itertools.product(
        SPECIAL[3::3], SPECIAL[2::4], torques[2:5], SPECIAL[4::3], SPECIAL[3::4], torques
    ):
        state = fresh()
        first = limit(PARAMS, state, 0, w1, u1, t1, DT)
        check(0.0, first, t1, 0)
        check(first, limit(PARAMS, state, 0, w2, u2, t2, DT), t2, 0)


@settings(max_examples=200, deadline=None)
@given(anything, anything, any_torque, st.sampled_from([NAN, INF, -INF, -0.01, 0.0, 1e-9, 3600.0]))
def test_no_time_step_makes_it_unsafe(wanted: float, uncompensated: float, torque: float, dt: float) -> None:
    state = fresh()
    pressure = limit(PARAMS, state, 0, wanted, uncompensated, torque, dt)
    assert math.isfinite(pressure)
    assert 0.0 <= pressure <= 180 * BAR
    if not dt > 0:
        assert pressure == 0.0  # no time has passed in which it could have risen


@pytest.mark.parametrize("dt", [1.0, 2.0, 3600.0])
def test_what_is_no_cycle_lets_nothing_rise(dt: float) -> None:
    state = fresh(pressure=20 * BAR, uncompensated=20 * BAR, wanted=20 * BAR)
    torque = (100 * BAR - PUSH_OUT) * PER_PASCAL[0]
    assert limit(PARAMS, state, 0, 100 * BAR, 100 * BAR, torque, dt) == 20 * BAR


@pytest.mark.parametrize("last", [-1.0, -1e9, 180 * BAR + 1, 1e9, NAN, INF])
def test_a_last_output_that_cannot_have_been_counts_as_none(last: float) -> None:
    torque = (150 * BAR - PUSH_OUT) * PER_PASCAL[0]
    assert limit(PARAMS, fresh(0, last), 0, 150 * BAR, 150 * BAR, torque, DT) == pytest.approx(STEP, abs=0.1)


@settings(max_examples=200, deadline=None)
@given(st.tuples(anything, anything, anything))
def test_it_recovers_from_any_state(memory: tuple[float, float, float]) -> None:
    state = fresh(0, *memory)
    for _ in range(20):
        pressure = limit(PARAMS, state, 0, nominal(300.0), nominal(300.0), 300.0, DT)
    assert pressure == pytest.approx(nominal(300.0))
