"""All wheels spin for seconds as the car accelerates on a slippery road, without a speed reference."""

import numpy as np
import pytest

from brakelab.simulation.closed_loop import new_loop, run
from brakelab.simulation.scenario import Phase, Scenario
from ecu.contract.faults import IMPLAUSIBLE
from ecu.contract.signals import CORNERS
from ecu.settings.config import load_config
from ecu.settings.resources import resource

WHEELS = sum(IMPLAUSIBLE[f"wheel_speed_{corner}"] for corner in CORNERS)


@pytest.mark.parametrize(
    ("adhesion", "reaches", "least_spin_s"),
    # m/s, s
    [(0.4, 12.0, 3.0), (0.4, 20.0, 5.5), (0.2, 10.0, 5.0)],
)
@pytest.mark.parametrize("seed", [0, 1])
def test_the_speed_is_that_of_the_car(adhesion, reaches, least_spin_s, seed) -> None:
    """By dead reckoning: until this was tested, the wheels' speed was taken after three seconds, for good."""
    brake = Phase(kind="brake", decel=4.0 * adhesion, until_speed=3.0)
    scenario = Scenario(
        plant="suv",
        draw="wide",
        initial_speed=3.0,
        vehicle_speed="none",
        road_friction=[(0.0, adhesion)],
        phase=[
            Phase(kind="cruise", speed=reaches, accel=5.0, until_speed=reaches - 1.0),
            Phase(kind="coast", seconds=1.5),
            brake,
            Phase(kind="cruise", speed=reaches, accel=1.0, until_speed=reaches - 1.0),
            brake,
        ],
    )
    drive = run(new_loop(scenario, load_config(resource("config/suv.toml")), seed))
    speed, believed = drive.truth["vehicle_speed"], drive.outputs["vehicle_speed"]
    turns = np.stack([drive.truth[f"wheel_speed_{c}"] * drive.truth[f"rolling_radius_{c}"] for c in CORNERS])
    spins = (turns.min(axis=0) > 1.3 * speed + 1.0) & (drive.truth["decel_demand"] == 0.0)
    assert 0.01 * spins.sum() > least_spin_s
    wrong = np.abs(believed - speed)
    print(f"worst {np.nanmax(wrong):.2f} m/s, braking {wrong[drive.truth['decel_demand'] > 0.1].max():.2f}")
    assert np.nanmax(wrong) < 2.0
    assert wrong[drive.truth["decel_demand"] > 0.1].max() < 0.5
    named = drive.outputs["active_faults_2"].astype(np.int64) << 32
    assert not (named & WHEELS).any()
