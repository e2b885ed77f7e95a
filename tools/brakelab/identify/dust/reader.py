"""Trips with a particle counter: their manifest and their files, checked.

The manifest is a CSV file, a row a trip: `trip`, `file`, `test` (1: held out). A trip's file (CSV or Parquet)
has `t` [s], `vehicle_speed` [m/s], `calliper_pressure_fr` [bar], `brake_torque_fr` [N m],
`disc_temperature_fr` [degC], `particle_concentration` [1/cm^3 in the sampled flow] and `tunnel_flow` [m^3/s],
or the names and units of a file of columns.
Rows without a value are between two samples: the counter has one a second, the others about ten. Where the
counter drops out for longer, the brake applications are left out.
"""

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Array
from brakelab.identify.dust.features import (
    MOVING,
    PERIOD,
    PRESSED,
    SHORTEST_APPLICATION,
    Applications,
    Recorded,
    extract,
)
from brakelab.identify.friction.check import numbers_of, refuse_units, say_unlike
from brakelab.identify.friction.columns import Columns, load_columns
from brakelab.identify.friction.reader import in_si, positive
from brakelab.identify.friction.recording import Recording
from brakelab.identify.friction.sensors import without_zero
from brakelab.identify.manifest import measured_rows, read_manifest, refuse_row
from brakelab.identify.measurement_files import check_celsius, read_columns
from brakelab.identify.units import COUNTED
from brakelab.stretches import stretches
from ecu.errors import UserError
from ecu.output import say
from ecu.settings.config import Config

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
IN_ORDER: Final = (COLUMNS[0], COLUMNS[2], COLUMNS[3], COLUMNS[1], COLUMNS[4])
"""As `Columns.contract` has them."""
LONGEST_GAP: Final = 5.0  # s between two samples
MISSED: Final = 2.5  # of the counter's usual period: longer a gap hides a plume
LEAST_COUNTED: Final = 0.5  # share of a trip
FEWEST_TRIPS: Final = 3  # for identification: each is left out once
FEWEST_APPLICATIONS: Final = 20  # applications of a trip
HIGHEST_SPEED: Final = 90.0  # m/s
HIGHEST_TEMPERATURE: Final = 900.0  # degC
MOST_COUNT: Final = 1e6  # 1/cm^3; a street has 1e3 to 1e5
LONGEST_TOP: Final = 10.0  # s at the greatest value, to the digit
MOST_FLOW: Final = 5.0  # m^3/s


def read_trips(manifest: Path, config: Config, axle: str, given: Path | None = None) -> list[Applications]:
    """Return the applications of every trip of a CSV manifest, measured on a brake of an `axle` of `config`.

    `given`: file of columns of all trips.

    Raises:
        UserError: a file, a row or a value of it is invalid.
    """
    trips, numbers = [], []
    columns = trip_columns(config, axle, given)
    for line, row in measured_rows(read_manifest(manifest, given)):
        if not row.get("trip") or not row.get("file") or row.get("test") not in ("0", "1"):
            raise refuse_row(manifest, line, row, "trip, file and test (1: held out, else 0)")
        path = manifest.parent / row["file"]
        trip = read_trip(path, row["trip"], row["test"] == "1", columns)
        found = extract(trip, columns.brake.tyre_radius)
        if len(found.particles) < FEWEST_APPLICATIONS:
            remedy = f"{len(found.particles)} brake applications; a trip needs {FEWEST_APPLICATIONS} or more"
            raise UserError(str(path), f"trip {row['trip']}", remedy)
        if found.particles.sum() <= 0.0:
            raise UserError(str(path), "particle_concentration", "does not rise when the brake is applied")
        if found.left_out:
            many = f"{found.left_out} brake application{'s are' if found.left_out > 1 else ' is'} left out"
            say(f"{path}: particle_concentration: {off_count(trip)}; {many}")
        trips.append(found)
        numbers.append(numbers_of(*_applications(trip, columns)))
    if sum(not trip.test for trip in trips) < FEWEST_TRIPS:
        remedy = f"give {FEWEST_TRIPS} or more trips with test 0: each is left out once"
        raise UserError(str(manifest), "test", remedy)
    say_unlike([trip.trip for trip in trips], numbers, str(manifest), "trip")
    return trips


def trip_columns(config: Config, axle: str, given: Path | None = None) -> Columns:
    """Return what describes the files of trips, of a brake of an `axle`: `given`, else the contract.

    Raises:
        UserError: the file of columns is invalid.
    """
    contract = Columns.contract(IN_ORDER, "m/s", config, axle)
    return contract if given is None else load_columns(given, contract)


def read_trip(path: Path, name: str, test: bool, described: Columns) -> Recorded:
    """Return a trip from its file, checked.

    Raises:
        UserError: the file or a value of it is invalid.
    """
    columns = _read(path, described)
    t = columns["t"]
    if len(t) < 2:
        raise UserError(str(path), "t", "must rise from row to row")
    grid = np.arange(t[0], t[-1], PERIOD)
    count = COLUMNS[5]
    even = {c: on_grid(path, c, t, columns[c], grid, c == count) for c in COLUMNS[1:]}
    counted = ~in_gap(t[np.isfinite(columns[count])], grid)
    _check_ranges(path, even)
    speed, pressure, torque, temperature, concentration, flow = even.values()
    braked = Recording(grid, 1e5 * pressure, positive(torque), speed, temperature)
    torque = without_zero(braked, described, str(path)).torque
    pressure = pressure - described.rig.push_out_pressure
    trip = Recorded(
        name, test, grid - grid[0], np.maximum(speed, 0.0), pressure, np.abs(torque), temperature,
        concentration, flow, counted,
    )  # fmt: skip
    if counted.mean() < LEAST_COUNTED:
        raise UserError(
            str(path), count, f"{off_count(trip)}; too much of a trip of {grid[-1] - grid[0]:.0f} s"
        )
    _check_units(path, trip, described)
    return trip


def off_count(trip: Recorded) -> str:
    """Return how long and where the counter dropped out first."""
    at = float(trip.t[np.argmin(trip.counted)])
    return f"no count for {PERIOD * np.count_nonzero(~trip.counted):.0f} s in all, first at t = {at:.0f} s"


def in_gap(samples: Array, grid: Array) -> NDArray[np.bool_]:
    """Return which times of a grid lie between samples of a counter that are further apart than usual."""
    longest = min(LONGEST_GAP, MISSED * float(np.median(np.diff(samples)))) if len(samples) > 1 else 0.0
    edges = np.concatenate([[-np.inf], samples, [np.inf]])
    after = np.searchsorted(edges, grid)
    near = np.minimum(edges[after], grid[-1]) - np.maximum(edges[after - 1], grid[0])
    return np.asarray(near > longest)


def _read(path: Path, described: Columns) -> dict[str, Array]:
    """Return a trip by `COLUMNS`, in their units."""
    of = described.columns
    time, pressure, torque, speed, heat = of.time, of.pressure, of.torque, of.speed, of.temperature
    given = (time, speed, pressure, torque, heat, of.concentration, of.flow)
    names = tuple(name for name, _ in given)
    read = read_columns(path, names, "trip", counts=names[5:6], stated=names == COLUMNS)
    values = [read[name] for name, _ in given]
    for place, quantity in enumerate(("time", "speed", "pressure", "torque", "temperature")):
        values[place] = in_si(described, quantity, values[place])
    values[1] = values[1] * described.brake.tyre_radius
    values[2] = 1e-5 * values[2]
    values[5] = values[5] * COUNTED["concentration"][of.concentration[1]]
    values[6] = values[6] * COUNTED["flow"][of.flow[1]]
    return dict(zip(COLUMNS, values, strict=True))


def _check_units(path: Path, trip: Recorded, columns: Columns) -> None:
    """Refuse a brake's columns in other units than they should have."""
    applications, _, whole = _applications(trip, columns)
    if applications:
        refuse_units(applications, columns, str(path), whole)


def _applications(trip: Recorded, columns: Columns) -> tuple[list[Recording], Columns, Recording]:
    """Return the brake applications of a trip, `columns` and all of it, as `numbers_of` takes them."""
    whole = Recording(
        trip.t,
        1e5 * (trip.pressure + columns.rig.push_out_pressure),
        trip.torque,
        trip.speed / columns.brake.tyre_radius,
        trip.temperature,
    )
    pressed = stretches((trip.pressure > PRESSED) & (trip.speed > MOVING))
    applications = [
        Recording(*(values[begin:end] for values in whole))
        for begin, end in pressed
        if (end - begin) * PERIOD >= SHORTEST_APPLICATION
    ]
    return applications, columns, whole


def on_grid(path: Path, name: str, t: Array, values: Array, grid: Array, gaps_pass: bool = False) -> Array:
    """Return samples at the times of a grid; NaN among them is between two samples.

    Raises:
        UserError: there is none, or two are too far apart and gaps do not pass.
    """
    known = np.isfinite(values)
    gaps = np.diff(t[known], prepend=t[0], append=t[-1])
    if not known.any() or (gaps.max() > LONGEST_GAP and not gaps_pass):
        at = "no sample" if not known.any() else f"a gap of {gaps.max():.0f} s"
        raise UserError(str(path), name, f"{at}; samples must not be {LONGEST_GAP:.0f} s apart")
    return np.asarray(np.interp(grid, t[known], values[known]))


def _check_ranges(path: Path, even: dict[str, Array]) -> None:
    speed, heat = even["vehicle_speed"], even[f"disc_temperature_{CORNER}"]
    flow, count = even["tunnel_flow"], even["particle_concentration"]
    if speed.max() > HIGHEST_SPEED:
        raise UserError(str(path), "vehicle_speed", f"up to {speed.max():.0f} m/s: km/h? convert it to m/s")
    check_celsius(path, f"disc_temperature_{CORNER}", heat, HIGHEST_TEMPERATURE)
    if not 0.0 < flow.min() <= flow.max() < MOST_FLOW:
        remedy = f"{flow.min():.3g} to {flow.max():.3g} cannot be m^3/s of a tunnel; convert it"
        raise UserError(str(path), "tunnel_flow", remedy)
    if np.median(count) > MOST_COUNT:
        remedy = f"{np.median(count):.1g} most of the time cannot be 1/cm^3 of air: 1/m^3? convert it"
        raise UserError(str(path), "particle_concentration", remedy)
    top = count == count.max()
    if np.count_nonzero(top) * PERIOD > LONGEST_TOP:
        remedy = (
            f"stands at {count.max():.3g} for {np.count_nonzero(top) * PERIOD:.0f} s: the counter counts no "
            "more than that; dilute the sample, and leave this trip out"
        )
        raise UserError(str(path), "particle_concentration", remedy)
    if count.min() < 0.0:
        raise UserError(str(path), "particle_concentration", "below zero; leave out what is not counted")
