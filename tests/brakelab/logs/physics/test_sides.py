"""Sides of an axle: a brake that gives nothing tells left from right, and is no fault of the map."""

import numpy as np
import pytest

from brakelab.logs.physics.judge import Judged, judge
from brakelab.logs.physics.samples import SAMPLED, Collector, car_of
from brakelab.simulation.closed_loop import new_loop, run
from brakelab.simulation.ecu_inputs import ecu_inputs, vehicle_frames
from brakelab.simulation.scenario import load_scenario
from ecu.contract.signals import INPUT_SIGNALS
from ecu.settings.config import load_config, new_params
from ecu.settings.resources import resource

PLACE = {INPUT_SIGNALS[place].name: column for column, place in enumerate(SAMPLED)}
PRESSURES = [PLACE[f"calliper_pressure_{corner}"] for corner in ("fl", "fr", "rl", "rr")]
SUV = load_config(resource("config/suv.toml"))


@pytest.fixture(scope="module")
def stops() -> dict[str, np.ndarray]:
    """Stops of which a part of the brakes gives nothing from the middle on."""
    found = {}
    for name in ("calliper-dead", "circuit-dead-diagonal", "circuit-dead-front"):
        drive = run(new_loop(load_scenario(resource(f"config/scenarios/faults/{name}.toml")), SUV, 0))
        inputs = ecu_inputs(vehicle_frames(drive.frames), len(drive.t))
        found[name] = np.where(inputs["new"][:, SAMPLED] != 0, inputs["value"][:, SAMPLED], np.nan)
    return found


def judged(samples: np.ndarray) -> Judged:
    collector = Collector()
    collector.add(samples)
    return judge(collector.series(), car_of(new_params(SUV)[0]))


@pytest.mark.parametrize(
    ("name", "axles"),
    [("calliper-dead", ["front"]), ("circuit-dead-diagonal", ["front", "rear"]), ("circuit-dead-front", [])],
)
def test_a_dead_brake_is_reported_and_contradicts_nothing(
    stops: dict[str, np.ndarray], name: str, axles: list[str]
) -> None:
    found = judged(stops[name])
    assert found.contradictions == []
    for axle, line in zip(axles, found.flaws, strict=True):
        assert line.startswith(f"calliper_pressure_*: {axle} left reads")
        assert line.endswith("one of these brakes gives less")


@pytest.mark.parametrize(
    ("name", "axles"), [("calliper-dead", ["front"]), ("circuit-dead-diagonal", ["front", "rear"])]
)
def test_exchanged_sides_are_reported(stops: dict[str, np.ndarray], name: str, axles: list[str]) -> None:
    wrong = stops[name].copy()
    wrong[:, PRESSURES] = wrong[:, [PRESSURES[i] for i in (1, 0, 3, 2)]]
    for axle, line in zip(axles, judged(wrong).contradictions, strict=True):
        assert line.startswith(f"calliper_pressure_*: {axle} left and right are exchanged")


def test_sides_alike_tell_nothing_of_their_order(stops: dict[str, np.ndarray]) -> None:
    wrong = stops["circuit-dead-front"].copy()
    wrong[:, PRESSURES] = wrong[:, [PRESSURES[i] for i in (1, 0, 3, 2)]]
    assert judged(wrong).lines == []
