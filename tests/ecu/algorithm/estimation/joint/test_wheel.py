"""Prediction of wheels and car: the tyre against the Magic Formula, derivatives against differences."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from ecu.algorithm.estimation.joint import layout
from ecu.algorithm.estimation.joint.balance import BALANCE_FLOOR, BALANCE_SHARE, predict_balance
from ecu.algorithm.estimation.joint.layout import (
    CHANGE,
    DEFLECTION_GAIN,
    DRIVE,
    LEVEL,
    LOAD,
    MASS,
    MOTOR,
    OFFSET,
    PEAK,
    PEAK_LOAD,
    RADIUS,
    ROLLING,
    SIDE,
    SLIP_ERROR,
    STIFFNESS,
    N,
    V,
)
from ecu.algorithm.estimation.joint.prior import PRIOR
from ecu.algorithm.estimation.joint.wheel import (
    LINEAR_FROM,
    NOMINAL_PEAK,
    SHAPE,
    combined_slip,
    peak_adhesion,
    slip_of_force,
    unknown_share,
)
from ecu.algorithm.estimation.joint.wheel_speed import predict_wheel


def name_of(place: int) -> str:
    """Return a state's name, with its number where there are several."""
    starts = {
        name: at for name, at in vars(layout).items() if name.isupper() and type(at) is int and name != "N"
    }
    name = max((name for name in starts if starts[name] <= place), key=lambda name: starts[name])
    return f"{name} {place - starts[name]}"


def magic_formula(slip: float, stiffness: float, peak: float) -> float:
    """Return the adhesion used; E = 0, slope `stiffness` at zero."""
    return peak * math.sin(SHAPE * math.atan(stiffness / (SHAPE * peak) * slip))


def by_root(used: float, stiffness: float, peak: float) -> float:
    """Return the slip of the rising branch at which the Magic Formula gives `used`."""
    top = math.tan(0.5 * math.pi / SHAPE) * SHAPE * peak / stiffness
    return brentq(lambda slip: magic_formula(slip, stiffness, peak) - used, -top, top, xtol=1e-15)


TYRES = [(22.0, 0.9), (15.0, 0.9), (30.0, 1.1), (22.0, 0.4)]  # stiffness per load, peak adhesion
SHARES = [0.0, 0.01, 0.2, 0.5, 0.8, 0.92]  # of the peak


@pytest.mark.parametrize("share", [*SHARES, *(-s for s in SHARES[1:])])
@pytest.mark.parametrize(("stiffness", "peak"), TYRES)
def test_slip_is_the_magic_formulas_root(stiffness: float, peak: float, share: float) -> None:
    used, step = share * peak, 1e-5
    slip, slope = slip_of_force(used, stiffness, peak)
    assert slip == pytest.approx(by_root(used, stiffness, peak), abs=1e-12)
    ahead, behind = (by_root(used + d, stiffness, peak) for d in (step, -step))
    assert slope == pytest.approx((ahead - behind) / (2 * step), rel=1e-6)


def test_at_zero_its_slope_is_one_over_the_stiffness() -> None:
    assert slip_of_force(0.0, 22.0, 0.9) == (0.0, pytest.approx(1 / 22.0))


@pytest.mark.parametrize(("stiffness", "peak"), TYRES)
@pytest.mark.parametrize("used", [0.05, 0.3, 0.36, 0.5, 0.95, 1.5])
@pytest.mark.parametrize("across", [0.0, 0.1, 0.4])
def test_slip_is_odd_along_and_even_across(used: float, across: float, stiffness: float, peak: float) -> None:
    slip, slope, by_peak = combined_slip(used, across, stiffness, peak)
    assert combined_slip(-used, across, stiffness, peak) == (-slip, slope, -by_peak)
    assert combined_slip(used, -across, stiffness, peak) == (slip, slope, by_peak)


@pytest.mark.parametrize(("stiffness", "peak"), TYRES)
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_slip_goes_on_straight_beyond_the_steepest_point(sign: float, stiffness: float, peak: float) -> None:
    edge = sign * LINEAR_FROM * peak
    slip, slope = slip_of_force(edge, stiffness, peak)
    for off in (-1e-9, 1e-9):
        near, near_slope = slip_of_force(edge + off, stiffness, peak)
        assert near == pytest.approx(slip, abs=1e-8)
        assert near_slope == pytest.approx(slope, rel=1e-6)
    for beyond in (0.1, 1.0):
        assert slip_of_force(edge + sign * beyond, stiffness, peak) == (
            pytest.approx(slip + sign * beyond * slope),
            slope,
        )


@pytest.mark.parametrize("across", [0.05, 0.2, 0.5])
@pytest.mark.parametrize("used", [-0.6, -0.2, 0.0, 0.3])
def test_combined_slip_points_where_the_force_does(used: float, across: float) -> None:
    both, step = math.hypot(used, across), 1e-6
    slip, slope, by_peak = combined_slip(used, across, 22.0, 0.9)
    assert slip == pytest.approx(by_root(both, 22.0, 0.9) * used / both, abs=1e-12)
    ahead, behind = (combined_slip(used + d, across, 22.0, 0.9)[0] for d in (step, -step))
    assert slope == pytest.approx((ahead - behind) / (2 * step), rel=1e-6)
    ahead, behind = (combined_slip(used, across, 22.0, 0.9 * math.exp(d))[0] for d in (step, -step))
    assert by_peak == pytest.approx((ahead - behind) / (2 * step), rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("used", [-0.7, -0.3, 0.0, 0.3])
def test_combined_slip_is_the_longitudinal_one_where_nothing_is_carried_across(used: float) -> None:
    alone = slip_of_force(used, 22.0, 0.9)
    assert combined_slip(used, 0.0, 22.0, 0.9)[:2] == alone
    assert combined_slip(used, 1e-6, 22.0, 0.9)[:2] == pytest.approx(alone, rel=1e-9)


POINTS = {
    # speed [m/s], decel [m/s^2], front and rear bar, front and rear motor [N m], across
    "coasting": (30.0, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0),
    "driving": (20.0, -1.5, 0.0, 0.0, -250.0, -400.0, 0.0),
    "motor braking": (25.0, 2.0, 0.0, 0.0, 250.0, 500.0, 0.0),
    "braking, 2 m/s^2": (25.0, 2.0, 19.0, 18.0, 0.0, 0.0, 0.0),
    "braking, 4 m/s^2": (33.0, 4.0, 39.0, 36.0, 0.0, 0.0, 0.0),
    "braking, 8 m/s^2": (20.0, 8.0, 66.0, 75.0, 0.0, 0.0, 0.0),
    "braking and regenerating": (15.0, 4.0, 20.0, 15.0, 250.0, 200.0, 0.0),
    "braking in a curve": (20.0, 3.0, 29.0, 26.0, 0.0, 0.0, 0.3),
    "front beyond the tyre's range": (20.0, 8.0, 110.0, 30.0, 0.0, 0.0, 0.0),
}


def set_point(params, state, point: str, balanced: bool = False) -> None:
    """Write an operating point into the window, the smooth pressure being the pressure itself."""
    speed, decel, front, rear, motor_front, motor_rear, across = POINTS[point]
    w, car = state["window"], params
    random = np.random.default_rng(5)
    state["x"][:] = 0.3 * PRIOR * random.standard_normal(N)  # nowhere special
    state["x"][LEVEL : LEVEL + 4] = 0.1 * random.standard_normal(4)
    state["x"][CHANGE : CHANGE + 2] = 0.05 * random.standard_normal(2)
    state["x"][OFFSET : OFFSET + 2] = 0.2, 0.3  # nothing frees them; below zero released brakes would brake
    state["x"][MOTOR] = 0.01
    state["x"][V] = speed
    transfer = car["mass"] * decel * car["cog_height"] / car["wheelbase"] / 2
    w["load"] = car["static_load"] + transfer * np.array([1, 1, -1, -1])
    w["motor"] = state["motors"]["last_smooth"] = np.repeat([motor_front, motor_rear], 2)
    w["pressure"] = w["common_pressure"] = state["last_smooth"] = np.repeat([front, rear], 2)
    w["change"] = w["accel"] = w["common_accel"] = -decel
    w["across"], w["lateral"] = across, 150.0 * (across > 0)
    if balanced:
        w["common_accel"] -= predict_balance(car, state, front > 0) / math.exp(state["x"][MASS])
        assert predict_balance(car, state, front > 0) == pytest.approx(0.0, abs=1e-12)
    state["last_smooth_accel"] = w["common_accel"]


def differences(state, predict, steps: np.ndarray) -> np.ndarray:
    """Return central differences of a prediction by every state."""
    out = np.zeros(N)
    for j in range(N):
        kept, values = state["x"][j], []
        for sign in (1, -1):
            state["x"][j] = kept + sign * steps[j]
            values.append(predict())
        state["x"][j] = kept
        out[j] = (values[0] - values[1]) / (2 * steps[j])
    return out


STEPS = np.full(N, 1e-5)
STEPS[V] = STEPS[OFFSET : OFFSET + 2] = 1e-3
LATER = [
    DEFLECTION_GAIN,
    ROLLING,
    *range(RADIUS, RADIUS + 4),
]  # without their share in rolling resistance


def both_derivatives(car, state, point: str, i: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Return derivatives of a wheel's speed as the observer has them and by differences, and the speed."""
    x, w = state["x"], state["window"]
    set_point(car, state, point)

    def predict() -> float:
        return predict_wheel(car, state, i, 0.98 * x[V])  # the wheel's own track in a curve

    expected = differences(state, predict, STEPS)
    expected[V] /= 0.98  # h is by the wheel's own ground speed, which follows the car's one to one
    # An unknown drive is no part of the prediction: it would act as a motor torque does.
    motor, push = w["motor"][i], 1e-4
    shifted = []
    for sign in (1, -1):
        w["motor"][i] = motor - sign * push * 0.5 * car["mass"] * car["wheel_radius"][i] / math.exp(x[MOTOR])
        shifted.append(predict())
    w["motor"][i] = motor
    expected[DRIVE + i // 2] = (shifted[0] - shifted[1]) / (2 * push)
    omega = predict()
    # Nor is what its slip is off by: v (1 + s) / r while braking, v / ((1 - s) r) driving.
    slip = state["slip"][i]
    expected[SLIP_ERROR + i // 2] = omega / (1 + slip) if slip < 0 else omega / (1 - slip)
    return state["h"].copy(), expected, omega


@pytest.mark.parametrize("i", range(4))
@pytest.mark.parametrize("point", POINTS)
def test_derivatives_of_a_wheels_speed(params, state, point: str, i: int) -> None:
    got, expected, omega = both_derivatives(params[0], state, point, i)
    for j in range(N):
        if j in LATER:
            continue  # the tests below
        rel = 0.01 if j in (DRIVE, DRIVE + 1) else 1e-5  # a drive's lever is the static rolling radius
        assert got[j] == pytest.approx(expected[j], rel=rel, abs=1e-7 * omega), name_of(j)


@pytest.mark.parametrize("point", POINTS)
def test_derivatives_by_the_radius(params, state, point: str) -> None:
    for i in range(4):
        got, expected, omega = both_derivatives(params[0], state, point, i)
        for j in LATER:
            assert got[j] == pytest.approx(expected[j], rel=0.01, abs=1e-7 * omega), name_of(j)


@pytest.mark.parametrize("point", POINTS)
def test_derivatives_of_the_cars_balance(params, state, point: str) -> None:
    car, x, w = params[0], state["x"], state["window"]
    set_point(car, state, point, balanced=True)

    def predict() -> float:
        return predict_balance(car, state, POINTS[point][2] > 0)

    expected = differences(state, predict, STEPS)
    motor, push = w["motor"].copy(), 1e-4
    for axle in range(2):
        shifted = []
        for sign in (1, -1):
            own = slice(2 * axle, 2 * axle + 2)
            w["motor"] = motor
            w["motor"][own] -= sign * push * 0.5 * car["mass"] * car["wheel_radius"][own] / math.exp(x[MOTOR])
            shifted.append(predict())
        w["motor"] = motor
        expected[DRIVE + axle] = (shifted[0] - shifted[1]) / (2 * push)
    predict()
    got = state["h"].copy()
    noise = math.hypot(BALANCE_FLOOR, BALANCE_SHARE * w["accel"])
    for j in range(N):
        if j in LATER:
            assert got[j] == 0.0
            assert abs(expected[j]) * PRIOR[j] < 1.2 * noise, name_of(j)
        elif j == V:  # drag by an error of speed of 0.1 m/s
            assert abs(got[j] - expected[j]) * 0.1 < 0.3 * noise
        else:
            rel = 0.01 if j in (DRIVE, DRIVE + 1) else 1e-6
            assert got[j] == pytest.approx(expected[j], rel=rel, abs=1e-8), name_of(j)


@pytest.mark.parametrize("point", POINTS)
def test_wheel_speed_is_the_one_at_which_the_tyre_carries_the_torque(params, state, point: str) -> None:
    """Angular momentum with the Magic Formula at the predicted speed: nothing is left."""
    car, w = params[0], state["window"]
    set_point(car, state, point)
    state["x"][1:] = 0.0
    for i in range(4):
        load, ground, pressure = w["load"][i], 0.97 * POINTS[point][0], w["pressure"][i]
        omega = predict_wheel(car, state, i, ground)
        deflection = load / (car["unloaded_radius"][i] * car["vertical_stiffness"][i])
        theta = math.acos(1 - deflection)
        r = car["unloaded_radius"][i] * math.sin(theta) / theta
        slip = (r * omega - ground) / max(r * omega, ground)
        relative = load / car["static_load"][i]
        stiffness = car["slip_stiffness"][i] * relative ** -car["stiffness_degression"][i]
        peak = NOMINAL_PEAK * relative**-0.05
        torque = 2e5 * car["piston_area"][i] * car["effective_radius"][i] * car["mu_nominal"][i] * pressure
        torque += w["motor"][i] + car["rolling_resistance"] * load * r
        torque += car["wheel_inertia"][i] * w["change"] / r
        used = -torque / r / load
        if math.hypot(used, w["across"]) > LINEAR_FROM * peak:
            assert point == "front beyond the tyre's range"
            continue
        # What carries `across` too slips in the direction of both forces.
        both = math.hypot(used, w["across"])
        along = used / both if both else 1.0
        assert magic_formula(slip / along, stiffness, peak) == pytest.approx(both, rel=1e-9)
        assert state["slip"][i] == pytest.approx(slip, rel=1e-9)
        assert state["force"][i] == pytest.approx(-torque / r, rel=1e-9)


KNOWN_BEFORE = [LEVEL, LEVEL + 2, CHANGE, OFFSET, STIFFNESS, PEAK, MASS, MOTOR, LOAD, SIDE, PEAK_LOAD, DRIVE]


@pytest.mark.parametrize("point", [name for name, row in POINTS.items() if row[2] > 0])
def test_derivatives_hold_nothing_of_this_windows_pressure(params, state, point: str) -> None:
    """Its noise is in the prediction: were it in both, it would bias what is learned."""
    car, w = params[0], state["window"]
    set_point(car, state, point)
    for predict in (
        lambda: predict_wheel(car, state, 0, 20.0),
        lambda: predict_wheel(car, state, 3, 20.0),
        lambda: predict_balance(car, state, True),
    ):
        before, h = predict(), state["h"].copy()
        w["pressure"] += 3.0
        w["common_pressure"] += 3.0
        assert predict() != before
        np.testing.assert_allclose(state["h"][KNOWN_BEFORE], h[KNOWN_BEFORE], rtol=1e-12)
        w["pressure"] -= 3.0
        w["common_pressure"] -= 3.0


UNKNOWN_SHARES = [
    # relative error of the motors' torque, reported; share of the drive that is unknown
    (0.00, True, 0.0),
    (0.03, True, 0.0),
    (0.13, True, 0.2),
    (0.50, True, 0.94),
    (0.60, True, 1.0),
    (0.03, False, 1.0),
]


@pytest.mark.parametrize(("error", "reported", "share"), UNKNOWN_SHARES)
def test_a_drive_is_known_as_well_as_its_torque_is(params, state, error, reported, share) -> None:
    """An error of scale is `MOTOR`'s; what is beyond counts twice."""
    params[0]["sigma_motor_torque"] = error
    state["motors"]["samples"] = 5 * reported
    assert unknown_share(params[0], state) == pytest.approx(share)


@pytest.mark.parametrize("y", [-1.0, -0.3, 0.0, 0.1, 0.19, 0.25, 0.5])
@pytest.mark.parametrize("relative", [0.6, 1.0, 1.5])
def test_peak_adhesion_is_monotonic_in_its_state_and_has_a_greatest_value(state, y, relative) -> None:
    state["x"][PEAK], state["x"][PEAK_LOAD] = y, 0.02
    by_load = relative**-0.03
    expected = NOMINAL_PEAK * by_load * min((1 - 4 * y) ** -0.25 if y < 0.25 else math.inf, 0.2**-0.25)
    assert peak_adhesion(state, relative) == pytest.approx(expected)
