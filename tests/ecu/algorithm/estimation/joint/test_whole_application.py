"""Learning from whole applications: the filter against matrices, the bend against differences, beliefs."""

import math
from typing import Any

import numpy as np
import pytest

from ecu.algorithm.estimate import ESTIMATE
from ecu.algorithm.estimation.joint.layout import JOINT_STATE, V
from ecu.algorithm.estimation.joint.whole_application import (
    ALONE_KNEE,
    BESIDE_KNEE,
    CEILING,
    GATE,
    GRIP,
    LEAST_S,
    NOISE,
    ONSET_S,
    OVERRUN,
    PAUSE,
    PRIOR,
    PRIOR_MEAN,
    SCALE,
    STEP,
    WHOLE_STATE,
    add_to_whole,
    apply_scale,
    begin_whole,
    bend,
    compare_drive,
    end_whole,
    keep_whole,
    restore_whole,
    tell_whole,
    torque_share,
)
from ecu.algorithm.estimation.joint.window import COPIES
from ecu.contract.records import LEARNED

BAR, GRAVITY, WINDOW_S = 1e5, 9.81, 0.05
SPEED = 30.0  # m/s


class Bystander:
    """An ECU that does not brake, in a car whose signals are exact; its speed is of one sensor."""

    def __init__(self, params: Any) -> None:
        self.params = params[0]
        self.state = np.zeros(1, WHOLE_STATE)[0]
        self.joint = np.zeros(1, JOINT_STATE)[0]
        self.joint["x"][V] = SPEED
        self.joint["speed_copies"] = COPIES + 1
        restore_whole(self.state, np.zeros(1, LEARNED)[0])

    def linings(self, bar: float) -> float:
        """Return the deceleration by linings as configured at a pressure above push-out [m/s^2]."""
        p = self.params
        torque = 2.0 * BAR * p["piston_area"] * p["effective_radius"] * p["mu_nominal"] * bar
        return float((torque / p["wheel_radius"]).sum() / p["mass"])

    def rest(self, decel: float) -> float:
        """Return drag, rolling and what turns the wheels, over the mass [m/s^2], at a deceleration."""
        p = self.params
        wheels = (p["wheel_inertia"] / p["wheel_radius"] ** 2).sum() / p["mass"]
        return float(
            p["drag_area"] * SPEED**2 / p["mass"] + p["rolling_resistance"] * GRAVITY - wheels * decel
        )

    def window(self, bar: float, decel: float, motor: float = 0.0, **others: float) -> None:
        """Set what a window measured; `motor` [N m] of each wheel."""
        w = self.joint["window"]
        w["time"], w["balanced"], w["across"] = WINDOW_S, 1, 0.0
        w["load"] = self.params["static_load"]
        w["common_pressure"], w["common_accel"], w["accel"], w["motor"] = bar, -decel, -decel, motor
        for name, value in others.items():
            w[name] = value
        self.joint["sampling"]["common"] += WINDOW_S

    def brake(self, bars: list[float], decels: list[float], **others: float) -> None:
        """Brake for a window at each pressure [bar], after an onset that does not count."""
        begin_whole(self.params, self.state, self.joint)
        for _ in range(round(ONSET_S / WINDOW_S) + 1):
            self.window(bars[0], 0.0)
            add_to_whole(self.params, self.state, self.joint)
        self.state["time"] = self.state["measured"] = self.state["expected"] = self.state["linings"] = 0.0
        self.state["by_scale"] = self.state["by_grip"] = 0.0
        for bar, decel in zip(bars, decels, strict=True):
            self.window(bar, decel, **others)
            add_to_whole(self.params, self.state, self.joint)
        end_whole(self.state)


@pytest.fixture
def bystander(params: Any) -> Bystander:
    """Return one that has learned nothing."""
    return Bystander(params)


@pytest.mark.parametrize("knee", [ALONE_KNEE, BESIDE_KNEE])
@pytest.mark.parametrize("linings", [0.1, 3.0, 9.0, 14.0, 40.0])
def test_derivatives_of_the_bend_are_those_of_differences(linings: float, knee: float) -> None:
    step, ceiling = 1e-6, 11.0
    _, by_scale, by_grip = bend(linings, ceiling, knee)
    up, down = math.exp(step), math.exp(-step)
    more, less = (bend(linings * by, ceiling, knee)[0] for by in (up, down))
    assert by_scale == pytest.approx((more - less) / (2 * step), rel=1e-5)
    more, less = (bend(linings, ceiling * by, knee)[0] for by in (up, down))
    assert by_grip == pytest.approx((more - less) / (2 * step), rel=1e-5, abs=1e-7)


@pytest.mark.parametrize(
    ("case", "knee", "share", "expected", "within"),
    [
        ("gentle: the linings'", ALONE_KNEE, 0.05, 0.05, 0.001),
        ("wide: a tanh", ALONE_KNEE, 0.5, math.tanh(0.5), 0.03),
        ("wide: a tanh", ALONE_KNEE, 1.0, math.tanh(1.0), 0.01),
        ("wide: a tanh", ALONE_KNEE, 2.0, math.tanh(2.0), 0.03),
        ("sharp: the linings' to 0.6 of the ceiling", BESIDE_KNEE, 0.6, 0.6, 0.008),
        ("asked for far too much: the ceiling", BESIDE_KNEE, 3.0, 1.0, 0.001),
    ],
)
def test_brakes_give_what_linings_ask_up_to_the_ceiling(
    case: str, knee: float, share: float, expected: float, within: float
) -> None:
    assert bend(share * 10.0, 10.0, knee)[0] == pytest.approx(10.0 * expected, rel=within)


def test_the_filter_is_that_of_the_matrices(bystander: Bystander) -> None:
    """Ten applications of random pressure and deceleration beside an extended Kalman filter in numpy."""
    rng = np.random.default_rng(4)
    x, p = PRIOR_MEAN.copy(), np.diag(PRIOR**2)
    for _ in range(10):
        bars = list(rng.uniform(5.0, 80.0, 30))
        decels = [0.9 * bystander.linings(bar) + 0.3 + rng.normal(0.0, 0.5) for bar in bars]
        asked = np.exp(x[SCALE]) * np.array([bystander.linings(bar) for bar in bars])
        bent = np.array([bend(one, CEILING * np.exp(x[GRIP]), ALONE_KNEE) for one in asked])
        h = np.array([bent[:, 1].mean(), bent[:, 2].mean(), 1.0])
        measured = np.mean([decel - bystander.rest(decel) for decel in decels])
        innovation = measured - bent[:, 0].mean() - x[OVERRUN]
        variance = max(float(h @ p @ h) + NOISE**2, (innovation / GATE) ** 2)
        gain = p @ h / variance
        x, p = x + gain * innovation, p - np.outer(gain, gain) * variance + np.diag(STEP**2)
        bystander.brake(bars, decels)
        assert bystander.state["x"] == pytest.approx(x, rel=1e-3, abs=1e-4)
        assert bystander.state["p"] == pytest.approx(p, rel=1e-3, abs=1e-6)


def test_friction_is_learned_below_the_ceiling_and_the_ceiling_above(bystander: Bystander) -> None:
    """Linings of 1.3 on a road that gives 9 m/s^2, cut off hard: another law than the filter's."""
    rng = np.random.default_rng(1)
    bystander.joint["speed_copies"] = -1
    per_bar = bystander.linings(1.0)
    for _ in range(40):
        bars = list(rng.uniform(1.0, 15.0) / per_bar * np.linspace(1.0, 0.6, 30))
        bystander.brake(bars, [min(1.3 * per_bar * bar, 9.0) + bystander.rest(0.0) for bar in bars])
    x = bystander.state["x"]
    assert math.exp(x[SCALE]) == pytest.approx(1.3, rel=0.12)
    assert CEILING * math.exp(x[GRIP]) == pytest.approx(9.0, rel=0.12)


@pytest.mark.parametrize(
    ("case", "windows", "others"),
    [
        ("shorter than judged", round(LEAST_S / WINDOW_S) - 2, {}),
        ("in a curve beyond 0.4 g", 30, {"across": 0.5}),
        ("no two samples at one time", 30, {"balanced": 0}),
    ],
)
def test_an_application_that_was_not_measured_widens_nothing(
    bystander: Bystander, case: str, windows: int, others: dict[str, float]
) -> None:
    before = bystander.state["p"].copy(), bystander.state["x"].copy()
    bystander.brake([30.0] * windows, [5.0] * windows, **others)
    assert (bystander.state["p"] == before[0]).all()
    assert (bystander.state["x"] == before[1]).all()


@pytest.mark.parametrize(
    ("case", "share", "seconds", "counts"),
    [
        ("what is reported arrives", 1.0, 30.0, 1.0),
        ("a mass that is 10 % off", 0.9, 30.0, 1.0),
        ("40 % of it arrives: torque of a crankshaft", 0.4, 30.0, 0.4),
        ("twice as much arrives: another engine drives, too", 2.0, 30.0, 1.5),
        ("40 %, but hardly ever driven yet", 0.4, 1.0, 1.0),
    ],
)
def test_torques_count_as_long_as_they_explain_the_motion(
    bystander: Bystander, case: str, share: float, seconds: float, counts: float
) -> None:
    p = bystander.params
    motor = -0.25 * p["mass"] * 2.0 * float(p["wheel_radius"].mean())  # drives with 2 m/s^2
    bystander.joint["unmeasured_s"] = 0.0
    for _ in range(round(seconds / WINDOW_S)):
        accel = 2.0 * share - bystander.rest(0.0)
        bystander.window(0.0, -accel, motor)
        compare_drive(p, bystander.state, bystander.joint)
    assert torque_share(bystander.state) == pytest.approx(counts, rel=0.02)


def test_what_was_learned_comes_back_less_certain(bystander: Bystander) -> None:
    learned = np.zeros(1, LEARNED)[0]
    state = bystander.state
    state["x"], state["p"] = [0.2, -0.3, 0.5], 0.001 * (np.eye(3) + 0.2)
    keep_whole(state, learned)
    again = np.zeros(1, WHOLE_STATE)[0]
    restore_whole(again, learned)
    assert (again["x"] == state["x"]).all()
    wider = np.minimum(np.diag(state["p"]) + PAUSE**2, PRIOR**2)
    assert again["p"] == pytest.approx(state["p"] + np.diag(wider - np.diag(state["p"])))


@pytest.mark.parametrize(
    ("case", "copies", "mapped", "alone"),
    [
        ("wheels of their own", -1, 1, False),
        ("not yet compared", COPIES, 1, False),
        ("one speed stands for all", COPIES + 1, 1, True),
        ("no wheel speeds", 0, 0, True),
    ],
)
def test_windows_teach_where_each_wheel_is_measured(
    bystander: Bystander, case: str, copies: int, mapped: int, alone: bool
) -> None:
    bystander.params["mapped"] = mapped
    bystander.joint["speed_copies"] = copies
    begin_whole(bystander.params, bystander.state, bystander.joint)
    assert bool(bystander.state["alone"]) == alone
    assert bystander.state["knee"] == (ALONE_KNEE if alone else BESIDE_KNEE)


def test_estimate_and_store_have_the_scale(bystander: Bystander) -> None:
    """Its sigma adds to that of the windows; what the store takes stays within its bounds."""
    p, state = bystander.params, bystander.state
    state["x"], state["p"] = [math.log(1.2), math.log(0.5), 0.4], np.diag([0.03, 0.02, 0.1]) ** 2
    estimate = np.zeros(1, ESTIMATE)[0]
    estimate["mu"], estimate["sigma"] = p["mu_nominal"], 0.04 * p["mu_nominal"]
    state["alone"] = 0
    tell_whole(state, estimate, 1000.0)
    assert estimate["mu"] == pytest.approx(1.2 * p["mu_nominal"])
    assert estimate["sigma"] == pytest.approx(1.2 * p["mu_nominal"] * math.hypot(0.03, 0.04))
    assert estimate["grip_limit"] == pytest.approx(7.0)
    assert estimate["sigma_grip_limit"] == pytest.approx(0.14)
    assert estimate["overrun"] == pytest.approx(0.4)
    learned = np.zeros(1, LEARNED)[0]
    learned["mu_b"], learned["sigma_mu_b"] = 1.4 * p["mu_nominal"], 0.05 * p["mu_nominal"]
    apply_scale(p, state, learned)
    assert learned["mu_b"] == pytest.approx(1.5 * p["mu_nominal"])
