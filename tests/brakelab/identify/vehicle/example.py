"""A car in closed form: samples of a drive whose parameters are known, with the noise of Table 4.1."""

import numpy as np

from brakelab.identify.vehicle.reader import PRESENT, DriveSamples, drive_of
from brakelab.logs.physics.samples import SAMPLED
from ecu.settings.config import load_config, new_params
from ecu.settings.resources import resource

SUV = resource("config/suv.toml")
RADIUS = 0.36


def suv():
    """Return the parameters of config/suv.toml, shape (1,)."""
    return new_params(load_config(SUV))


def samples(seconds: float, speed, **signals) -> np.ndarray:
    """Return samples of 10 ms: wheels that roll at `speed` [m/s] and the given signals, shape (n, …)."""
    n = round(100 * seconds)
    rows = np.full((n, len(SAMPLED)), np.nan)
    noise = np.random.default_rng(1)
    for corner in ("fl", "fr", "rl", "rr"):
        rows[:, PRESENT[f"wheel_speed_{corner}"]] = speed / RADIUS + 0.1 * noise.standard_normal(n)
    rows[:, PRESENT["accel_x"]] = np.gradient(np.broadcast_to(speed, n), 0.01) + 0.01 * noise.standard_normal(
        n
    )
    for name, values in signals.items():
        rows[:, PRESENT[name]] = values
    return rows


def drive(seconds: float, speed, **signals) -> DriveSamples:
    """Return them as a drive."""
    return drive_of("drive.csv", samples(seconds, speed, **signals))
