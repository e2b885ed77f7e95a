"""Standing on the steepest grade: the laden car with weak linings is held until the pedal is let go."""

import math

import numpy as np

from brakelab.simulation.scenario import load_scenario
from brakelab.testing.drive import Ecu, Plant
from ecu.settings.resources import resource

PAYLOAD = load_scenario(resource("config/scenarios/type-0-laden.toml")).payload
STOPPED, EASED = 3.0, 8.0  # s: the pedal has brought the car to rest and is eased; it is let go
UP = {
    "plant": "suv",
    "payload": PAYLOAD,
    "car": {"friction_scale_front": "82.35 %", "friction_scale_rear": "63.64 %"},  # 0.7 of nominal
    "initial_speed": 4.0,
    "grade": math.atan(0.2),
    "phase": [
        {"kind": "brake", "pedal": 70.0, "seconds": STOPPED},
        {"kind": "brake", "pedal": 8.0, "seconds": EASED - STOPPED},
        {"kind": "coast", "seconds": 2.0},
    ],
}


def test_the_car_is_held_on_the_grade_until_the_pedal_is_let_go(ecu: Ecu, plant: Plant) -> None:
    plant.drive(UP, seed=1)
    # More than the simulated tyre creeps under load.
    plant["vehicle_speed"].between(STOPPED + 0.01, EASED).within(-0.05, 0.05, "m/s")
    ecu["decel_demand_total"].between(EASED + 1.99).near(0.0, 0.0, "m/s^2")
    for corner in ("fl", "fr", "rl", "rr"):
        ecu[f"pressure_demand_{corner}"].between(EASED + 1.99).near(0.0, 0.0, "bar")
    # 0.2 s until the foot is off, 0.7 s of fading: it has rolled back for a second or more.
    assert plant["vehicle_speed"].values[-1] < -1.0


def test_without_a_holding_demand_it_would_roll(ecu: Ecu, plant: Plant) -> None:
    ecu.changes["control.hold_grade"] = 0.0
    plant.drive(UP, seed=1)
    assert np.min(plant["vehicle_speed"].between(STOPPED, EASED).values) < -2.0
