"""Uncertainty of measured friction: the law of propagation beside a Monte Carlo of the whole evaluation."""

from dataclasses import replace

import numpy as np
import pytest

from brakelab.identify.friction.columns import Columns, Uncertainty
from brakelab.identify.friction.recording import Recording
from brakelab.identify.friction.stops import Stops, find_stops
from brakelab.identify.friction.uncertainty import standard_uncertainty

pytestmark = pytest.mark.study

DRAWS = 120
SOURCES = {
    "torque": Uncertainty(torque=8.0),
    "gain of torque": Uncertainty(torque_gain=0.02),
    "pressure": Uncertainty(pressure=0.3),
    "gain of pressure": Uncertainty(pressure_gain=0.015),
    "push-out pressure": Uncertainty(push_out_pressure=0.2),
    "pistons": Uncertainty(piston_area=0.02),
    "radius": Uncertainty(effective_radius=0.01),
    "all": Uncertainty(
        torque=8.0,
        torque_gain=0.01,
        pressure=0.3,
        pressure_gain=0.01,
        push_out_pressure=0.2,
        piston_area=0.01,
        effective_radius=0.01,
    ),
}


def drawn(recording: Recording, columns: Columns, of: Uncertainty, random: np.random.Generator) -> Stops:
    """Return the stops of a rig whose sensors and geometry are off by a draw of `of`."""

    def off(sigma: float) -> float:
        return sigma * float(random.standard_normal())

    brake = columns.brake.model_copy(
        update={
            "piston_area": columns.brake.piston_area * (1.0 + off(of.piston_area)),
            "effective_radius": columns.brake.effective_radius * (1.0 + off(of.effective_radius)),
        }
    )
    push_out = columns.rig.push_out_pressure + off(of.push_out_pressure)
    rig = columns.rig.model_copy(update={"push_out_pressure": push_out})
    seen = recording._replace(
        torque=recording.torque * (1.0 + off(of.torque_gain)) + off(of.torque),
        pressure=recording.pressure * (1.0 + off(of.pressure_gain)) + 1e5 * off(of.pressure),
    )
    return find_stops(seen, columns.model_copy(update={"brake": brake, "rig": rig}), "x")


@pytest.mark.parametrize("source", SOURCES)
def test_monte_carlo_agrees(recording: Recording, columns: Columns, stops: Stops, source: str) -> None:
    """Of stops at 15 to 70 bar; 120 draws know a standard deviation to 7 %, so 20 % are three of those."""
    stated = SOURCES[source]
    random = np.random.default_rng(3)
    means = np.array([drawn(recording, columns, stated, random).mean for _ in range(DRAWS)])
    u = standard_uncertainty(stops, columns.model_copy(update={"uncertainty": stated}))
    assert u is not None
    np.testing.assert_allclose(u, means.std(axis=0, ddof=1), rtol=0.2)


@pytest.mark.parametrize(
    ("given", "share"),
    [
        ({"torque": 33.0}, 0.05),  # of 660 N m
        ({"torque_gain": 0.03}, 0.03),
        ({"pressure": 0.4}, 0.02),
        ({"pressure_gain": 0.01}, 0.0125),  # of the 25 bar that the sensor shows
        ({"push_out_pressure": 0.2}, 0.01),
        ({"piston_area": 0.02}, 0.02),
        ({"torque_gain": 0.03, "pressure": 0.8}, 0.05),
    ],
)
def test_by_hand(columns: Columns, stops: Stops, given: dict[str, float], share: float) -> None:
    """At 20 bar on the pads, 5 bar of push-out pressure, friction 0.4 and 660 N m."""
    one = replace(stops, mean=np.array([0.4]), held_pressure=np.array([20e5]), lever=660.0 / 0.4 / 20e5)
    rig = columns.rig.model_copy(update={"push_out_pressure": 5.0})
    stated = columns.model_copy(update={"uncertainty": Uncertainty(**given), "rig": rig})
    assert standard_uncertainty(one, stated) == pytest.approx([0.4 * share])


def test_what_states_nothing_has_none(columns: Columns, stops: Stops) -> None:
    assert standard_uncertainty(stops, columns) is None
