"""The filter of whole applications: bend against differences, store, bounds, drag by its signatures."""

import math
from typing import Any

import numpy as np
import pytest

from ecu.algorithm.estimation.joint.whole_filter import (
    CEILING,
    COASTING_NOISE,
    FALL,
    FILTER_STATE,
    FULL_TORQUE,
    GRIP,
    HIGHEST_STATE,
    LOWEST_STATE,
    OVERRUN,
    PAUSE,
    PEDAL,
    POWER,
    PRIOR,
    SCALE,
    STATES,
    USUAL_SPEED,
    bend,
    correct_by_coasting,
    correct_by_mean,
    forget_filter,
    keep_filter,
    per_power,
    published_ceiling,
    restore_filter,
)
from ecu.contract.records import LEARNED


@pytest.fixture
def state() -> Any:
    """Return a filter that has learned nothing."""
    new = np.zeros(1, FILTER_STATE)[0]
    forget_filter(new)
    return new


def law(state: Any, linings: float) -> tuple[float, float, float, float]:
    """Return what the filter expects of `linings` [m/s^2], and its derivatives."""
    x = state["value"]
    return bend(math.exp(x[SCALE]) * linings, CEILING * math.exp(x[GRIP]), x[FALL])


def brake(state: Any, linings: float, decel: float, speed: float = USUAL_SPEED) -> None:
    """Correct by an application of constant `linings` [m/s^2] at a constant speed."""
    expected, by_scale, by_grip, by_fall = law(state, linings)
    correct_by_mean(state, decel, expected, by_scale, by_grip, per_power(speed), by_fall, True)


@pytest.mark.parametrize("fall", [0.0, 0.3])
@pytest.mark.parametrize("linings", [0.1, 3.0, 9.0, 14.0, 40.0])
def test_derivatives_of_the_bend_are_those_of_differences(linings: float, fall: float) -> None:
    step, ceiling = 1e-6, 11.0
    _, by_scale, by_grip, by_fall = bend(linings, ceiling, fall)
    up, down = math.exp(step), math.exp(-step)
    more, less = (bend(linings * by, ceiling, fall)[0] for by in (up, down))
    assert by_scale == pytest.approx((more - less) / (2 * step), rel=1e-5, abs=1e-7)
    more, less = (bend(linings, ceiling * by, fall)[0] for by in (up, down))
    assert by_grip == pytest.approx((more - less) / (2 * step), rel=1e-5, abs=1e-7)
    more, less = (bend(linings, ceiling, fall + by)[0] for by in (step, -step))
    assert by_fall == pytest.approx((more - less) / (2 * step), rel=1e-5, abs=1e-7)


@pytest.mark.parametrize(
    ("case", "fall", "share", "expected", "within"),
    [
        ("gentle: the linings'", 0.2, 0.05, 0.05, 0.001),
        ("below the limit nothing falls", 0.2, 0.6, math.tanh(0.6), 0.1),
        ("a tanh, next to it", 0.0, 0.5, math.tanh(0.5), 0.05),
        ("a tanh, next to it", 0.0, 1.0, math.tanh(1.0), 0.05),
        ("asked for far too much: the ceiling", 0.0, 3.0, 1.0, 0.02),
        ("asked for far too much: what slides", 0.2, 3.0, 0.8, 0.02),
    ],
)
def test_brakes_give_what_linings_ask_up_to_the_ceiling(
    case: str, fall: float, share: float, expected: float, within: float
) -> None:
    assert bend(share * 10.0, 10.0, fall)[0] == pytest.approx(10.0 * expected, rel=within)


@pytest.mark.parametrize(("peak", "beyond"), [(9.0, 9.0), (9.0, 7.0), (9.0, 5.5), (12.0, 8.0)])
def test_what_is_lost_beyond_the_limit_is_no_poorer_road(state: Any, peak: float, beyond: float) -> None:
    """Half of the applications ask for up to 0.7 of the peak, half for twice it."""

    def gives(share: float) -> float:
        return peak * math.tanh(share) if share < 1.0 else beyond

    for share in (0.4, 2.0, 0.7, 2.2, 0.55, 1.8) * 6:
        brake(state, share * peak, gives(share) + 0.2)
    for share in (0.4, 0.7, 2.0):
        said = law(state, share * peak)[0] + state["value"][OVERRUN]
        assert said == pytest.approx(gives(share) + 0.2, rel=0.03), share


def test_the_published_ceiling_is_midway_from_peak_to_slide(state: Any) -> None:
    """Its sigma beside draws of both states."""
    x, p = state["value"], state["covariance"]
    x[GRIP], x[FALL] = math.log(10.0 / CEILING), 0.2
    p[GRIP, GRIP], p[FALL, FALL], p[GRIP, FALL] = 0.1**2, 0.1**2, 0.006
    p[FALL, GRIP] = p[GRIP, FALL]
    ceiling, sigma = published_ceiling(state)
    assert ceiling == pytest.approx(9.0)
    both = p[np.ix_([GRIP, FALL], [GRIP, FALL])]
    drawn = np.random.default_rng(1).multivariate_normal([x[GRIP], x[FALL]], both, 20_000)
    assert sigma == pytest.approx(np.std(CEILING * np.exp(drawn[:, 0]) * (1.0 - 0.5 * drawn[:, 1])), rel=0.03)


@pytest.mark.parametrize(
    ("speed", "drag"),  # of 7 W/kg, beyond that at 10 m/s
    [(3.0, 0.3), (FULL_TORQUE, 0.3), (USUAL_SPEED, 0.0), (28.0, -0.45)],
)
def test_a_constant_power_drags_less_the_faster_the_car(speed: float, drag: float) -> None:
    assert 7.0 * per_power(speed) == pytest.approx(drag)


def test_what_was_learned_comes_back_less_certain(state: Any) -> None:
    learned = np.zeros(1, LEARNED)[0]
    state["value"], state["covariance"] = [0.2, -0.3, 0.5, 0.3, 2.0, 0.1], 0.001 * (np.eye(STATES) + 0.2)
    keep_filter(state, learned)
    again = np.zeros(1, FILTER_STATE)[0]
    restore_filter(again, learned)
    assert (again["value"] == state["value"]).all()
    before = state["covariance"]
    wider = np.minimum(np.diag(before) + PAUSE**2, PRIOR**2)
    assert again["covariance"] == pytest.approx(before + np.diag(wider - np.diag(before)))


@pytest.mark.parametrize(
    ("case", "linings", "decel", "reported"),
    [
        ("as configured", 4.0, 4.2, False),
        ("an engine that drags by 0.8", 4.0, 4.8, False),
        ("hardly any friction", 8.0, 1.0, True),
        ("a road of ice: the ceiling is no fault", 20.0, 2.5, False),
        ("a car that a pump brakes by 4 m/s^2", 0.9, 5.0, True),
    ],
)
def test_a_value_that_no_car_has_is_reported_until_the_next_application(
    state: Any, case: str, linings: float, decel: float, reported: bool
) -> None:
    if linings > CEILING:  # the linings are known before it
        for light in (2.0, 3.0, 4.0) * 4:
            brake(state, light, light + 0.2)
    for _ in range(12):
        brake(state, linings, decel)
    assert bool(state["at_bound"]) == reported
    assert (state["value"] >= LOWEST_STATE).all()
    assert (state["value"] <= HIGHEST_STATE).all()
    x = state["value"]
    x *= 0.99
    brake(state, 4.0, law(state, 4.0)[0] + x[OVERRUN])
    assert not state["at_bound"]


@pytest.mark.parametrize(
    ("case", "coasting", "braking", "overrun", "pedal"),
    [  # drag before and during applications [m/s^2]; o and d then
        ("an engine", 0.8, 0.8, 0.8, 0.0),
        ("motors that the brake pedal brings", 0.1, 1.3, 1.3, 1.2),
        ("one pedal", 1.8, 1.8, 1.8, 0.0),
        ("a clutch that opens while braking: between", 0.8, 0.3, 0.6, 0.0),
    ],
)
def test_coasting_and_braking_tell_whose_drag_it_is(
    state: Any, case: str, coasting: float, braking: float, overrun: float, pedal: float
) -> None:
    for linings in (1.0, 4.0, 2.0, 5.0) * 5:
        for _ in range(20):
            correct_by_coasting(state, coasting, USUAL_SPEED, 0.05)
        brake(state, linings, linings + braking)
    assert state["value"][OVERRUN] == pytest.approx(overrun, abs=0.25)
    assert state["value"][PEDAL] == pytest.approx(pedal, abs=0.25)


def test_the_drag_of_the_first_application_is_known_before_it(state: Any) -> None:
    """A second of coasting leaves its own noise, and what the brake pedal may bring."""
    for _ in range(20):
        correct_by_coasting(state, 1.8, USUAL_SPEED, 0.05)
    assert state["value"][OVERRUN] == pytest.approx(1.8, abs=0.4)
    shown = np.array([0.0, 0.0, 1.0, -1.0, 0.0, 0.0])
    assert shown @ state["covariance"] @ shown < 1.3 * COASTING_NOISE**2


def test_the_speed_separates_power_from_drag(state: Any) -> None:
    """An engine that gears keep at its speed, 6 W/kg; applications of 2 m/s^2 at 9 to 30 m/s."""
    for speed in (28.0, 9.0, 20.0, 12.0, 30.0, 15.0) * 10:
        brake(state, 2.0, 2.0 + 6.0 / speed, speed)
    for speed in (9.0, 14.0, 28.0):
        said = 2.0 * math.exp(state["value"][SCALE]) - 2.0
        said += state["value"][OVERRUN] + state["value"][POWER] * per_power(speed)
        assert said == pytest.approx(6.0 / speed, abs=0.1), speed
