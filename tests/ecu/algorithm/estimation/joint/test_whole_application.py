"""Learning from whole applications and from coasting: the filter against matrices, beliefs."""

import math
from typing import Any

import numpy as np
import pytest

from ecu.algorithm.estimate import ESTIMATE
from ecu.algorithm.estimation.joint.drive import compare_drive, torque_share
from ecu.algorithm.estimation.joint.layout import JOINT_STATE, LEVEL, V
from ecu.algorithm.estimation.joint.whole_application import (
    COASTS_FROM_S,
    COASTS_TO_S,
    LEAST_S,
    ONSET_S,
    USUAL,
    WHOLE_STATE,
    add_coasting,
    add_to_whole,
    apply_scale,
    begin_whole,
    end_whole,
    restore_whole,
    tell_whole,
)
from ecu.algorithm.estimation.joint.whole_filter import (
    BEFORE,
    BESIDE,
    BESIDE_DRAG,
    CEILING,
    FALL,
    GATE,
    GREATEST_NOISE,
    GRIP,
    HIGHEST_STATE,
    KNEE,
    LEAST_NOISE,
    MEMORY,
    NOISE,
    NOISE_SHARE,
    OVERRUN,
    PEDAL,
    POWER,
    PRIOR,
    PRIOR_MEAN,
    SCALE,
    STATES,
    STEP,
    USUAL_SPEED,
    bend,
)
from ecu.algorithm.estimation.joint.window import COPIES
from ecu.contract.records import INPUTS, LEARNED
from ecu.contract.signals import ACCEL_X, ACCELERATOR_POSITION, DECEL_DEMAND, DECEL_DEMAND_VALID, USABLE

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
        self.state["by_scale"] = self.state["by_grip"] = self.state["by_power"] = self.state["by_fall"] = 0.0
        for bar, decel in zip(bars, decels, strict=True):
            self.window(bar, decel, **others)
            add_to_whole(self.params, self.state, self.joint)
        end_whole(self.state)


@pytest.fixture
def bystander(params: Any) -> Bystander:
    """Return one that has learned nothing."""
    return Bystander(params)


def test_the_filter_is_that_of_the_matrices(bystander: Bystander) -> None:
    """Fifteen applications of random pressure and deceleration beside an extended Kalman filter in numpy."""
    rng = np.random.default_rng(4)
    x, p, ratio = PRIOR_MEAN.copy(), np.diag(PRIOR**2), 1.0
    found = bystander.state["filter"]
    for number in range(15):
        bars = list(rng.uniform(5.0, 80.0, 30))
        decels = [0.9 * bystander.linings(bar) + 0.3 + rng.normal(0.0, 0.5) for bar in bars]
        asked = np.exp(x[SCALE]) * np.array([bystander.linings(bar) for bar in bars])
        bent = np.array([bend(one, CEILING * np.exp(x[GRIP]), x[FALL]) for one in asked])
        by_scale, by_grip, by_fall = bent[:, 1:].mean(axis=0)
        h = np.array([by_scale, by_grip, 1.0, 0.0, 1.0 / SPEED - 1.0 / USUAL_SPEED, by_fall])
        measured = np.mean([decel - bystander.rest(decel) for decel in decels])
        innovation = measured - bent[:, 0].mean() - h[OVERRUN:FALL] @ x[OVERRUN:FALL]
        usual = NOISE**2 + (NOISE_SHARE * bent[:, 0].mean()) ** 2
        likely = float(h @ p @ h) + ratio * usual
        variance = max(likely, (innovation / GATE) ** 2)
        gain = p @ h / variance
        x, p = x + gain * innovation, p - np.outer(gain, gain) * variance
        p += np.diag(np.where(np.diag(p) < PRIOR**2, ratio * STEP**2, 0.0))
        product = min(innovation**2 * (1.0 - gain @ h), GATE**2 * likely)
        ratio += (product / usual - ratio) / min(BEFORE + number + 1, MEMORY)
        ratio = float(np.clip(ratio, LEAST_NOISE, GREATEST_NOISE))
        bystander.brake(bars, decels)
        assert found["noise_ratio"] == pytest.approx(ratio, rel=1e-3)
        assert found["value"] == pytest.approx(x, rel=1e-3, abs=1e-4)
        assert found["covariance"] == pytest.approx(p, rel=1e-3, abs=1e-6)


@pytest.mark.parametrize(
    ("case", "off", "least", "most"),
    [  # m/s^2 by which the means differ; the bounds of the variance over the usual one
        ("a car as the law says", 0.05, 0.5, 0.6),
        ("a car as the prior says", 0.38, 0.6, 1.6),
        ("a car that brakes otherwise each time", 0.8, 2.0, 4.0),
    ],
)
def test_how_well_the_law_fits_the_car_is_measured(
    bystander: Bystander, case: str, off: float, least: float, most: float
) -> None:
    """Of 40 applications of 4 m/s^2, mean over the last 20."""
    rng, per_bar, found = np.random.default_rng(3), bystander.linings(1.0), []
    for _ in range(40):
        decel = 4.0 + 0.2 + bystander.rest(4.2) + rng.normal(0.0, off)
        bystander.brake([4.0 / per_bar] * 30, [decel] * 30)
        found.append(float(bystander.state["filter"]["noise_ratio"]))
    assert least <= np.mean(found[20:]) <= most


def test_a_road_that_cuts_off_hard_is_learned_as_a_ceiling(bystander: Bystander) -> None:
    """Linings of 1.3 on a road that gives 9 m/s^2 and no more: another law than the filter's."""
    rng = np.random.default_rng(1)
    per_bar = bystander.linings(1.0)
    for _ in range(40):
        bars = list(rng.uniform(1.0, 15.0) / per_bar * np.linspace(1.0, 0.6, 30))
        bystander.brake(bars, [min(1.3 * per_bar * bar, 9.0) + bystander.rest(0.0) for bar in bars])
    x = bystander.state["filter"]["value"]
    ceiling = CEILING * math.exp(x[GRIP])
    assert math.exp(x[SCALE]) == pytest.approx(1.3, rel=0.3)
    assert max(bend(asked, ceiling, x[FALL])[0] for asked in range(1, 40)) == pytest.approx(9.0, rel=0.1)
    for asked in (4.0, 6.0, 8.0, 10.0, 14.0):
        said = bend(math.exp(x[SCALE]) * asked, ceiling, x[FALL])[0] + x[OVERRUN]
        said += x[POWER] * (1.0 / SPEED - 1.0 / USUAL_SPEED)
        assert said == pytest.approx(min(1.3 * asked, 9.0), rel=0.06), asked


@pytest.mark.parametrize(
    ("case", "slips", "apart", "bent"),
    [  # of each wheel, in one window
        ("all roll", (0.0, 0.01, 0.02, 0.0), True, False),
        ("one locks: the other three say where the car is", (1.0, 0.0, 0.0, 0.0), True, False),
        ("both in front are beyond their grip", (0.08, 0.08, 0.0, 0.0), True, True),
        ("all are where a control of slip keeps them", (0.07, 0.07, 0.06, 0.06), True, True),
        ("one speed stands for all", (0.0, 0.0, 0.0, 0.0), False, True),
    ],
)
def test_while_wheels_roll_all_that_linings_ask_for_reaches_the_road(
    bystander: Bystander, case: str, slips: tuple[float, ...], apart: bool, bent: bool
) -> None:
    """Linings of 9 m/s^2: once wheels have slipped, the ceiling may explain what is missing."""
    p, state, joint = bystander.params, bystander.state, bystander.joint
    joint["speed_copies"] = -1 if apart else COPIES + 1
    window = joint["window"]
    window["omega_samples"] = 1
    per_bar = bystander.linings(1.0)
    begin_whole(p, state, joint)
    for number in range(40):
        slip = np.array(slips) if number == 20 else np.zeros(4)
        window["omega"] = SPEED * (1.0 - slip) / p["wheel_radius"]
        bystander.window(9.0 / per_bar, 9.0 + bystander.rest(9.0))
        add_to_whole(p, state, joint)
        if number == 20:
            before = float(state["by_grip"])
    assert (state["by_grip"] > before) == bent
    end_whole(state)
    assert (state["filter"]["value"][GRIP] != 0.0) == bent


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
    before = bystander.state["filter"]["covariance"].copy(), bystander.state["filter"]["value"].copy()
    bystander.brake([30.0] * windows, [5.0] * windows, **others)
    assert (bystander.state["filter"]["covariance"] == before[0]).all()
    assert (bystander.state["filter"]["value"] == before[1]).all()


@pytest.mark.parametrize(
    ("case", "drag", "reported"),
    [
        ("motors with the accelerator released", 2.0, False),
        ("a trailer that brakes, or half the mass", 5.0, True),
    ],
)
def test_a_drag_that_no_car_has_is_reported(
    bystander: Bystander, case: str, drag: float, reported: bool
) -> None:
    """Light and hard applications alike brake by as much more than the linings."""
    p, state, per_bar = bystander.params, bystander.state, bystander.linings(1.0)
    estimate, found = np.ones(1, ESTIMATE)[0], []
    for decel in (1.0, 5.0, 2.0, 6.0, 1.5, 4.0):
        bystander.brake([decel / per_bar] * 30, [decel + drag + bystander.rest(0.0)] * 30)
        estimate["at_bound"] = 0
        tell_whole(p, state, bystander.joint, estimate)
        found.append(bool(estimate["at_bound"]))
    assert any(found) == reported
    assert estimate["overrun"] <= HIGHEST_STATE[OVERRUN]


@pytest.mark.parametrize(
    ("case", "accelerator", "decel_demand", "seconds", "learns"),
    [
        ("neither pedal", 0.0, 0.0, 1.0, True),
        ("the accelerator rests, an engine lags", 0.0, 0.0, COASTS_FROM_S - WINDOW_S, False),
        ("the accelerator", 10.0, 0.0, 1.0, False),
        ("no accelerator is received", math.nan, 0.0, 1.0, False),
        ("the brake, and motors before the pressure", 0.0, 2.0, 1.0, False),
    ],
)
def test_a_car_that_coasts_shows_its_drag(
    bystander: Bystander, case: str, accelerator: float, decel_demand: float, seconds: float, learns: bool
) -> None:
    inputs = np.zeros(1, INPUTS)[0]
    for place, value in (
        (ACCELERATOR_POSITION, accelerator),
        (DECEL_DEMAND, decel_demand),
        (DECEL_DEMAND_VALID, 1.0),
    ):
        inputs["value"][place], inputs["verdict"][place] = value, USABLE
    found = bystander.state["filter"]
    for _ in range(round(seconds / WINDOW_S)):
        bystander.window(0.0, 0.8 + bystander.rest(0.8))
        add_coasting(bystander.params, bystander.state, bystander.joint, inputs)
    power = found["value"][POWER] * (1.0 / SPEED - 1.0 / USUAL_SPEED)
    drag = found["value"][OVERRUN] - found["value"][PEDAL] + power
    assert drag == pytest.approx(0.8 if learns else 0.2, abs=0.15)
    assert (found["covariance"][OVERRUN, OVERRUN] < PRIOR[OVERRUN] ** 2) == learns


def test_coasting_begins_anew_after_the_accelerator(bystander: Bystander) -> None:
    inputs = np.zeros(1, INPUTS)[0]
    inputs["verdict"][ACCELERATOR_POSITION] = USABLE
    for k in range(round(2.0 * COASTS_FROM_S / WINDOW_S)):
        inputs["value"][ACCELERATOR_POSITION] = 10.0 if k % 6 == 5 else 0.0
        bystander.window(0.0, 0.8 + bystander.rest(0.8))
        add_coasting(bystander.params, bystander.state, bystander.joint, inputs)
    assert (bystander.state["filter"]["value"] == PRIOR_MEAN).all()


def test_a_car_that_coasts_for_long_shows_no_more_of_its_drag(bystander: Bystander) -> None:
    """The brake pedal may bring motors before it brings pressure."""
    inputs = np.zeros(1, INPUTS)[0]
    inputs["verdict"][ACCELERATOR_POSITION] = USABLE
    for k in range(round(3.0 * COASTS_TO_S / WINDOW_S)):
        drag = 0.1 if k * WINDOW_S < COASTS_TO_S else 2.0
        bystander.window(0.0, drag + bystander.rest(drag))
        add_coasting(bystander.params, bystander.state, bystander.joint, inputs)
    assert bystander.state["filter"]["value"][OVERRUN] < 0.3


@pytest.mark.parametrize(
    ("case", "share", "seconds", "counts"),
    [
        ("what is reported arrives", 1.0, 30.0, 1.0),
        ("a mass that is 10 % off", 0.9, 30.0, 1.0),
        ("40 % of it arrives: torque of a crankshaft", 0.4, 30.0, 0.4),
        ("twice as much arrives: another engine drives, too", 2.0, 30.0, 2.0),
        ("2.5 times as much: a scale of the signal that is wrong", 2.5, 30.0, 2.5),
        ("more than any scale explains", 9.0, 30.0, 4.0),
        ("40 %, but hardly ever driven yet", 0.4, 1.0, 1.0),
    ],
)
def test_torques_count_as_long_as_they_explain_the_motion(
    bystander: Bystander, case: str, share: float, seconds: float, counts: float
) -> None:
    p = bystander.params
    motor = -0.25 * p["mass"] * 2.0 * float(p["wheel_radius"].mean())  # drives with 2 m/s^2
    bystander.joint["unmeasured_s"] = 0.0
    heavier = 1.0 + bystander.rest(-1.0) - bystander.rest(0.0)  # what turns the wheels
    for _ in range(round(seconds / WINDOW_S)):
        accel = (2.0 * share - bystander.rest(0.0)) / heavier
        bystander.window(0.0, -accel, motor)
        compare_drive(p, bystander.state, bystander.joint)
    assert torque_share(bystander.state) == pytest.approx(counts, rel=0.02)


@pytest.mark.parametrize(
    ("case", "copies", "mapped", "motors", "own", "sliding", "alone"),
    [
        ("torques of all motors and brakes", -1, 1, 1, 1, 0, False),
        ("not yet compared", COPIES, 1, 1, 1, 0, False),
        ("a wheel locks", -1, 1, 1, 1, 3, False),
        ("no motor reports", -1, 1, 0, 1, 0, True),
        ("a pressure for each axle", -1, 1, 1, 0, 0, True),
        ("one speed stands for all", COPIES + 1, 1, 1, 1, 0, True),
        ("no wheel speeds", 0, 0, 1, 1, 0, True),
        ("no wheel has the car's speed: other radii than configured", -1, 1, 1, 1, 4, True),
    ],
)
def test_windows_teach_where_all_torques_and_each_wheel_are_measured(
    bystander: Bystander,
    case: str,
    copies: int,
    mapped: int,
    motors: int,
    own: int,
    sliding: int,
    alone: bool,
) -> None:
    bystander.params["mapped"], bystander.params["sigma_motor_torque"] = mapped, 0.0
    bystander.joint["speed_copies"], bystander.joint["differs"] = copies, own
    bystander.joint["motors"]["samples"], bystander.joint["sliding"] = motors, sliding
    begin_whole(bystander.params, bystander.state, bystander.joint)
    assert bool(bystander.state["alone"]) == alone


def _drive(bystander: Bystander, share: float) -> None:
    """Note of half a minute in which motors drove and a share of their torque arrived."""
    bystander.state["driven"], bystander.state["arrived"] = 100.0, 100.0 * share


@pytest.mark.parametrize(("share", "alone"), [(0.4, True), (2.5, True), (0.9, False)])
def test_windows_teach_nothing_by_torques_of_which_a_share_arrives(
    bystander: Bystander, share: float, alone: bool
) -> None:
    params, joint = bystander.params, bystander.joint
    params["mapped"], params["sigma_motor_torque"] = 1, 0.0
    joint["speed_copies"], joint["differs"], joint["motors"]["samples"] = -1, 1, 1
    _drive(bystander, share)
    begin_whole(params, bystander.state, joint)
    assert bool(bystander.state["alone"]) == alone


def test_windows_teach_nothing_where_no_accelerometer_is_mapped(bystander: Bystander) -> None:
    """The change of speed that stands for it is what the wheels say already."""
    bystander.params["mapped"], bystander.params["sigma_motor_torque"] = 1, 0.0
    bystander.joint["speed_copies"], bystander.joint["differs"] = -1, 1
    bystander.joint["motors"]["samples"] = 1
    for mapped in (1, 0):
        bystander.params["mapped"][ACCEL_X] = mapped
        begin_whole(bystander.params, bystander.state, bystander.joint)
        assert bool(bystander.state["alone"]) == (not mapped)


def test_windows_go_on_from_what_whole_applications_have_learned(bystander: Bystander) -> None:
    """The pressures of an axle are separated at last: the linings' force stays, the scale is 1."""
    joint, state, params = bystander.joint, bystander.state, bystander.params
    params["sigma_motor_torque"], joint["speed_copies"], joint["motors"]["samples"] = 0.0, -1, 1
    begin_whole(params, state, joint)
    state["filter"]["value"][SCALE] = -0.3
    joint["differs"] = 1
    begin_whole(params, state, joint)
    assert not state["alone"]
    assert state["filter"]["value"][SCALE] == 0.0
    assert joint["x"][LEVEL : LEVEL + 4] == pytest.approx(-0.3)
    assert joint["kept_x"][:, LEVEL : LEVEL + 4] == pytest.approx(-0.3)
    begin_whole(params, state, joint)
    assert joint["x"][LEVEL : LEVEL + 4] == pytest.approx(-0.3)


@pytest.mark.parametrize(
    ("case", "own", "bar", "scale", "drag"),
    [  # sigma of scale and drag after a braking, at most
        ("windows teach: the scale is next to 1, the drag to 0", 1, 40.0, BESIDE, BESIDE_DRAG),
        ("nothing but whole applications", 0, 40.0, PRIOR[SCALE], PRIOR[OVERRUN]),
        ("windows would, but the brakes were held at rest alone", 1, 0.0, PRIOR[SCALE], PRIOR[OVERRUN]),
    ],
)
def test_what_windows_teach_is_not_learned_twice(
    bystander: Bystander, case: str, own: int, bar: float, scale: float, drag: float
) -> None:
    joint, state, params = bystander.joint, bystander.state, bystander.params
    params["sigma_motor_torque"], joint["speed_copies"], joint["motors"]["samples"] = 0.0, -1, 1
    joint["differs"] = own
    for _ in range(5):
        decel = 1.1 * bystander.linings(bar) + bystander.rest(0.0) if bar else 0.0
        bystander.brake([bar] * 30, [decel] * 30)
    found = np.sqrt(np.diag(state["filter"]["covariance"]))
    assert 0.2 * scale < found[SCALE] < 1.01 * scale
    assert 0.2 * drag < found[OVERRUN] < 1.01 * drag
    if bar == 0.0:
        assert (found == PRIOR).all()
    assert (abs(state["filter"]["value"][OVERRUN]) < BESIDE_DRAG) == (own == 1 and bar > 0.0)
    tell_whole(params, state, joint, estimate := np.ones(1, ESTIMATE)[0])
    assert (abs(estimate["overrun"]) < BESIDE_DRAG) == (own == 1)


@pytest.mark.parametrize(
    ("case", "bar", "decel", "teaches"),
    [
        ("linings that brake", 15.0, 1.0, True),
        ("hardly any linings, but the motors brake: it tells the drag", 2.0, 2.0, True),
        ("hardly any of both", 2.0, 0.5, False),
    ],
)
def test_a_light_braking_teaches_where_the_car_slows(
    bystander: Bystander, case: str, bar: float, decel: float, teaches: bool
) -> None:
    before = bystander.state["filter"]["value"].copy()
    bystander.brake([bar] * 30, [decel] * 30)
    assert bool((bystander.state["filter"]["value"] != before).any()) == teaches
    taught = bystander.state.copy()
    end_whole(bystander.state)
    assert not teaches or bystander.state == taught  # once
    assert bystander.state["usual"] == (USUAL if bar < 10.0 else pytest.approx(bystander.linings(bar)))


def test_how_the_linings_share_the_force_is_not_shown_by_their_sum(bystander: Bystander) -> None:
    """Beside 20,000 draws of four frictions whose sum at equal pressures is known."""
    p, joint, state = bystander.params, bystander.joint, bystander.state
    common, axle = np.full((4, 4), 0.13**2), np.kron(np.eye(2), np.full((2, 2), 0.17**2))
    levels = common + axle + np.diag(np.full(4, 0.04**2))
    joint["p"][LEVEL : LEVEL + 4, LEVEL : LEVEL + 4], joint["closed"] = levels, 1
    state["alone"], state["filter"]["covariance"] = 1, np.zeros((STATES, STATES))
    estimate = np.zeros(1, ESTIMATE)[0]
    estimate["mu"], estimate["sigma"] = p["mu_nominal"], 0.5 * p["mu_nominal"]
    tell_whole(p, state, joint, estimate)
    lever = p["mu_nominal"] * p["piston_area"] * p["effective_radius"] / p["wheel_radius"]
    drawn = np.random.default_rng(1).multivariate_normal(np.zeros(4), levels, 20_000)
    apart = drawn - (drawn @ lever / lever.sum())[:, None]
    assert estimate["sigma"] / estimate["mu"] == pytest.approx(apart.std(axis=0), rel=0.03)


def test_estimate_and_store_have_the_scale(bystander: Bystander) -> None:
    """Its sigma adds to that of the windows; what the store takes stays within its bounds."""
    p, state = bystander.params, bystander.state
    state["filter"]["value"] = [math.log(1.2), math.log(0.5), 0.4, 0.0, 1.5, 0.2]
    state["filter"]["covariance"] = np.diag([0.03, 0.02, 0.1, 0.0, 0.0, 0.0]) ** 2
    estimate = np.zeros(1, ESTIMATE)[0]
    estimate["mu"], estimate["sigma"] = p["mu_nominal"], 0.04 * p["mu_nominal"]
    state["alone"] = 0
    tell_whole(p, state, bystander.joint, estimate)
    assert estimate["mu"] == pytest.approx(1.2 * p["mu_nominal"])
    assert estimate["sigma"] == pytest.approx(1.2 * p["mu_nominal"] * math.hypot(0.03, 0.04))
    assert estimate["grip_limit"] == pytest.approx(7.0 * 0.9)
    assert estimate["sigma_grip_limit"] == pytest.approx(0.14 * 0.9)
    assert (estimate["overrun_power"], estimate["grip_knee"], estimate["grip_fall"]) == (1.5, KNEE, 0.2)
    assert estimate["overrun"] == pytest.approx(0.4)  # no torque is said to be known
    assert estimate["sigma_overrun"] == pytest.approx(math.hypot(0.1, NOISE))
    learned = np.zeros(1, LEARNED)[0]
    learned["mu_b"], learned["sigma_mu_b"] = 1.4 * p["mu_nominal"], 0.05 * p["mu_nominal"]
    apply_scale(p, state, learned)
    assert learned["mu_b"] == pytest.approx(1.5 * p["mu_nominal"])
