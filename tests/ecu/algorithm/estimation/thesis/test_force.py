"""Virtual force sensor: K_f against batch weighted least squares."""

import math

import numpy as np
import pytest

from ecu.algorithm.estimation.motion import MOTION_STATE
from ecu.algorithm.estimation.thesis.force import FORCE_STATE, reset_force, update_force
from ecu.algorithm.estimation.thesis.slip import WHEELS_STATE
from ecu.algorithm.estimation.thesis.tyre import CURVE
from ecu.algorithm.vehicle import total_tyre_force

G = 9.81
DT = 0.01


def test_k_f_compares_the_forces_of_the_wheels_turned_into_the_chassis(params) -> None:
    """(4.25, corrected): wheel forces F_L + i F_S turned by delta, summed; model and truth are the same."""
    p, delta, across, speed = params[0], 0.2, 3.0, 12.0
    sensor = Sensor(params)
    sensor.motion["steering"], sensor.motion["accel_y"] = delta, across
    sensor.wheels["slip"] = -0.02, -0.025, -0.015, -0.018
    update_force(p, sensor.state, sensor.motion, sensor.wheels, sensor.load, False, 0.0)
    along = sensor.state["model"].copy()
    front_y = p["mass"] * across * p["rear_axle"] / p["wheelbase"]  # no yaw acceleration
    side = (front_y - along[:2].sum() * math.sin(delta)) / math.cos(delta)
    front = complex(along[:2].sum(), side) * complex(math.cos(delta), math.sin(delta))
    assert front.imag == pytest.approx(front_y)
    drag = 0.5 * 1.2 * 0.35 * 2.32 * speed**2
    sensor.motion["accel_x"] = (front.real + along[2:].sum() - drag) / p["mass"]
    sensor.state["total"] = total_tyre_force(p, sensor.motion, speed)
    for _ in range(50):
        update_force(p, sensor.state, sensor.motion, sensor.wheels, sensor.load, True, 0.0)
    assert sensor.state["k_f"] == pytest.approx(1.0, abs=0.004)


class Sensor:
    """The regression on tyre model forces that the test prescribes."""

    def __init__(self, params) -> None:
        self.params = params[0]
        self.params["stiffness_degression"] = 0.0
        self.load = np.full(4, 5000.0)
        self.wheels, self.motion = np.zeros(1, WHEELS_STATE)[0], np.zeros(1, MOTION_STATE)[0]
        self.wheels["fresh"] = 1
        self.state = np.zeros(1, FORCE_STATE)[0]
        self.state["k_f"] = self.state["stiffness"] = 1.0
        reset_force(self.state)

    def cycle(self, model: float, total: float, regress: bool = True) -> float:
        """Regress on four equal wheels; no time passes, so that slip stiffness stays."""
        secant = self.params["slip_stiffness"] * (self.load - CURVE * abs(model) / 4)
        self.wheels["slip"] = model / 4 / secant
        self.state["total"] = total
        update_force(self.params, self.state, self.motion, self.wheels, self.load, regress, 0.0)
        return float(self.state["k_f"])


@pytest.mark.parametrize("forgetting", [0.9, 0.93, 0.99])
def test_k_f_is_weighted_least_squares(params, forgetting: float) -> None:
    params[0]["rls_forgetting"] = forgetting
    random = np.random.default_rng(5)
    x = -7000.0 + 1500.0 * random.standard_normal(120)
    y = x * 0.8 + 300.0 * random.standard_normal(120)
    sensor = Sensor(params)
    prior = float(sensor.state["covariance"])
    for n in range(1, 121):
        got = sensor.cycle(x[n - 1], y[n - 1])
        weight = forgetting ** np.arange(n - 1, -1, -1.0)
        start = forgetting**n / prior  # the start k_f = 1 counts as one more, fading, observation
        batch = (np.sum(weight * x[:n] * y[:n]) + start) / (np.sum(weight * x[:n] ** 2) + start)
        assert got == pytest.approx(batch, rel=1e-9)


@pytest.mark.parametrize("true", [0.5, 0.67, 1.0, 1.5])
def test_k_f_adapts_within_100_ms_to_another_tyre(params, true: float) -> None:
    """Section 4.6: a stiffness that is a third off is found after about 100 ms."""
    sensor = Sensor(params)
    for _ in range(100):
        sensor.cycle(-8000.0, -8000.0)
    for _ in range(10):
        k_f = sensor.cycle(-8000.0, -8000.0 * true)
    print(f"k_f {k_f:.3f} of {true}")
    assert k_f == pytest.approx(true, abs=0.05 * abs(1 - true) + 1e-9)


@pytest.mark.parametrize(
    ("case", "model", "total", "regress", "fresh"),
    [
        ("not braking", -8000.0, -4000.0, False, 1),
        ("no new wheel speed", -8000.0, -4000.0, True, 0),
        ("hardly any force", -200.0, -4000.0, True, 1),
    ],
)
def test_k_f_rests(params, case: str, model: float, total: float, regress: bool, fresh: int) -> None:
    sensor = Sensor(params)
    sensor.wheels["fresh"] = fresh
    assert sensor.cycle(model, total, regress) == 1.0, case


@pytest.mark.parametrize(("total", "bound"), [(-1e6, 4.0), (1e6, 0.1), (0.0, 0.1)])
def test_k_f_stays_within_its_bounds(params, total: float, bound: float) -> None:
    sensor = Sensor(params)
    for _ in range(200):
        k_f = sensor.cycle(-8000.0, total)
    assert k_f == bound


def test_forces_of_the_wheels_add_up_to_the_total_and_share_by_the_tyre_model(params) -> None:
    sensor = Sensor(params)
    slip = np.array([-0.02, -0.022, -0.012, -0.014])
    for _ in range(300):
        sensor.wheels["slip"], sensor.state["total"] = slip, -6000.0
        update_force(sensor.params, sensor.state, sensor.motion, sensor.wheels, sensor.load, True, 0.0)
    virtual = sensor.state["virtual"]
    assert virtual.sum() == pytest.approx(-6000.0, rel=1e-6)
    linear = sensor.params["slip_stiffness"] * slip
    modelled = linear / (1.0 + CURVE * abs(linear))
    assert virtual / virtual[0] == pytest.approx(modelled / modelled[0])
    assert (virtual < 0).all()


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_force_that_is_not_finite_does_not_stay_in_k_f(params, value: float) -> None:
    sensor = Sensor(params)
    sensor.cycle(-8000.0, value)
    for _ in range(100):
        k_f = sensor.cycle(-8000.0, -8000.0)
    assert k_f == pytest.approx(1.0, abs=0.05)


def brake_straight(
    sensor: Sensor, true: float, seconds: float, slip=(-0.025, -0.025, -0.018, -0.018)
) -> None:
    """Brake with tyres whose stiffness is `true` times the configured one, proportional to load (4.35)."""
    sensor.load = np.array([6000.0, 6000.0, 4300.0, 4300.0])
    sensor.wheels["slip"] = slip
    linear = true * sensor.params["slip_stiffness"] * slip
    sensor.state["total"] = np.sum(sensor.load * linear / (1.0 + CURVE * abs(linear)))
    for _ in range(round(seconds / DT)):
        update_force(sensor.params, sensor.state, sensor.motion, sensor.wheels, sensor.load, True, DT)


@pytest.mark.parametrize("true", [0.5, 0.67, 1.3, 1.5])
def test_slip_stiffness_is_newly_estimated_from_the_total_force(params, true: float) -> None:
    """(4.36, corrected) with the forces that linear tyres would hold at these slips."""
    sensor = Sensor(params)
    brake_straight(sensor, true, 0.5)
    front, rear = sensor.wheels["slip"][:2].sum(), sensor.wheels["slip"][2:].sum()
    adhesion = sensor.state["virtual"] / sensor.load
    total = np.sum(sensor.state["virtual"] / (1.0 - CURVE * abs(adhesion)))
    closed_form = total / (front + rear * 4300.0 / 6000.0)
    print(f"stiffness {sensor.state['stiffness']:.3f} of {true}, k_f {sensor.state['k_f']:.3f}")
    found = sensor.state["stiffness"] * sensor.params["slip_stiffness"][0] * 6000.0
    assert found == pytest.approx(closed_form, rel=0.02)
    assert sensor.state["stiffness"] == pytest.approx(true, rel=0.03)
    assert sensor.state["k_f"] == pytest.approx(1.0, abs=0.03)
    assert sensor.state["virtual"].sum() == pytest.approx(sensor.state["total"], rel=1e-3)


@pytest.mark.parametrize(
    ("case", "true", "slip", "accel_y", "steering"),
    [
        ("k_f within its band", 0.85, -0.015, 0.0, 0.0),
        ("hardly any deceleration", 0.6, -0.005, 0.0, 0.0),
        ("much slip", 0.6, -0.06, 0.0, 0.0),
        ("a curve", 0.6, -0.015, 1.0, 0.0),
        ("wheels turned", 0.6, -0.015, 0.0, 0.05),
    ],
)
def test_slip_stiffness_stays(params, case: str, true, slip, accel_y, steering) -> None:
    sensor = Sensor(params)
    sensor.motion["accel_y"], sensor.motion["steering"] = accel_y, steering
    brake_straight(sensor, true, 1.0, (slip,) * 4)
    assert sensor.state["stiffness"] == 1.0, case
    assert sensor.state["k_f"] < 0.95, case
