"""Trips with a particle counter: their manifest and their files, checked.

The manifest is a CSV file, a row a trip: `trip`, `file`, `test` (1: held out). A trip's file (CSV or Parquet)
has `t` [s], `vehicle_speed` [m/s], `calliper_pressure_fr` [bar], `brake_torque_fr` [N m],
`disc_temperature_fr` [degC], `particle_concentration` [1/cm^3 in the sampled flow] and `tunnel_flow` [m^3/s].
Rows without a value are between two samples: the counter has one a second, the others about ten.
"""

from pathlib import Path
from typing import Final

import numpy as np

from brakelab.arrays import Array
from brakelab.identify.dust.features import PERIOD, Applications, Recorded, extract
from brakelab.identify.measurement_files import check_celsius, read_columns, read_manifest
from ecu.errors import UserError

CORNER: Final = "fr"
COLUMNS: Final = (
    "t",
    "vehicle_speed",
    f"calliper_pressure_{CORNER}",
    f"brake_torque_{CORNER}",
    f"disc_temperature_{CORNER}",
    "particle_concentration",
    "tunnel_flow",
)
LONGEST_GAP: Final = 5.0  # s between two samples
FEWEST_TRIPS: Final = 3  # for identification: each is left out once
FEWEST: Final = 20  # applications of a trip
FASTEST: Final = 90.0  # m/s
HOTTEST: Final = 900.0  # degC
MOST_FLOW: Final = 5.0  # m^3/s


def read_trips(manifest: Path, push_out: float, radius: float) -> list[Applications]:
    """Return the applications of every trip of a manifest.

    Args:
        manifest: CSV.
        push_out: push-out pressure [bar].
        radius: of the tyre [m].

    Raises:
        UserError: a file, a row or a value of it is invalid.
    """
    trips = []
    for line, row in enumerate(read_manifest(manifest), 2):
        if not row.get("trip") or not row.get("file") or row.get("test") not in ("0", "1"):
            raise UserError(str(manifest), f"line {line}", "needs trip, file and test (1: held out, else 0)")
        path = manifest.parent / row["file"]
        found = extract(_read_trip(path, row["trip"], row["test"] == "1", push_out), radius)
        if len(found.particles) < FEWEST:
            remedy = f"{len(found.particles)} brake applications; a trip needs {FEWEST} or more"
            raise UserError(str(path), f"trip {row['trip']}", remedy)
        if found.particles.sum() <= 0.0:
            raise UserError(str(path), "particle_concentration", "does not rise when the brake is applied")
        trips.append(found)
    if sum(not trip.test for trip in trips) < FEWEST_TRIPS:
        remedy = f"give {FEWEST_TRIPS} or more trips with test 0: each is left out once"
        raise UserError(str(manifest), "test", remedy)
    return trips


def _read_trip(path: Path, name: str, test: bool, push_out: float) -> Recorded:
    columns = read_columns(path, COLUMNS, "trip")
    t = columns["t"]
    if len(t) < 2:
        raise UserError(str(path), "t", "must rise from row to row")
    grid = np.arange(t[0], t[-1], PERIOD)
    even = {c: _on_grid(path, c, t, columns[c], grid) for c in COLUMNS[1:]}
    _check_ranges(path, even)
    speed, pressure, torque, temperature, concentration, flow = even.values()
    return Recorded(
        name, test, grid - grid[0], np.maximum(speed, 0.0), pressure - push_out, np.abs(torque), temperature,
        concentration, flow,
    )  # fmt: skip


def _on_grid(path: Path, name: str, t: Array, values: Array, grid: Array) -> Array:
    known = np.isfinite(values)
    gaps = np.diff(t[known], prepend=t[0], append=t[-1])
    if not known.any() or gaps.max() > LONGEST_GAP:
        at = "no sample" if not known.any() else f"a gap of {gaps.max():.0f} s"
        raise UserError(str(path), name, f"{at}; samples must not be {LONGEST_GAP:.0f} s apart")
    return np.asarray(np.interp(grid, t[known], values[known]))


def _check_ranges(path: Path, even: dict[str, Array]) -> None:
    speed, heat = even["vehicle_speed"], even[f"disc_temperature_{CORNER}"]
    flow, count = even["tunnel_flow"], even["particle_concentration"]
    if speed.max() > FASTEST:
        raise UserError(str(path), "vehicle_speed", f"up to {speed.max():.0f} m/s: km/h? convert it to m/s")
    check_celsius(path, f"disc_temperature_{CORNER}", heat, HOTTEST)
    if not 0.0 < flow.min() <= flow.max() < MOST_FLOW:
        remedy = f"{flow.min():.3g} to {flow.max():.3g} cannot be m^3/s of a tunnel; convert it"
        raise UserError(str(path), "tunnel_flow", remedy)
    if count.min() < 0.0:
        raise UserError(str(path), "particle_concentration", "below zero; leave out what is not counted")
