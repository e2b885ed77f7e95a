"""Torque to pressure (5.4) and its compensation (corrected 5.8) against the brake's own law (A.19)."""

import math
from pathlib import Path

import numpy as np
import pytest

from ecu.algorithm.control.pressure_law import (
    PRESSURE_LAW_STATE,
    compensated_pressure,
    follow_friction,
    learn_start,
    pressure_for_torque,
    set_base,
    watch_limit,
)
from ecu.algorithm.estimate import ESTIMATE
from ecu.contract.params import INVERSE, OFF, SECOND_ORDER
from ecu.contract.records import LEARNED
from ecu.settings.config import load_config, new_params

BAR = 1e5
PARAMS = new_params(load_config(Path(__file__).parents[4] / "config" / "suv.toml"))[0]
BRAKES = [(0.060, 0.1205), (0.060, 0.1205), (0.034, 0.1288), (0.034, 0.1288)]  # Table D.1: d_p, r_eff [m]
PUSH_OUT = 0.5 * BAR


def torque_of(pressure: float, mu: float, corner: int) -> float:
    """(A.19), one piston a side: T = 2 mu A (p - p_0) r_eff."""
    diameter, radius = BRAKES[corner]
    return 2 * mu * math.pi * diameter**2 / 4 * (pressure - PUSH_OUT) * radius


def law(base: float = 0.45, used: float = 0.45):
    state = np.zeros(1, PRESSURE_LAW_STATE)
    state["base"], state["used"], state["mu_override"], state["start"] = base, used, math.nan, 1.0
    return state[0]


def estimated(mu: object, sigma: float = 0.02, observed_s: float = 2.0, grip=(math.nan, math.nan)):
    """Return what the observer says; `grip`: ceiling and its sigma [m/s^2]."""
    estimate = np.zeros(1, ESTIMATE)
    estimate["grip_limit"], estimate["sigma_grip_limit"] = grip
    estimate["mu"], estimate["sigma"], estimate["observed_s"] = mu, sigma, observed_s
    return estimate[0]


@pytest.mark.parametrize("corner", range(4))
@pytest.mark.parametrize("mu", [0.225, 0.45, 0.675])
@pytest.mark.parametrize("torque", [1.0, 100.0, 1500.0])
def test_the_law_inverts_the_brake(params, corner: int, mu: float, torque: float) -> None:
    pressure = pressure_for_torque(params[0], torque, mu, corner)
    assert torque_of(pressure, mu, corner) == pytest.approx(torque, rel=1e-9)


@pytest.mark.parametrize("torque", [0.0, -1.0])
def test_no_torque_is_no_pressure(params, torque: float) -> None:
    assert pressure_for_torque(params[0], torque, 0.45, 0) == 0.0


@pytest.mark.parametrize(
    ("e", "torque_error"),
    # Friction is (1+e) of the base; 1 - e + e^2 against the exact 1 / (1+e) leaves e^3.
    [(-0.3, -0.027), (-0.2, -0.008), (-0.1, -0.001), (0.0, 0.0), (0.1, 0.001), (0.2, 0.008), (0.3, 0.027)],
)
@pytest.mark.parametrize("corner", range(4))
def test_truncation_costs_the_cube_of_the_change(params, corner: int, e: float, torque_error: float) -> None:
    params["compensation"] = SECOND_ORDER
    mu = 0.45 * (1 + e)
    uncompensated = pressure_for_torque(params[0], 500.0, 0.45, corner)
    pressure = compensated_pressure(params[0], law(used=mu), uncompensated, corner)
    assert torque_of(pressure, mu, corner) / 500.0 - 1 == pytest.approx(torque_error, abs=1e-9)


@pytest.mark.parametrize("e", [-0.3, -0.15, 0.0, 0.15, 0.3])
@pytest.mark.parametrize("corner", range(4))
def test_the_inverse_is_exact(params, corner: int, e: float) -> None:
    params["compensation"] = INVERSE
    mu = 0.45 * (1 + e)
    pressure = compensated_pressure(
        params[0], law(used=mu), pressure_for_torque(params[0], 500.0, 0.45, corner), corner
    )
    assert torque_of(pressure, mu, corner) == pytest.approx(500.0, rel=1e-12)


@pytest.mark.parametrize("pressure", [PUSH_OUT, 0.2 * BAR, 0.0])
@pytest.mark.parametrize("used", [0.32, 0.58])
def test_the_push_out_pressure_is_not_scaled(params, pressure: float, used: float) -> None:
    assert compensated_pressure(params[0], law(used=used), pressure, 0) == pytest.approx(pressure)


@pytest.mark.parametrize(
    ("estimate", "used"),
    [(0.05, 0.225), (0.22, 0.225), (0.23, 0.23), (0.66, 0.66), (0.68, 0.675), (2.0, 0.675)],
)
def test_the_friction_in_use_stays_within_half_of_nominal(estimate: float, used: float) -> None:
    state = law()
    for _ in range(500):
        follow_friction(PARAMS, state, estimated(np.full(4, estimate)), 0.01)
    assert state["used"] == pytest.approx(np.full(4, used))


@pytest.mark.parametrize(
    ("case", "compensation", "mu", "factor"),
    [
        ("second order, at its limit", SECOND_ORDER, 0.45 * 0.7, 1.39),
        ("second order, friction halved", SECOND_ORDER, 0.45 * 0.5, 1.39),
        ("second order, half as much again: less pressure, not more", SECOND_ORDER, 0.45 * 1.5, 0.79),
        ("second order, more than twice", SECOND_ORDER, 0.45 * 2.2, 0.79),
        ("inverse, friction halved", INVERSE, 0.45 * 0.5, 2.0),
        ("inverse, half as much again", INVERSE, 0.45 * 1.5, 1.0 / 1.5),
    ],
)
def test_the_second_order_saturates_at_30_percent_of_the_base(params, case, compensation, mu, factor) -> None:
    params["compensation"] = compensation
    pressure = compensated_pressure(params[0], law(used=mu), PUSH_OUT + 40 * BAR, 0)
    assert (pressure - PUSH_OUT) / (40 * BAR) == pytest.approx(factor), case


@pytest.mark.parametrize(
    ("case", "mu", "sigma", "used"),
    [
        ("rough and sure to 5 %", 0.54, 0.027, 0.54),
        ("rough, sure to 10 %: twice the other 5 % less", 0.54, 0.054, 0.54 * math.exp(-0.10)),
        ("rough, sure to 20 %: not sure that it is rough at all", 0.54, 0.108, 0.45),
        ("smooth, sure to 5 %", 0.36, 0.018, 0.36),
        ("smooth, sure to 20 %: more pressure is given all the same", 0.36, 0.072, 0.36),
    ],
)
def test_less_pressure_is_given_only_as_far_as_the_estimate_is_sure(case, mu, sigma, used) -> None:
    state = law()
    for _ in range(100):
        follow_friction(PARAMS, state, estimated(mu, sigma), 0.01)
    assert state["used"] == pytest.approx(np.full(4, used)), case


@pytest.mark.parametrize("dt", [0.01, 0.03])
def test_the_friction_in_use_moves_no_faster_than_half_a_unit_a_second(dt: float) -> None:
    state = law()
    for k in range(1, 4):
        follow_friction(PARAMS, state, estimated(np.array([0.6, 0.3, 0.45, 0.4501])), dt)
        assert state["used"] == pytest.approx([0.45 + 0.5 * k * dt, 0.45 - 0.5 * k * dt, 0.45, 0.4501])


def test_what_the_confirmation_gets_are_means_of_the_wheels() -> None:
    """Base over friction, aimed at and in use: the share of the nominal pressure that they need."""
    state = law(base=np.array([0.40, 0.42, 0.5, 0.5]))
    mu = np.array([0.38, 0.40, 0.47, 0.48])
    for _ in range(100):
        follow_friction(PARAMS, state, estimated(mu), 0.01)
    needed = np.mean(state["base"] / mu)
    assert state["confirmed"]["heading"] == pytest.approx(needed)
    assert state["confirmed"]["in_use"] == pytest.approx(needed)
    follow_friction(PARAMS, state, estimated(mu - 0.05), 0.01)
    assert state["confirmed"]["heading"] == pytest.approx(np.mean(state["base"] / (mu - 0.05)))
    assert state["confirmed"]["in_use"] == pytest.approx(np.mean(state["base"] / (mu - 0.005)))


def test_a_friction_that_is_not_a_number_does_not_stick(params) -> None:
    state = law()
    follow_friction(PARAMS, state, estimated(np.full(4, math.nan)), 0.01)
    follow_friction(PARAMS, state, estimated(np.full(4, 0.45)), 0.01)
    assert np.isfinite(state["used"]).all()
    assert np.isfinite(compensated_pressure(params[0], state, 30 * BAR, 0))


def test_the_base_is_what_was_learned() -> None:
    learned = np.zeros(1, LEARNED)
    learned["mu_b"] = [0.4, 0.41, 0.5, 0.51]
    state = law()
    set_base(PARAMS, state, learned[0])
    assert list(state["base"]) == list(state["used"]) == [0.4, 0.41, 0.5, 0.51]


def test_without_compensation_nominal_friction_counts_whatever_was_learned(params) -> None:
    params["compensation"] = OFF
    learned = np.zeros(1, LEARNED)
    learned["mu_b"] = 0.3
    state = law()
    set_base(params[0], state, learned[0])
    follow_friction(params[0], state, estimated(np.full(4, 0.36)), 0.01)
    assert list(state["base"]) == list(state["used"]) == [0.45] * 4


@pytest.mark.parametrize(
    ("case", "began", "level", "sigma", "observed_s", "start"),
    [
        ("rises by a fifth within the braking", 0.40, 0.44, 0.02, 2.0, 0.40 / 0.44),
        ("falls", 0.45, 0.42, 0.02, 2.0, 0.45 / 0.42),
        ("doubles: cannot be all true", 0.30, 0.45, 0.02, 2.0, 0.75),
        ("too unsure", 0.40, 0.44, 0.05, 2.0, 1.0),
        ("too short", 0.40, 0.44, 0.02, 0.9, 1.0),
    ],
)
def test_a_braking_begins_with_another_friction_than_is_learned_of_it(
    case, began, level, sigma, observed_s, start
) -> None:
    """What is learned is the mean over a braking; the next one begins as this one did."""
    state, learned = law(), np.zeros(1, LEARNED)
    learned["mu_b"], ended = level, 0.48
    follow_friction(PARAMS, state, estimated(0.45, observed_s=0.5), 0.01)
    assert not state["early"].any()  # not yet
    follow_friction(PARAMS, state, estimated(began, observed_s=0.61), 0.01)
    follow_friction(PARAMS, state, estimated(ended, observed_s=1.5), 0.01)
    learn_start(state, estimated(ended, sigma, observed_s), learned[0])
    assert state["start"] == pytest.approx(np.full(4, start)), case
    set_base(PARAMS, state, learned[0])
    assert state["base"] == pytest.approx(np.full(4, level * start))
    assert not state["early"].any()


def test_where_brakings_begin_with_another_friction_the_last_one_s_end_is_not_followed() -> None:
    state = law()
    state["start"][:2] = 0.9
    follow_friction(PARAMS, state, estimated(0.5, observed_s=0.59), 0.01)
    assert list(state["used"]) == pytest.approx([0.45, 0.45, 0.455, 0.455])
    follow_friction(PARAMS, state, estimated(0.5, observed_s=0.61), 0.01)
    assert list(state["used"]) == pytest.approx([0.455, 0.455, 0.46, 0.46])


@pytest.mark.parametrize(
    ("case", "cut", "estimate", "after"),
    [
        ("friction falls, pressure is to be had", 0, 0.38, 0.445),
        ("friction falls, pressure is cut: no more is asked for", 1, 0.38, 0.45),
        ("friction rises, pressure is cut: less is asked for", 1, 0.52, 0.455),
    ],
)
def test_friction_in_use_does_not_run_on_while_the_pressure_is_cut(case, cut, estimate, after) -> None:
    state = law()
    state["cut"] = cut
    follow_friction(PARAMS, state, estimated(np.full(4, estimate)), 0.01)
    assert state["used"] == pytest.approx(np.full(4, after)), case


@pytest.mark.parametrize(
    ("case", "compensation", "estimate", "cut", "guarded", "asked", "last"),
    [
        ("friction as known", SECOND_ORDER, 0.45, 0, 0, True, False),
        ("29 % below its base", SECOND_ORDER, 0.45 * 0.71, 0, 0, True, False),
        ("31 % below its base", SECOND_ORDER, 0.45 * 0.69, 0, 0, True, True),
        ("31 % below, nothing asked for", SECOND_ORDER, 0.45 * 0.69, 0, 0, False, False),
        ("31 % below, inverse", INVERSE, 0.45 * 0.69, 0, 0, True, True),
        ("31 % below, nobody compensates", OFF, 0.45 * 0.69, 0, 0, True, False),
        ("31 % above: brakes more than asked, no fade", SECOND_ORDER, 0.45 * 1.31, 0, 0, True, False),
        ("a pressure that cannot be had", SECOND_ORDER, 0.45, 1, 0, True, True),
        ("a pressure cut because the wheel slips", SECOND_ORDER, 0.45, 1, 1, True, False),
        ("not a number", SECOND_ORDER, math.nan, 0, 0, True, False),
    ],
)
def test_when_it_is_reported_that_the_brakes_fade(
    params, case, compensation, estimate, cut, guarded, asked, last
) -> None:
    params["compensation"] = compensation
    state = law()
    state["cut"][2] = cut
    guard, known = np.array([0, 0, guarded, 0]), estimated([0.45, estimate, 0.45, 0.45])
    after = []
    for _ in range(40):
        watch_limit(params[0], state, known, guard, False, 4.0 * asked, 0.01)
        after.append(int(state["at_limit"]))
    assert after[28] == 0, case  # 0.29 s
    assert after[-1] == last, case


def test_what_is_reported_lasts_until_the_brakes_are_released() -> None:
    state, faded, well = law(), estimated(0.3), estimated(0.45)
    seen = []
    for known, decel, cycles in ((faded, 4.0, 40), (well, 4.0, 100), (well, 0.0, 1), (well, 4.0, 40)):
        for _ in range(cycles):
            watch_limit(PARAMS, state, known, np.zeros(4), False, decel, 0.01)
        seen.append(int(state["at_limit"]))
    assert seen == [1, 1, 0, 0]


@pytest.mark.parametrize(
    ("case", "limit", "sigma", "slips", "mu", "decel", "beyond", "faded"),
    [
        ("nothing is known of the road", math.nan, math.nan, False, 0.3, 5.0, 0, 1),
        ("a dry road, linings fade", 9.0, 0.5, False, 0.3, 5.0, 0, 1),
        ("a dry road, all is well", 9.0, 0.5, False, 0.45, 5.0, 0, 0),
        ("the road explains what is missing", 2.5, 0.2, True, 0.45, 5.0, 1, 0),
        ("the road explains it, whatever the linings do", 2.5, 0.2, True, 0.3, 5.0, 1, 0),
        ("within the ceiling's sigma, no wheel slips", 4.9, 0.2, False, 0.45, 5.0, 0, 0),
        ("within its sigma, wheels slip", 4.9, 0.2, True, 0.45, 5.0, 1, 0),
        ("below it wheels slip for another cause", 5.2, 0.2, True, 0.45, 5.0, 0, 0),
        ("nobody asks for anything", 2.5, 0.2, True, 0.3, 0.0, 0, 0),
        ("the request is unknown", 2.5, 0.2, True, 0.3, math.nan, 0, 0),
    ],
)
def test_either_the_ceiling_of_grip_or_the_brakes_are_reported(
    case, limit, sigma, slips, mu, decel, beyond, faded
) -> None:
    state, after = law(), []
    for _ in range(40):
        watch_limit(PARAMS, state, estimated(mu, grip=(limit, sigma)), np.zeros(4), slips, decel, 0.01)
        after.append((int(state["beyond_grip"]), int(state["at_limit"])))
    assert after[28] == (0, 0), case  # 0.29 s
    assert after[-1] == (beyond, faded), case


def test_more_than_the_road_gives_raises_no_pressure() -> None:
    """The friction in use falls no further while the demand is beyond grip; it may rise."""
    state, estimate = law(), estimated(0.3)
    state["beyond_grip"] = 1
    follow_friction(PARAMS, state, estimate, 0.1)
    assert state["used"] == pytest.approx([0.45] * 4)
    state["beyond_grip"] = 0
    follow_friction(PARAMS, state, estimate, 0.1)
    assert (state["used"] < 0.45).all()


def test_the_ideal_controller_of_the_laboratory_is_exact(params) -> None:
    state = law()
    state["mu_override"] = 0.2
    pressure = compensated_pressure(params[0], state, pressure_for_torque(params[0], 500.0, 0.45, 0), 0)
    assert torque_of(pressure, 0.2, 0) == pytest.approx(500.0)
