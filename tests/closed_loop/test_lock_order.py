"""Wheel-lock sequence of ECE R13-H, Annex 5: the front locks before the rear, or within 0.1 s of it.

The linings are at the wrong ends of their 2 sigma, 30 % off; compensation and slip guard are switched off:
nothing but the watch over the rear's slip keeps the order.
"""

from pathlib import Path

import numpy as np
import pytest

from brakelab.simulation.closed_loop import new_loop, run
from brakelab.simulation.scenario import Scenario
from ecu.settings.config import load_config

CONFIG = Path(__file__).parents[2] / "config"
LOCKED = -0.9
START = 6.0  # s of cruising before
SIMULTANEOUS = 0.1  # s


def lock_times(
    road: float, speed: float, ramp: float, seed: int, watched: bool, rear_wears: float | None = None
) -> tuple[float, float]:
    """Return when the second wheel of each axle locks [s] after the brakes were asked for; inf: never.

    `rear_wears`: wear of the rear linings over the front's, which `control.minimise` then spares.
    """
    phases = [
        {"kind": "cruise", "speed": speed, "seconds": START},
        {"kind": "brake", "decel": 10.0, "ramp": ramp, "seconds": 2.5},
    ]
    scenario = Scenario.model_validate(
        {"plant": "suv", "draw": "nominal", "initial_speed": speed, "road_friction": road, "phase": phases}
    )
    config = load_config(CONFIG / "suv.toml")
    control = config.control.model_copy(update={"compensation": "off", "slip_guard": False})
    rear = config.rear
    if rear_wears is not None:
        control = control.model_copy(update={"minimise": "wear"})
        rear = rear.model_copy(update={"pad": rear.pad.model_copy(update={"road_scale": rear_wears})})
    loop = new_loop(scenario, config.model_copy(update={"control": control, "rear": rear}), seed)
    if not watched:
        loop.sides.params["rear_slip_margin"] = np.inf
    # The plant's linings are 0.85 and 1.10 of what the ECU counts on.
    loop.sides.vehicle.params[0]["friction_scale"] *= np.array([0.7 / 0.85] * 2 + [1.3 / 1.1] * 2)
    drive = run(loop)
    times = []
    for wheels in (("fl", "fr"), ("rl", "rr")):
        locked = np.all([drive.truth[f"slip_{wheel}"] < LOCKED for wheel in wheels], axis=0)
        times.append(drive.t[np.argmax(locked)] - START if locked.any() else np.inf)
    return times[0], times[1]


# Annex 5: 80 km/h on a road of about 0.8, 60 km/h on one of 0.3 at most.
@pytest.mark.parametrize(("road", "speed", "ramp"), [(0.8, 22.2, 13.3), (0.3, 16.7, 4.0)])
def test_the_front_locks_first_whatever_the_linings_do(road: float, speed: float, ramp: float) -> None:
    for seed in (1, 2, 3):
        front, rear = lock_times(road, speed, ramp, seed, watched=True)
        front_alone, rear_alone = lock_times(road, speed, ramp, seed, watched=False)
        print(f"road {road}: front {front:.2f} s, rear {rear:.2f} s")
        print(f"not watched: front {front_alone:.2f} s, rear {rear_alone:.2f} s")
        assert front <= rear + SIMULTANEOUS
        assert rear_alone < front_alone - SIMULTANEOUS, "this test would not see a missing watch"


@pytest.mark.parametrize(("road", "speed", "ramp"), [(0.8, 22.2, 13.3), (0.3, 16.7, 4.0)])
@pytest.mark.parametrize("rear_wears", [0.2, 5.0])
def test_the_order_is_kept_where_wear_is_minimised(
    road: float, speed: float, ramp: float, rear_wears: float
) -> None:
    """Linings of the rear that wear little take most of a gentle braking; the hard one is as above."""
    for seed in (1, 2):
        front, rear = lock_times(road, speed, ramp, seed, watched=True, rear_wears=rear_wears)
        print(f"road {road}, rear wears x{rear_wears}: front {front:.2f} s, rear {rear:.2f} s")
        assert front <= rear + SIMULTANEOUS
        assert np.isfinite(front)
