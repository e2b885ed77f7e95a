"""Lag of the linings beside (A.17, A.18) solved by scipy, with the sensor's noise and without a sensor."""

import math

import numpy as np
import pytest
from scipy.signal import TransferFunction, lsim

from ecu.algorithm.control.friction_torque import FRICTION_TORQUE_STATE, follow_pressure, lagging_torque
from ecu.algorithm.control.pressure_law import PRESSURE_LAW_STATE

BAR = 1e5
DT = 0.01
BUILD_UP, RELEASE = ([1.0], [0.00075, 0.037, 1.0]), ([1.0], [0.00021, 0.045, 1.0])  # (A.17, A.18)
CYCLES = 60


def hydraulics(demand: np.ndarray, model: tuple[list[float], list[float]], dead_time: float) -> np.ndarray:
    """Pressure [bar] at the start of each cycle, of demands held over it: exact, by scipy."""
    t = np.arange(0.0, DT * len(demand), 0.001)
    held = np.repeat(demand, 10)
    late = np.concatenate([np.full(round(1000 * dead_time), demand[0]), held])[: len(t)] - demand[0]
    _, moved, _ = lsim(TransferFunction(*model), late, t)
    return (moved + demand[0])[::10]


class Follower:
    """The ECU's knowledge of four equal pressures, cycle by cycle."""

    def __init__(self, params, feed) -> None:
        self.p, self.feed, self.inputs = params[0], feed, feed()
        self.state = np.zeros(1, FRICTION_TORQUE_STATE)[0]
        self.zero = np.zeros(4)

    def cycle(self, sent: float, measured: float, dt: float = DT) -> float:
        """Take in the demand sent in the last cycle [bar] and a sample; return the pressure soon [bar]."""
        self.feed(self.inputs, calliper_pressure=measured)
        if math.isnan(measured):
            self.inputs["new"] = 0
        follow_pressure(self.p, self.state, self.inputs[0], np.full(4, sent * BAR), self.zero, dt)
        return float(self.state["value"][0])


DEMANDS = {
    "step up": (np.where(np.arange(CYCLES) < 5, 10.0, 40.0), BUILD_UP, 0.026),
    "ramp up": (np.clip(10.0 + 1.0 * (np.arange(CYCLES) - 5), 10.0, 40.0), BUILD_UP, 0.026),
    "ramp down": (np.clip(40.0 - 1.0 * (np.arange(CYCLES) - 5), 10.0, 40.0), RELEASE, 0.015),
}


@pytest.mark.parametrize("noise", [None, 0.0, 1.8], ids=["no sensor", "exact", "1.8 bar"])
@pytest.mark.parametrize("name", DEMANDS)
def test_the_pressure_is_known_a_cycle_ahead(params, feed, name: str, noise: float | None) -> None:
    demand, model, dead_time = DEMANDS[name]
    true = hydraulics(demand, model, dead_time)
    random, car = np.random.default_rng(1), Follower(params, feed)
    for _ in range(300):
        reading = math.nan if noise is None else true[0] + noise * random.standard_normal()
        car.cycle(true[0], reading)
    error = []
    for k in range(1, CYCLES - 1):
        reading = math.nan if noise is None else true[k] + noise * random.standard_normal()
        error.append(car.cycle(demand[k - 1], reading) - true[k + 1])
    # 25 ms instead of 26, half cycles instead of a continuum; what noise adds
    bound = (1.3 if name == "step up" else 0.3) + (0.6 if noise else 0.0)
    assert np.max(np.abs(error)) < bound, np.round(error, 2)


def test_noise_of_the_sensor_is_not_felt(params, feed) -> None:
    random, car = np.random.default_rng(0), Follower(params, feed)
    values = [car.cycle(30.0, 30.0 + 1.8 * random.standard_normal()) for _ in range(2000)][500:]
    assert np.std(values) < 0.25
    assert np.std(np.diff(values)) < 0.03


def test_what_the_sensors_read_without_pressure_is_taken_off(params, feed) -> None:
    car = Follower(params, feed)
    car.zero[:] = 1.5
    for _ in range(300):
        found = car.cycle(20.0, 21.5)
    assert found == pytest.approx(20.0, abs=0.2)


def test_hydraulics_that_do_not_follow_are_believed(params, feed) -> None:
    car = Follower(params, feed)
    for _ in range(100):
        car.cycle(30.0, 30.0)
    for _ in range(200):
        found = car.cycle(60.0, 30.0)
    assert found == pytest.approx(30.0, abs=1.0)


def test_missed_cycles_have_held_the_demand(params, feed) -> None:
    one, late = Follower(params, feed), Follower(params, feed)
    for sent in (10.0, 10.0, 40.0):
        one.cycle(sent, math.nan)
        late.cycle(sent, math.nan)
    for _ in range(4):
        one.cycle(40.0, math.nan)
    late.cycle(40.0, math.nan, 4 * DT)
    assert late.state["model"][0] == pytest.approx(one.state["model"][0])
    assert late.state["value"][0] == pytest.approx(one.state["value"][0])


@pytest.mark.parametrize("corner", [0, 2])
@pytest.mark.parametrize(("override", "mu"), [(math.nan, 0.40), (0.35, 0.35)])
@pytest.mark.parametrize(
    ("there", "wanted"), [(10.0, 25.0), (25.0, 10.0), (0.0, 10.0), (10.0, 0.0), (0.3, 0.4)]
)
def test_the_lag_is_a_torque(params, feed, corner, override, mu, there, wanted) -> None:
    car = Follower(params, feed)
    car.state["value"] = there
    law = np.zeros(1, PRESSURE_LAW_STATE)[0]
    law["used"], law["mu_override"] = 0.40, override
    diameter, radius = ((0.060, 0.1205), (0.060, 0.1205), (0.034, 0.1288), (0.034, 0.1288))[corner]

    def torque(bar: float) -> float:
        """(A.19), one piston a side, 0.5 bar of push-out pressure."""
        return 2 * mu * math.pi * diameter**2 / 4 * max(bar - 0.5, 0.0) * BAR * radius

    found = lagging_torque(car.p, car.state, law, wanted * BAR, corner)
    assert found == pytest.approx(torque(wanted) - torque(there))
