"""Wear and emission of each brake application, from `RESULT.brakes.parquet` and the rows after it."""

from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Vector
from brakelab.report.drive import DriveResult
from brakelab.results.columns import open_columns
from brakelab.results.files import brakes_path
from ecu.contract.signals import CORNERS

_REMEDY: Final = "write it again with `brake-ecu replay`"
_PER_CORNER: Final = (
    "brake_energy", "disc_temperature_mean", "pad_wear_mass", "particle_mass", "particle_mass_low",
    "particle_mass_high", "emission_factor", "emission_factor_low", "emission_factor_high",
)  # fmt: skip
AFTER: Final = 0.005  # s after an application: the ECU has counted its particles
DIRTIEST_SHOWN: Final = 10


class Application(NamedTuple):
    """One brake application of any length; per corner shape (4,), NaN: not available."""

    t_start: float
    t_end: float
    v_in: float
    v_end: float
    """m/s"""
    energy: float
    """Of the four brakes, J."""
    worn: Vector
    """Mass of both pads of a calliper, g."""
    mass: float
    """Of particles, all brakes, mg."""
    mass_low: float
    mass_high: float
    particles: float
    """All brakes that have a model."""
    particles_low: float
    particles_high: float
    heat: Vector
    """Mean temperature of the discs, degC."""
    energies: Vector
    """J, per corner."""
    factor: Vector
    """log10(particles), per corner."""
    factor_low: Vector
    factor_high: Vector


def read_applications(drive: DriveResult, result: Path) -> list[Application]:
    """Return the brake applications of a drive in order; none without their file.

    Raises:
        UserError: the file is damaged.
    """
    path = brakes_path(result)
    if not path.exists():
        return []
    table = open_columns(path, _REMEDY, ("corner",))
    corner, brake = table.columns["corner"], table.numbers("brake")
    first = np.flatnonzero(corner == CORNERS[0])
    order = np.array([np.flatnonzero(corner == name) for name in CORNERS])
    if len(corner) == 0 or order.size != len(corner) or (brake[order] != brake[first]).any():
        return []  # `brakings` has refused it, or there is none
    t, duration, v_in, v_end = (
        table.numbers(name)[first] for name in ("t_start", "duration", "v_in", "v_end")
    )
    energy, heat, worn, mass, mass_low, mass_high, factor, low, high = (
        table.known_numbers(name)[order] for name in _PER_CORNER
    )
    after = np.searchsorted(drive.t, t + duration + AFTER)
    ended = after < len(drive.t)
    count, count_low, count_high = (
        np.where(ended, drive.column(f"particles_last_brake{end}")[np.where(ended, after, 0)], np.nan)
        for end in ("", "_low", "_high")
    )
    return [
        Application(
            float(t[k]), float(t[k] + duration[k]), float(v_in[k]), float(v_end[k]),
            _total(energy[:, k]), worn[:, k], _total(mass[:, k]),
            _total(mass_low[:, k]), _total(mass_high[:, k]),
            float(count[k]), float(count_low[k]), float(count_high[k]),
            heat[:, k], energy[:, k], factor[:, k], low[:, k], high[:, k],
        )
        for k in range(len(t))
    ]  # fmt: skip


def _total(values: Vector) -> float:
    """Return the sum over the corners that are known, NaN if none is."""
    known = values[np.isfinite(values)]
    return float(known.sum()) if known.size else float("nan")


def dirtiest(applications: list[Application]) -> list[Application]:
    """Return the `DIRTIEST_SHOWN` applications, by particles where they are counted, else by their mass."""
    counted = [each for each in applications if np.isfinite(each.particles)]
    weighed = [each for each in applications if np.isfinite(each.mass) and each.mass > 0.0]
    if counted:
        return sorted(counted, key=lambda each: -each.particles)[:DIRTIEST_SHOWN]
    return sorted(weighed, key=lambda each: -each.mass)[:DIRTIEST_SHOWN]
