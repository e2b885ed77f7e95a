"""Wear on board: closed forms of the integrals (7.16), laws, chamfers, measured thicknesses, restarts."""

import math
from typing import Any

import numpy as np
import pytest

from ecu.algorithm.monitoring.pad_geometry import mass_of, thickness_lost
from ecu.algorithm.monitoring.wear import LEG, WEAR_STATE, restore_wear, update_wear
from ecu.algorithm.monitoring.wear_belief import NEW_SIGMA, mass_by_law
from ecu.algorithm.step import new_state
from ecu.contract.records import N_LEGS, N_MEASURED
from ecu.pads import add_measurement, fit_new
from ecu.recording.learned_range import wear_out_of_range

DT = 0.01  # s
TORQUE = 1500.0  # N m
HEAT = 150.0  # degC
LAW = np.array([0.1016, 0.0, 0.3984e-6, 0.4887, 0.0, 0.0, 0.66e-2])  # Table 7.1


class Brakes:
    """Four equal brakes with given torque, wheel speed and temperature."""

    def __init__(self, params, feed) -> None:
        self.params, self.p, self.inputs = params, params[0], feed()
        self.s = new_state(params)[0]
        self.s["estimate"]["mu"], self.s["estimate"]["sigma"] = 0.45, 0.0
        self.s["discs"]["sigma"] = 0.0
        self.s["application"]["braking"] = 1

    @property
    def kept(self) -> Any:
        return self.s["learned"]["wear"]

    def cycle(self, omega: float, torque: float = TORQUE, heat: float = HEAT, speed: float = 0.0) -> None:
        discs = self.s["discs"]
        discs["omega"], discs["power"], discs["temperature"] = omega, torque * omega, heat
        self.s["estimate"]["speed"] = speed
        update_wear(
            self.p, self.s["wear"], self.s["learned"], self.inputs[0], self.s["estimate"], discs,
            self.s["application"], DT,
        )  # fmt: skip

    def settle(self, omega: float, slope: float) -> None:
        """Let the low-passes have followed a speed with that slope, as they have after a second."""
        self.s["wear"]["speed"], self.s["wear"]["slowing"] = omega - 0.1 * slope, -slope

    def stop(self, seconds: float, first: float, slope: float, **values: float) -> np.ndarray:
        """Brake with a wheel speed that changes linearly; return what corner 0's regressors gained."""
        before = self.kept["regressors"][:, 0].copy()
        self.settle(first, slope)
        for k in range(round(seconds / DT)):
            self.cycle(first + slope * (k + 0.5) * DT, **values)
        return self.kept["regressors"][:, 0] - before

    def end(self) -> None:
        self.s["application"]["ended"], self.s["application"]["braking"] = 1, 0
        self.cycle(0.0)


@pytest.fixture
def brakes(params, feed) -> Brakes:
    return Brakes(params, feed)


def test_the_integrals_are_those_of_a_constant_torque_and_a_linear_speed(brakes):
    """T w: work; T |w'|: torque times the change of speed; (T w)^2: a cubic of the speed."""
    seconds, first, slope = 5.0, 80.0, -12.0
    last = first + slope * seconds
    work = 1e-6 * TORQUE * 0.5 * (first + last) * seconds
    rate = 1e-6 * TORQUE * (first - last)
    square = (1e-6 * TORQUE) ** 2 * (first**3 - last**3) / (3 * -slope)
    expected = [work, work * HEAT, work * HEAT**2, rate, rate * HEAT, square, square * HEAT]
    np.testing.assert_allclose(brakes.stop(seconds, first, slope), expected, rtol=2e-3)


def test_with_the_sign_of_the_print_the_same_stop_would_put_material_back(brakes):
    """A stop from 20 m/s with 3 m/s^2: the term in |w'| is 2 gamma_20 / (gamma_10 t) of that in T_b w."""
    seconds = 20.0 / 3.0
    x = brakes.stop(seconds, 20.0 / 0.35, -3.0 / 0.35)
    ratio = LAW[3] * x[3] / (LAW[0] * x[0])
    assert ratio == pytest.approx(2.0 * LAW[3] / (LAW[0] * seconds), rel=0.02)
    assert ratio > 1.0  # subtracted it would leave less than nothing
    assert LAW @ x > LAW[:3] @ x[:3]


def test_noise_of_the_wheel_speed_is_not_rectified_into_wear(brakes):
    noise = np.random.default_rng(4).normal(0.0, 0.1, 2000)
    brakes.settle(50.0, 0.0)
    for value in noise:
        brakes.cycle(50.0 + value)
    slope = brakes.kept["regressors"][3, 0] / (1e-6 * TORQUE * len(noise) * DT)
    assert slope < 0.3  # rad/s^2; differences of the samples would give 11


QUIET = {
    "released": {"braking": 0, "omega": 50.0},
    "standing": {"braking": 1, "omega": 0.0},
}


@pytest.mark.parametrize("case", QUIET.values(), ids=QUIET)
def test_nothing_wears_without_both_pressure_and_sliding(brakes, case):
    brakes.s["application"]["braking"] = case["braking"]
    for _ in range(100):
        brakes.cycle(case["omega"])
    assert not brakes.kept["regressors"].any()


def test_a_winter_s_braking_is_kept_and_what_no_disc_can_have_is_not(brakes):
    brakes.s["estimate"]["sigma"], brakes.s["discs"]["sigma"] = 0.04, 10.0
    brakes.stop(3.0, 60.0, -10.0, heat=-20.0)
    brakes.end()
    assert brakes.kept["regressors"][1, 0] < 0.0  # energy by a temperature below zero
    assert wear_out_of_range(np.array([brakes.kept])) == ""
    brakes.kept["regressors"][1, 0] *= 6.0
    assert wear_out_of_range(np.array([brakes.kept])) == "regressors"


def test_wear_recomputed_by_another_law_is_what_that_law_would_have_counted(params, feed):
    """Regressors are linear in the coefficients: integrate then multiply, or multiply then integrate."""
    random = np.random.default_rng(7)
    for law in random.uniform(0.1, 1.0, (3, 7)) * LAW.max():
        brakes = Brakes(params, feed)
        counted = 0.0
        for slope in (-3.0, -8.0, -15.0):
            before = brakes.kept["regressors"][:, 0].copy()
            brakes.stop(2.0, 70.0, slope, torque=random.uniform(300, 3000), heat=random.uniform(40, 400))
            counted += law @ (brakes.kept["regressors"][:, 0] - before)
        params[0]["wear_law"][:, 0] = law
        assert mass_by_law(params[0], brakes.kept["regressors"], 0) == pytest.approx(counted, rel=1e-12)


def test_a_restart_goes_on_where_it_was_and_counts_nothing_twice(params, feed):
    """Killed after any cycle: the record as it was then, put into a new state, ends at the same bits."""
    whole, broken = Brakes(params, feed), Brakes(params, feed)
    for brakes in (whole, broken):
        brakes.settle(80.0, -10.0)
    killed = set(np.random.default_rng(1).integers(0, 500, 100).tolist())
    for k in range(500):
        omega = 80.0 - 0.1 * k
        whole.cycle(omega)
        broken.cycle(omega)
        if k in killed:
            learned = np.array([broken.s["learned"]])
            low_pass = broken.s["wear"]["speed"].copy(), broken.s["wear"]["slowing"].copy()
            broken.s = new_state(params, learned)[0]
            broken.s["application"]["braking"] = 1
            broken.s["estimate"]["mu"] = 0.45
            broken.s["wear"]["speed"], broken.s["wear"]["slowing"] = low_pass
    assert broken.kept["regressors"].tobytes() == whole.kept["regressors"].tobytes()


def test_friction_and_temperature_widen_as_finite_differences_say(brakes, params):
    """d ln m of friction: once for work, twice for power squared; of temperature: the law's slope."""
    brakes.s["estimate"]["sigma"], brakes.s["discs"]["sigma"] = 0.05 * 0.45, 8.0
    x = brakes.stop(4.0, 80.0, -10.0)
    brakes.end()
    kept, p = brakes.kept, brakes.p
    by_friction = mass_by_law(p, kept["friction_error"], 0)
    by_heat = mass_by_law(p, kept["temperature_error"], 0)
    mass = LAW @ x
    stronger = LAW @ (x * np.array([1.05] * 5 + [1.05**2] * 2))
    hotter = Brakes(params, lambda: brakes.inputs)
    assert by_friction == pytest.approx(stronger - mass, rel=0.02)
    x_hot = hotter.stop(4.0, 80.0, -10.0, heat=HEAT + 8.0)
    assert by_heat == pytest.approx(LAW @ x_hot - mass, rel=0.05)


CHAMFERS = {"none": (0.0, 0.0), "deep": (4.0, 0.3), "shallow": (1.0, 0.6)}


@pytest.mark.parametrize(("depth", "share"), CHAMFERS.values(), ids=CHAMFERS)
def test_chamfers_wear_faster_first_and_mass_and_thickness_agree(params, depth, share):
    p = params[0]
    p["chamfer_depth"], p["chamfer_share"] = depth, share
    wear = np.linspace(0.0, 9.0, 400)
    area = 1.0 - share * np.clip(1.0 - wear / depth, 0.0, 1.0) if depth else np.ones(400)
    slices = 0.5 * (area[1:] + area[:-1]) * np.diff(wear) * p["pad_mass"][0]
    expected = np.concatenate([[0.0], np.cumsum(slices)])
    masses = [mass_of(p, 0, value) for value in wear]
    np.testing.assert_allclose(masses, expected, rtol=1e-4)
    np.testing.assert_allclose([thickness_lost(p, 0, mass) for mass in masses], wear, atol=1e-9)


def drive(brakes: Brakes, stops: int) -> None:
    """Brake so often, all alike: one is counted and the rest added."""
    before = brakes.kept["regressors"].copy()
    brakes.s["application"]["braking"], brakes.s["application"]["ended"] = 1, 0
    brakes.stop(5.0, 70.0, -12.0)
    brakes.end()
    brakes.kept["regressors"] += (stops - 1) * (brakes.kept["regressors"] - before)


def mass_now(brakes: Brakes) -> tuple[float, float, float]:
    """Return scale, wear [mm] and its deviation at corner 0 as a restart would have them."""
    state = np.zeros(1, WEAR_STATE)[0]
    restore_wear(brakes.p, state, brakes.s["learned"])
    return state["belief"]["scale"][0], state["wear"][0], state["sigma"][0]


def test_one_measurement_is_bayes_rule(brakes):
    """By hand: mass s g with s = 1 ± 0.15, measured ± R: s = 1 + P g (z - g) / (P g^2 + R + new)."""
    fit_new(brakes.kept, "front")
    brakes.p["wear_walk"] = brakes.p["wear_scatter"] = 0.0
    drive(brakes, 300)
    g = mass_by_law(brakes.p, brakes.kept["regressors"], 0)
    per_mm = brakes.p["pad_mass"][0]
    lost, sigma = 1.2 * g / per_mm, 0.1
    add_measurement(brakes.kept, 0, lost, sigma)
    scale, wear, deviation = mass_now(brakes)
    prior, noise, new = 0.15**2, (sigma * per_mm) ** 2, (NEW_SIGMA * per_mm) ** 2
    whole = prior * g * g + new + noise
    assert scale == pytest.approx(1.0 + prior * g * (0.2 * g) / whole)
    assert wear == pytest.approx((g + (whole - noise) / whole * 0.2 * g) / per_mm)
    assert deviation == pytest.approx(math.sqrt((1 - (whole - noise) / whole) * (whole - noise)) / per_mm)


def test_measurements_find_the_scale_of_the_road_and_the_band_holds_the_truth(params, feed):
    """Wear by 0.75 of the law: after three measurements, whatever their order of errors, within the band."""
    for seed in range(10):
        random = np.random.default_rng(seed)
        brakes = Brakes(params, feed)
        fit_new(brakes.kept, "front")
        for _ in range(3):
            drive(brakes, 1000)
            true = 0.75 * mass_by_law(brakes.p, brakes.kept["regressors"], 0) / brakes.p["pad_mass"][0]
            add_measurement(brakes.kept, 0, true + random.normal(0.0, 0.05), 0.05)
        drive(brakes, 1000)
        true = 0.75 * mass_by_law(brakes.p, brakes.kept["regressors"], 0) / brakes.p["pad_mass"][0]
        scale, wear, sigma = mass_now(brakes)
        assert abs(scale - 0.75) < 0.12
        assert abs(wear - true) < 3.0 * sigma
        assert sigma < 0.35  # most of it by the walk of the scale since the last one


def test_measurements_are_worth_something_else_by_another_law(brakes):
    """The law's coefficients are halved: the scale doubles, the wear stays."""
    fit_new(brakes.kept, "front")
    drive(brakes, 400)
    lost = 1.1 * mass_by_law(brakes.p, brakes.kept["regressors"], 0) / brakes.p["pad_mass"][0]
    add_measurement(brakes.kept, 0, lost, 0.01)
    brakes.p["wear_sigma"], brakes.p["wear_scatter"] = 5.0, 0.0  # nothing is known beforehand
    first = mass_now(brakes)
    brakes.p["wear_law"] *= 0.5
    second = mass_now(brakes)
    assert second[0] / first[0] == pytest.approx(2.0, rel=0.01)
    assert second[1] == pytest.approx(first[1], rel=1e-3)


def test_of_too_many_measurements_the_oldest_goes(brakes):
    for k in range(N_MEASURED + 3):
        add_measurement(brakes.kept, 2, 0.1 * k, 0.1)
    assert brakes.kept["measurements"][2] == N_MEASURED
    np.testing.assert_allclose(brakes.kept["measured_wear"][:, 2], 0.1 * np.arange(3, N_MEASURED + 3))
    assert not brakes.kept["measurements"][[0, 1, 3]].any()


def test_new_pads_begin_anew_on_their_axle_only(brakes):
    drive(brakes, 3)
    brakes.kept["odometer"] = 5e6
    rear = brakes.kept["regressors"][:, 2:].copy()
    fit_new(brakes.kept, "front")
    assert not brakes.kept["regressors"][:, :2].any()
    assert brakes.kept["regressors"][:, 2:].tobytes() == rear.tobytes()
    assert brakes.kept["fitted_at"].tolist() == [5e6, 5e6, 0.0, 0.0]


def test_legs_of_equal_length_are_kept_in_a_ring(brakes):
    for leg in range(N_LEGS + 2):
        brakes.kept["odometer"] = (leg + 1) * LEG
        drive(brakes, 1)
    assert brakes.kept["legs"] == N_LEGS + 2
    ends = brakes.kept["leg_ends"][:, 0, 0]
    assert np.argmax(ends) == 1  # the tenth leg
    assert np.argmin(ends) == 2  # the third is the oldest
