"""Disc temperature on board beside the simulated car: its own discs, others, and an unknown rest."""

from pathlib import Path

import numpy as np
import pytest

from brakelab.simulation.closed_loop import Drive, new_loop, run
from brakelab.simulation.scenario import load_scenario
from brakelab.simulation.scenario_car import with_draw
from ecu.contract.signals import CORNERS
from ecu.settings.config import Config, load_config

CONFIG = Path(__file__).parents[4] / "config"


def changed(config: Config, heating: float, cooling: float) -> Config:
    """Return the configuration of a car whose discs differ from those of the simulated one."""
    axles = {
        name: axle.model_copy(
            update={
                "disc_heating": heating * axle.disc_heating,
                "disc_cooling": cooling * axle.disc_cooling,
                "disc_cooling_by_speed": cooling * axle.disc_cooling_by_speed,
            }
        )
        for name, axle in (("front", config.front), ("rear", config.rear))
    }
    return config.model_copy(update=axles)


def driven(name: str, config: Config, known: bool) -> Drive:
    """Return a whole drive; `known`: the ECU knows how hot the discs are at the start."""
    scenario = with_draw(load_scenario(CONFIG / "scenarios" / f"{name}.toml"), "nominal")
    loop = new_loop(scenario, config, 1)
    if known:
        disc = loop.sides.state["discs"][0]
        disc["excess"] = np.repeat(scenario.initial_disc_temperature, 2) - scenario.ambient_temperature
        disc["ambient"], disc["sigma_start"] = scenario.ambient_temperature, 0.0
    return run(loop, seconds=400.0)


def corners(columns: dict[str, np.ndarray], name: str) -> np.ndarray:
    return np.array([columns[f"{name}_{corner}"] for corner in CORNERS])


SCENARIOS = ("single", "stop-1", "demo", "fade", "downhill", "rain")


@pytest.mark.parametrize("name", SCENARIOS)
@pytest.mark.parametrize(
    ("heating", "cooling"), [(1.0, 1.0), (0.85, 1.0), (1.15, 1.0), (0.9, 1.2), (1.1, 0.8)]
)
def test_the_true_disc_is_within_two_sigma_though_the_brake_is_another(name, heating, cooling) -> None:
    drive = driven(name, changed(load_config(CONFIG / "suv.toml"), heating, cooling), known=True)
    true, found = corners(drive.truth, "disc_temperature"), corners(drive.outputs, "disc_temperature")
    sigma = corners(drive.outputs, "sigma_disc_temperature")
    off = np.abs((found - true) / sigma).max()
    rise = true.max(axis=1) - true[:, 0]
    print(
        f"{name}, heating x {heating}, cooling x {cooling}: true {true.max():.0f} degC, error at the end "
        f"{np.round((found - true)[:, -1], 1)} K, sigma {np.round(sigma[:, -1], 1)} K, {off:.2f} sigma"
    )
    assert off < 2.0
    assert (sigma[:, -1] < (0.7 if name == "rain" else 0.3) * rise + 3.0).all()  # the band says something


@pytest.mark.parametrize("name", SCENARIOS)
def test_the_true_disc_is_within_two_sigma_after_an_unknown_rest(name) -> None:
    drive = driven(name, load_config(CONFIG / "suv.toml"), known=False)
    true, found = corners(drive.truth, "disc_temperature"), corners(drive.outputs, "disc_temperature")
    sigma = corners(drive.outputs, "sigma_disc_temperature")
    assert np.abs((found - true) / sigma).max() < 2.0
