"""When friction is observed, held, handed over: the rules of sections 4.3.2 and 4.4 as tables."""

import math

import numpy as np
import pytest

from ecu.algorithm.estimation.friction import update_pressure
from ecu.algorithm.estimation.thesis.friction import hand_over, restore_friction, update_friction
from ecu.algorithm.step import STATE
from ecu.contract.signals import (
    ACCEL_X,
    ACCELERATOR_POSITION,
    ALIVE,
    CALLIPER_PRESSURE,
    FAULT,
    HOLDING,
    INPUT,
    NOMINAL,
    OBSERVING,
    VALID,
    WHEEL_SPEED,
)

DT = 0.01
BAR = 1e5
NOMINAL_MU = 0.45
RADIUS, LOADS = 0.36, np.array([6000.0, 6000.0, 4300.0, 4300.0])
PER_MU = np.array([2 * math.pi / 4 * d**2 * r for d, r in ((0.060, 0.1205),) * 2 + ((0.034, 0.1288),) * 2])
PUSH_OUT = 0.5  # bar


class Stop:
    """A straight stop in which everything needed is known: friction `mu`, 4 m/s^2 and 25 m/s at the start."""

    def __init__(self, params, feed, mu: float = 0.40) -> None:
        self.params, self.feed, self.inputs, self.mu = params[0], feed, feed(), mu
        self.s = np.zeros(1, STATE)[0]
        self.s["force"]["k_f"] = self.s["force"]["stiffness"] = 1.0
        self.s["wheels"]["radius"], self.s["wheels"]["fresh"] = RADIUS, 1
        self.s["speed"]["started"], self.s["wheel_load"]["load"] = 1, LOADS
        self.speed, self.decel = 25.0, 4.0
        self.pressure = np.array([30.0, 30.0, 30.0, 30.0])  # bar
        self.slip, self.motor = -0.018, 0.0
        restore_friction(self.params, self.s["friction"], self.s["learned"])

    def cycle(self) -> None:
        s, acts = self.s, np.maximum(self.pressure - PUSH_OUT, 0.0) * BAR
        self.speed = max(self.speed - self.decel * DT, 0.0)
        omega = self.speed * (1 + self.slip) / RADIUS
        self.feed(self.inputs, wheel_speed=omega, calliper_pressure=self.pressure, motor_torque=self.motor)
        s["motion"]["accel_x"], s["speed"]["speed"] = -self.decel, self.speed
        s["wheels"]["slip"] = s["wheels"]["expected_slip"] = self.slip
        rolling = self.params["rolling_resistance"] * LOADS * RADIUS
        inertia = self.params["wheel_inertia"] * self.decel / RADIUS
        s["force"]["virtual"] = -(PER_MU * self.mu * acts + rolling + self.motor - inertia) / RADIUS
        s["application"]["braking"] = bool((self.pressure > 1.5).any())
        s["application"]["duration_s"] += DT
        update_pressure(self.params, s["friction"], s["friction"]["mu"], np.zeros(4), self.inputs[0], DT)
        update_friction(
            self.params,
            s["friction"],
            s["observer"],
            s["learned"],
            self.inputs[0],
            s["motion"],
            s["wheels"],
            s["wheel_load"]["load"],
            s["force"],
            s["speed"],
            s["application"],
            DT,
        )

    def run(self, seconds: float) -> np.ndarray:
        """Run on and return the modes at the end."""
        for _ in range(round(seconds / DT)):
            self.cycle()
        return self.s["friction"]["mode"].copy()


@pytest.fixture
def stop(params, feed) -> Stop:
    return Stop(params, feed)


def test_in_a_clean_stop_every_wheel_is_observed_and_found(stop: Stop) -> None:
    assert list(stop.run(0.05)) == [NOMINAL] * 4
    assert list(stop.run(3.0)) == [OBSERVING] * 4
    print("friction found:", stop.s["friction"]["mu"])
    assert stop.s["friction"]["mu"] == pytest.approx(np.full(4, 0.40), rel=0.02)
    assert (stop.s["friction"]["sigma"] < 0.10 * 0.40).all()
    assert stop.s["friction"]["torque"] == pytest.approx(PER_MU * 0.40 * 29.5 * BAR, rel=0.02)


def set_input(name: str, value: float):
    return lambda stop: stop.feed(stop.inputs, **{name: value})


def lose(place: int, verdict: int):
    return lambda stop: stop.inputs[0]["verdict"].__setitem__(place, verdict)


def put(field: str, value: float):
    return lambda stop: setattr(stop, field, value)


ALL = (0, 1, 2, 3)
RULES = [
    # case, what happens during the stop, wheels that stop observing, their mode
    ("ABS works", set_input("abs_active", 1.0), ALL, HOLDING),
    ("ESP works", set_input("esp_active", 1.0), ALL, HOLDING),
    ("reverse gear", set_input("reverse", 1.0), ALL, HOLDING),
    ("driver accelerates against the brakes", set_input("accelerator_position", 10.0), ALL, HOLDING),
    ("below 15 km/h", put("speed", 15 / 3.6 - 0.05), ALL, HOLDING),
    ("just above 15 km/h", put("speed", 15 / 3.6 + 3.0), (), OBSERVING),
    ("brakes released", put("pressure", np.zeros(4)), ALL, HOLDING),
    ("front brakes released", put("pressure", np.array([0.0, 0.0, 30.0, 30.0])), (0, 1), HOLDING),
    ("hardly any deceleration", put("decel", 0.5), ALL, HOLDING),
    ("enough for the front axle only", put("decel", 1.5), (2, 3), HOLDING),
    ("wheels lock", put("slip", -0.5), ALL, HOLDING),
    ("wheel speed fl invalid", lose(WHEEL_SPEED, ALIVE), (0,), FAULT),
    ("wheel speed rr stale", lose(WHEEL_SPEED + 3, VALID), (3,), FAULT),
    ("pressure fr lost", lose(CALLIPER_PRESSURE + 1, 0), (1,), FAULT),
    ("acceleration lost", lose(ACCEL_X, 0), ALL, FAULT),
]


@pytest.mark.parametrize(("case", "event", "wheels", "mode"), RULES, ids=[row[0] for row in RULES])
def test_what_switches_the_observer_off(stop: Stop, case: str, event, wheels, mode: int) -> None:
    if case == "enough for the front axle only":
        stop.params["activation_decel"] = [1.3, 1.3, 3.0, 3.0]
    stop.run(1.5)
    event(stop)
    before = stop.s["friction"]["mu"].copy()
    # Low-passed pressure needs some cycles to fall after a release.
    fast = {"brakes released", "front brakes released"}
    modes = stop.run(0.10 if case in fast else 0.01)
    for i in ALL:
        assert modes[i] == (mode if i in wheels else OBSERVING), f"{case}, wheel {i}"
    if case not in fast:
        for i in wheels:
            assert stop.s["friction"]["mu"][i] == pytest.approx(before[i], rel=0.005), "held"


@pytest.mark.parametrize("case", ["abs_active", "esp_active"])
def test_it_observes_again_afterwards(stop: Stop, case: str) -> None:
    stop.run(1.0)
    stop.feed(stop.inputs, **{case: 1.0})
    assert list(stop.run(0.3)) == [HOLDING] * 4
    stop.feed(stop.inputs, **{case: 0.0})
    assert list(stop.run(0.5)) == [OBSERVING] * 4


@pytest.mark.parametrize("event", ["abs_active", "esp_active", "reverse", "accelerator_position"])
def test_it_does_not_begin_while_it_must_hold(stop: Stop, event: str) -> None:
    stop.feed(stop.inputs, **{event: 50.0 if event == "accelerator_position" else 1.0})
    assert list(stop.run(1.0)) == [NOMINAL] * 4
    assert stop.s["friction"]["mu"] == pytest.approx(np.full(4, NOMINAL_MU))


def test_an_accelerator_that_is_lost_does_not_stop_it(stop: Stop) -> None:
    stop.feed(stop.inputs, accelerator_position=50.0)
    stop.inputs[0]["verdict"][ACCELERATOR_POSITION] = 0
    assert list(stop.run(1.0)) == [OBSERVING] * 4


def test_sigma_of_a_held_estimate_grows_to_that_of_nothing_known(stop: Stop) -> None:
    stop.run(2.0)
    stop.pressure = np.zeros(4)
    stop.run(0.2)
    held = stop.s["friction"]["sigma"].copy()
    stop.run(10.0)
    later = stop.s["friction"]["sigma"].copy()
    assert (later > held).all()
    assert (later <= 0.15 * NOMINAL_MU * (1 + 1e-9)).all()


@pytest.mark.parametrize(("mu", "bound"), [(0.10, 0.5 * NOMINAL_MU), (0.95, 1.5 * NOMINAL_MU)])
def test_friction_stays_within_half_and_one_and_a_half_of_nominal(params, feed, mu, bound) -> None:
    stop = Stop(params, feed, mu)
    stop.speed = 60.0
    for _ in range(900):
        stop.cycle()
        assert (stop.s["friction"]["mu"] >= 0.5 * NOMINAL_MU - 1e-12).all()
        assert (stop.s["friction"]["mu"] <= 1.5 * NOMINAL_MU + 1e-12).all()
    assert stop.s["friction"]["mu"] == pytest.approx(np.full(4, bound))


@pytest.mark.parametrize(
    ("case", "observed_s", "relative_sigma", "learned"),
    [
        ("long and sure", 2.0, 0.05, True),
        ("just long enough", 1.0, 0.05, True),
        ("too short", 0.99, 0.05, False),
        ("just sure enough", 2.0, 0.0999, True),
        ("not sure", 2.0, 0.1001, False),
        ("neither", 0.2, 0.3, False),
        ("not observed", 0.0, 0.01, False),
    ],
)
def test_what_becomes_the_base_of_the_next_braking(params, case, observed_s, relative_sigma, learned) -> None:
    s = np.zeros(1, STATE)[0]
    restore_friction(params[0], s["friction"], s["learned"])
    s["friction"]["mu"], s["friction"]["observed_s"] = 0.40, observed_s
    s["friction"]["sigma"] = relative_sigma * 0.40
    hand_over(s["friction"], s["learned"])
    expected = 0.40 if learned else NOMINAL_MU
    assert s["learned"]["mu_b"] == pytest.approx(np.full(4, expected)), case
    assert s["friction"]["mu"] == pytest.approx(np.full(4, expected)), case
    assert (s["learned"]["observed_s"] > 0).all() == learned
    assert s["learned"]["brakings"] == 1
    assert not s["friction"]["observed_s"].any()


def test_wheels_are_handed_over_one_by_one(params) -> None:
    s = np.zeros(1, STATE)[0]
    restore_friction(params[0], s["friction"], s["learned"])
    s["friction"]["mu"] = 0.40
    s["friction"]["observed_s"], s["friction"]["sigma"] = [3.0, 0.5, 3.0, 3.0], [0.02, 0.02, 0.09, 0.02]
    hand_over(s["friction"], s["learned"])
    assert list(s["learned"]["mu_b"]) == [0.40, NOMINAL_MU, NOMINAL_MU, 0.40]


@pytest.mark.parametrize(("observed_s", "mode", "mu"), [(0.0, NOMINAL, NOMINAL_MU), (5.0, HOLDING, 0.38)])
def test_a_new_life_begins_with_what_was_learned(params, observed_s, mode, mu) -> None:
    s = np.zeros(1, STATE)[0]
    s["learned"]["mu_b"], s["learned"]["sigma_mu_b"], s["learned"]["observed_s"] = 0.38, 0.02, observed_s
    restore_friction(params[0], s["friction"], s["learned"])
    assert list(s["friction"]["mode"]) == [mode] * 4
    assert s["friction"]["mu"] == pytest.approx(np.full(4, mu))


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize(
    "spoil",
    [
        lambda s, v: s["observer"]["mu"].__setitem__(1, v),
        lambda s, v: s["observer"]["omega"].__setitem__(1, v),
        lambda s, v: s["observer"]["p"].__setitem__((1, 2), v),
    ],
    ids=["friction", "wheel speed", "covariance"],
)
def test_a_filter_that_is_not_finite_begins_anew_and_says_so(stop: Stop, spoil, value: float) -> None:
    stop.run(1.0)
    spoil(stop.s, value)
    stop.cycle()
    assert stop.s["friction"]["reset"] == 1
    assert np.isfinite(stop.s["friction"]["mu"]).all()
    stop.cycle()
    assert stop.s["friction"]["reset"] == 0
    stop.run(1.5)
    assert stop.s["friction"]["mu"] == pytest.approx(np.full(4, 0.40), rel=0.03)
    assert np.isfinite(stop.s["friction"]["sigma"]).all()


@pytest.mark.parametrize("value", [math.nan, math.inf])
@pytest.mark.parametrize("signal", ["virtual force", "pressure"])
def test_an_input_that_is_not_finite_leaves_no_trace(stop: Stop, signal: str, value: float) -> None:
    stop.run(1.0)
    if signal == "pressure":
        stop.pressure = np.array([30.0, value, 30.0, 30.0])
        stop.cycle()
        stop.pressure = np.full(4, 30.0)
    else:
        stop.mu = value
        stop.cycle()
        stop.mu = 0.40
    assert np.isfinite(stop.s["friction"]["mu"]).all()
    stop.run(2.0)
    assert stop.s["friction"]["mu"] == pytest.approx(np.full(4, 0.40), rel=0.03)
    assert np.isfinite(stop.s["friction"]["torque"]).all()


@pytest.mark.parametrize("motor", [-60.0, 0.0, 300.0])
def test_motor_torque_is_not_taken_for_friction(params, feed, motor: float) -> None:
    """Positive regenerates: the tyre then holds more than the friction brake gives."""
    stop = Stop(params, feed)
    stop.motor = motor
    assert list(stop.run(3.0)) == [OBSERVING] * 4
    assert stop.s["friction"]["mu"] == pytest.approx(np.full(4, 0.40), rel=0.02)


def test_motors_that_drive_against_the_brakes_teach_nothing(params, feed) -> None:
    stop = Stop(params, feed)
    stop.motor = -300.0
    assert OBSERVING not in list(stop.run(3.0))


def test_process_noise_follows_the_deceleration_asked_for_or_the_measured_one(params, feed) -> None:
    """Section 4.4. A gentle demand widens the filter; without a demand the car's 4 m/s^2 count."""
    variances = []
    for asked, usable in ((4.0, True), (0.5, True), (0.5, False)):
        stop = Stop(params, feed)
        stop.feed(stop.inputs, decel_demand=asked, decel_demand_valid=1.0)
        if not usable:
            stop.inputs[0]["verdict"][[INPUT["pedal_position"], INPUT["decel_demand"]]] = 0
        stop.run(1.0)
        variances.append(stop.s["observer"]["p"][0, 3])
    hard, gentle, measured = variances
    assert gentle > 1.5 * hard
    assert measured == hard


@pytest.mark.parametrize(("transducers", "mode"), [(0, HOLDING), (1, OBSERVING)])
def test_strong_variations_of_k_f_stop_it_where_forces_are_not_measured(stop, transducers, mode) -> None:
    stop.run(1.0)
    stop.s["force"]["residual"], stop.s["force"]["measured"] = 0.4**2, transducers
    assert list(stop.run(0.05)) == [mode] * 4
