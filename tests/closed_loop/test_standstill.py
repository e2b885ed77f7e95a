"""Standing on the steepest grade: the laden car with weak linings is held until the pedal is let go."""

import math
from pathlib import Path

import numpy as np

from brakelab.simulation.closed_loop import Drive, new_loop, run
from brakelab.simulation.scenario import Scenario, load_scenario
from ecu.settings.config import load_config

CONFIG = Path(__file__).parents[2] / "config"
PAYLOAD = load_scenario(CONFIG / "scenarios" / "type-0-laden.toml").payload
STOPPED, EASED = 3.0, 8.0  # s: the pedal has brought the car to rest and is eased; it is let go


def drive_up(hold_grade: float) -> Drive:
    """Stop on 20 % uphill, ease the pedal to what hardly brakes, let it go; linings at 0.7 of nominal."""
    phases = [
        {"kind": "brake", "pedal": 70.0, "seconds": STOPPED},
        {"kind": "brake", "pedal": 8.0, "seconds": EASED - STOPPED},
        {"kind": "coast", "seconds": 2.0},
    ]
    scenario = Scenario.model_validate(
        {"plant": "suv", "payload": PAYLOAD, "initial_speed": 4.0, "grade": math.atan(0.2), "phase": phases}
    )
    config = load_config(CONFIG / "suv.toml")
    control = config.control.model_copy(update={"hold_grade": hold_grade})
    loop = new_loop(scenario, config.model_copy(update={"control": control}), 1)
    loop.sides.vehicle.params[0]["friction_scale"] *= np.array([0.7 / 0.85] * 2 + [0.7 / 1.1] * 2)
    return run(loop)


def test_the_car_is_held_on_the_grade_until_the_pedal_is_let_go() -> None:
    drive = drive_up(0.2)
    speed, eased = drive.truth["vehicle_speed"], (drive.t > STOPPED) & (drive.t < EASED)
    print(f"eased: {np.abs(speed[eased]).max():.3f} m/s, let go: {speed[-1]:.2f} m/s")
    assert np.abs(speed[eased]).max() < 0.05, "more than the simulated tyre creeps under load"
    assert drive.outputs["decel_demand_total"][-1] == 0.0
    assert sum(drive.outputs[f"pressure_demand_{c}"][-1] for c in ("fl", "fr", "rl", "rr")) == 0.0
    # 0.2 s until the foot is off, 0.7 s of fading: it has rolled back for a second or more.
    assert speed[-1] < -1.0


def test_without_a_holding_demand_it_would_roll() -> None:
    drive = drive_up(0.0)
    assert drive.truth["vehicle_speed"][drive.t < EASED][-1] < -2.0
