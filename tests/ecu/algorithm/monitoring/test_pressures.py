"""Pressure readings beside those demanded: what lasts is taken out, what is far off is wrong."""

import numpy as np
import pytest

from ecu.algorithm.control.pressure_law import PRESSURE_LAW_STATE
from ecu.algorithm.estimate import ESTIMATE
from ecu.algorithm.estimation.zero import ZERO_STATE, note_rest, settle_zero, tell_zeros
from ecu.algorithm.hydraulics import HYDRAULICS_STATE
from ecu.algorithm.monitoring.failed_brakes import FAILED_BRAKES_STATE
from ecu.algorithm.monitoring.pressures import (
    KEPT,
    KEPT_SHARE,
    PRESSURES_STATE,
    beyond_noise,
    compare_pressures,
    lasting_difference,
)
from ecu.algorithm.monitoring.witness import WITNESS_STATE
from ecu.contract.params import BAR
from ecu.contract.signals import CALLIPER_PRESSURE

DT, MU, G = 0.01, 0.4, 9.81
NOISE = 1.8  # bar


class Brakes:
    """Four brakes that deliver what is demanded, and their sensors: scale, offset [bar], floor."""

    def __init__(self, params, feed, sensor=lambda bar: bar, delivered: float = 1.0) -> None:
        self.params, self.feed, self.inputs = params[0], feed, feed()
        self.sensor, self.delivered = sensor, delivered
        self.zero, self.state = np.zeros(1, ZERO_STATE)[0], np.zeros(1, PRESSURES_STATE)[0]
        self.brakes, self.law = np.zeros(1, FAILED_BRAKES_STATE)[0], np.zeros(1, PRESSURE_LAW_STATE)[0]
        self.brakes["scale"], self.law["base"] = 1.0, MU
        self.hydraulics, self.estimate = np.zeros(1, HYDRAULICS_STATE)[0], np.zeros(1, ESTIMATE)[0]
        self.estimate["measured"], self.estimate["speed"] = 1, 20.0
        self.witness = np.zeros(1, WITNESS_STATE)[0]
        self.random = np.random.default_rng(0)

    def force(self, bar: float) -> float:
        """Return the force of four linings [N] by (A.19), written out."""
        p = self.params
        acts = np.maximum(bar * BAR - p["push_out_pressure"], 0.0)
        return float(np.sum(2 * acts * p["piston_area"] * MU * p["effective_radius"] / p["wheel_radius"]))

    def hold(self, seconds: float, bar: float) -> None:
        for _ in range(round(seconds / DT)):
            reading = self.sensor(bar * self.delivered + NOISE * self.random.standard_normal(4))
            self.feed(self.inputs, calliper_pressure=reading)
            self.hydraulics["model"] = bar
            self.brakes["owed"], self.brakes["given"] = self.force(bar) / 4, self.force(bar * self.delivered)
            if bar == 0.0:
                for i in range(4):
                    note_rest(self.zero, i, self.inputs[0]["value"][CALLIPER_PRESSURE + i])
                    settle_zero(self.zero, i)
                tell_zeros(self.zero, self.estimate)
            compare_pressures(
                self.params, self.state, self.witness, self.inputs[0], self.estimate, self.law, self.brakes,
                self.hydraulics, True, DT,
            )  # fmt: skip

    def taken_out(self, bar: float) -> np.ndarray:
        return np.array([lasting_difference(self.state, i, bar) for i in range(4)])


SENSORS = [
    # sensor, reading [bar] of a pressure, its error at 6 and at 60 bar [bar] beyond what it reads at rest
    ("sound", lambda bar: bar, 0.0, 0.0),
    ("no pressure below zero", lambda bar: np.maximum(bar, 0.0), 0.0, 0.0),
    ("4 % too much", lambda bar: 1.04 * bar, 0.24, 2.4),
    ("5 % too little", lambda bar: 0.95 * bar, -0.3, -3.0),
    ("zero at 1 bar", lambda bar: bar + 1.0, 0.0, 0.0),
]


@pytest.mark.parametrize(("name", "sensor", "low", "high"), SENSORS, ids=[case[0] for case in SENSORS])
def test_what_lasts_of_a_difference_is_taken_out_but_for_a_tolerance(
    params, feed, name: str, sensor, low: float, high: float
) -> None:
    brakes = Brakes(params, feed, sensor)
    for bar, error in ((6.0, low), (60.0, high)):
        for _ in range(3):
            brakes.hold(3.0, 0.0)
            brakes.hold(4.0, bar)
        left = error - np.mean(brakes.taken_out(bar))
        print(f"{name}: {left:+.2f} bar left at {bar} bar")
        assert abs(left) < KEPT + KEPT_SHARE * bar
        assert not brakes.state["wrong"].any()


def test_a_floored_reading_of_a_released_brake_is_no_offset(params, feed) -> None:
    """Noise of 1.8 bar cut off at zero has a mean of 0.7 bar, but its zero is none of it."""
    brakes = Brakes(params, feed, lambda bar: np.maximum(bar, 0.0))
    brakes.hold(20.0, 0.0)
    assert brakes.zero["mean"] == pytest.approx(NOISE / np.sqrt(2 * np.pi), abs=0.15)
    assert np.abs(brakes.state["offset"]).mean() < 0.3
    brakes.hold(10.0, 8.0)
    assert np.abs(brakes.state["ratio"]).mean() < 0.03


WRONG = [
    # what happens, share of the demanded pressure that is there, reading of it, the model stands for it
    ("all is well", 1.0, lambda bar: bar, False),
    ("20 bar too much", 1.0, lambda bar: bar + 20.0, True),
    ("stuck at 3 bar", 1.0, lambda bar: 0.0 * bar + 3.0, True),
    ("half of it is there, and read", 0.5, lambda bar: bar, False),
]


@pytest.mark.parametrize(("name", "delivered", "sensor", "wrong"), WRONG, ids=[case[0] for case in WRONG])
def test_a_reading_far_off_is_wrong_unless_the_deceleration_agrees_with_it(
    params, feed, name: str, delivered: float, sensor, wrong: bool
) -> None:
    brakes = Brakes(params, feed, delivered=delivered)
    brakes.hold(5.0, 0.0)
    brakes.sensor = sensor
    brakes.hold(1.0, 50.0)
    assert brakes.state["wrong"].all() == wrong == brakes.state["wrong"].any(), name


def test_a_reading_is_believed_again_at_pressures_at_which_it_was_wrong(params, feed) -> None:
    """At released brakes a reading of the other sign is right, and wrong in the next braking again."""
    brakes = Brakes(params, feed, lambda bar: -bar)
    brakes.hold(1.0, 50.0)
    for bar, again, believed in ((0.0, -1.0, False), (20.0, 1.0, False), (30.0, 1.0, True)):
        brakes.sensor = lambda read, again=again: again * read
        brakes.hold(3.0, bar)
        assert brakes.state["wrong"].all() != believed, bar


@pytest.mark.parametrize(("share", "wrong"), [(0.6, True), (0.75, False)])
def test_all_that_lasts_at_a_low_pressure_is_taken_out(params, feed, share: float, wrong: bool) -> None:
    """It is friction's otherwise, which rises by as much; nothing tells it from a force of 12 bar."""
    brakes = Brakes(params, feed)
    brakes.hold(5.0, 0.0)
    brakes.sensor = lambda bar: share * bar
    brakes.hold(8.0, 11.0)
    left = (share - 1.0) * 11.0 - np.mean(brakes.taken_out(11.0))
    print(f"{left:+.2f} bar left")
    assert abs(left) < KEPT + KEPT_SHARE * 11.0
    assert brakes.state["wrong"].all() == wrong == brakes.state["wrong"].any()


@pytest.mark.parametrize(
    ("bar", "honest", "beyond"), [(0.0, 0, False), (39.0, 0, False), (41.0, 0, True), (41.0, 1, False)]
)
def test_one_sample_is_left_out_above_what_noise_can_be(bar: float, honest: int, beyond: bool) -> None:
    state = np.zeros(1, PRESSURES_STATE)[0]
    state["honest"] = honest
    assert beyond_noise(state, bar, 20.0) == beyond
