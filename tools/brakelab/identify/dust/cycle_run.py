"""Report on one's own run of the WLTP-Brake cycle, for UN Regulation 179 (`identify dust --cycle`).

RUN.csv has a row a trip, in order: `trip`, `file` (as for `identify dust`, with `solid_concentration`
[1/cm^3], or `solid` of a file of columns, where solid particles were counted, too) and `reference`, a file of
`t` [s] and `vehicle_speed` [m/s] as prescribed. What is of the whole run stands in one of its rows, or in one
without a file: `pm10_filter`, `pm25_filter` [mg],
gained; `pm10_flow`, `pm25_flow` [m^3/s], drawn through them; `pads_mass_before`, `pads_mass_after`,
`disc_mass_before`, `disc_mass_after` [g]; `friction_share`, c of this car.

    PM = filter gained (tunnel flow / flow drawn) / distance      PN = integral Q C dt / distance
    both times c; net: of C minus the background, as when cruising (Figure 8.2)

The regulation's text was not at hand: what it asks is stated where it is published elsewhere, with its
source, and judged nowhere else.
"""

import math
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from pydantic import ValidationError, field_validator

from brakelab.arrays import Array
from brakelab.identify.dust.features import (
    PERIOD,
    Recorded,
    aligned,
    find_applications,
    find_background,
    transport_time,
)
from brakelab.identify.dust.reader import IN_ORDER, MOST_COUNT, off_count, on_grid, read_trip
from brakelab.identify.friction.columns import Column, Columns, Names
from brakelab.identify.friction.reader import in_si
from brakelab.identify.manifest import read_manifest, refuse_row
from brakelab.identify.measurement_files import read_columns
from brakelab.identify.units import COUNTED
from brakelab.simulation.trip.wltp_brake import TRIPS
from brakelab.stretches import stretches
from ecu.errors import UserError
from ecu.settings.config import Config
from ecu.settings.toml_file import describe, read_toml

NEAR_SPEED: Final = 2.0 / 3.6
NEAR_S: Final = 1.0
"""m/s and s by which the speed may leave its trace. Assumption: as the WLTP on a chassis dynamometer."""
WHOLE: Final = (
    "pm10_filter", "pm25_filter", "pm10_flow", "pm25_flow", "pads_mass_before", "pads_mass_after",
    "disc_mass_before", "disc_mass_after", "friction_share",
)  # fmt: skip
SOLID: Final = ("solid_concentration", "1/cm^3")
HEAVIEST_FILTER: Final = 100.0  # mg; a run gains 0.1 to 10


class RunNames(Names):
    """Columns of a run's trips."""

    solid: Column = SOLID

    @field_validator("solid")
    @classmethod
    def _unit(cls, solid: Column) -> Column:
        if solid[1] not in (units := COUNTED["concentration"]):
            raise ValueError(f"unit {solid[1]!r} of solid unknown; one of {', '.join(units)}")
        return solid


class RunColumns(Columns):
    """A file of columns of a run."""

    columns: RunNames


class TripRun(NamedTuple):
    """One trip as run; NaN: not measured."""

    name: str
    km: float
    seconds: float
    applications: int
    work: float
    """Of the brake, MJ."""
    cold: float
    """Of the disc at the start, degC."""
    hottest: float
    violations: int
    """Stretches outside the tolerance; -1: no reference."""
    outside: float
    """s"""
    air: float
    """Through the tunnel, m^3."""
    total: float
    """Particles."""
    background: float
    """Of them, by cruising."""
    solid: float
    unseen: float
    """s by which the air of the last application still was in the line when the file ended."""


class Run(NamedTuple):
    """A run of the cycle at one brake."""

    trips: list[TripRun]
    whole: dict[str, float]
    """By `WHOLE`; NaN: not measured."""

    def sum_of(self, name: str) -> float:
        """Return the sum of a quantity over the trips."""
        return float(sum(getattr(trip, name) for trip in self.trips))

    @property
    def share(self) -> float:
        """Return the friction share coefficient, 1 where none is stated."""
        stated = self.whole["friction_share"]
        return stated if np.isfinite(stated) else 1.0

    def mass(self, fraction: str) -> float:
        """Return PM10 or PM2.5 of the brake [mg/km], of "pm10" or "pm25"."""
        gained, drawn = self.whole[f"{fraction}_filter"], self.whole[f"{fraction}_flow"]
        tunnel = self.sum_of("air") / self.sum_of("seconds")
        return self.share * gained * tunnel / drawn / self.sum_of("km")

    def number(self, name: str) -> float:
        """Return particles of the brake [1/km], of "total", "background" or "solid"."""
        return self.share * self.sum_of(name) / self.sum_of("km")

    def lost(self, what: str) -> float:
        """Return what "pads" or "disc" lost [mg/km], of linings alone: without c."""
        lost = self.whole[f"{what}_mass_before"] - self.whole[f"{what}_mass_after"]
        return 1e3 * lost / self.sum_of("km")


def read_run(manifest: Path, config: Config, axle: str, given: Path | None = None) -> Run:
    """Return the run of a manifest. `given`: file of columns of its trips.

    Raises:
        UserError: a file, a row or a value of it is invalid.
    """
    columns = run_columns(config, axle, given)
    trips, whole = [], dict.fromkeys(WHOLE, math.nan)
    rows = read_manifest(manifest, given)
    if not rows:
        raise UserError(str(manifest), "", f"no trips; give a row for each of {len(TRIPS)}")
    seen: dict[str, int] = {}
    for line, row in rows:
        where = f"line {line}"
        for name in WHOLE:
            if row.get(name):
                whole[name] = _stated(manifest, f"{where}, {name}", row[name], whole[name])
        if not row.get("file") and any(row.get(name) for name in WHOLE):
            continue
        if not row.get("trip") or not row.get("file"):
            raise refuse_row(manifest, line, row, "trip and file")
        if (before := seen.setdefault(row["file"], line)) != line:
            raise UserError(str(manifest), where, f"{row['file']} is the trip of line {before}")
        path = manifest.parent / row["file"]
        trip = read_trip(path, row["trip"], False, columns)
        if not trip.counted.all():
            remedy = f"{off_count(trip)}; the sum needs all of the cycle"
            raise UserError(str(path), "particle_concentration", remedy)
        reference = manifest.parent / row["reference"] if row.get("reference") else None
        trips.append(_run(path, trip, reference, columns))
    _check(manifest, whole)
    run = Run(trips, whole)
    tunnel = run.sum_of("air") / run.sum_of("seconds")
    for name in ("pm10_flow", "pm25_flow"):
        if whole[name] > tunnel:
            remedy = f"{whole[name]:g} m^3/s drawn of {tunnel:.3g} m^3/s in the tunnel: l/min? give m^3/s"
            raise UserError(str(manifest), name, remedy)
    return run


def run_columns(config: Config, axle: str, given: Path | None) -> RunColumns:
    """Return what describes the files of a run's trips, of a brake of an `axle`: `given`, else the contract.

    Raises:
        UserError: the file of columns is invalid.
    """
    parts = {"brake", "rig", "disc"} if given else None
    stated = Columns.contract(IN_ORDER, "m/s", config, axle).model_dump(include=parts)
    try:
        return RunColumns.model_validate(stated | (read_toml(given) if given else {}))
    except ValidationError as error:
        raise describe(error, str(given), RunColumns) from None


def _stated(manifest: Path, place: str, cell: str, before: float) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise UserError(str(manifest), place, f"give a number (found {cell!r})")
    if np.isfinite(before) and value != before:
        remedy = f"{value:g}, and {before:g} in a row above; it is of the whole run: state it once"
        raise UserError(str(manifest), place, remedy)
    return value


def _check(manifest: Path, whole: dict[str, float]) -> None:
    """Refuse numbers of the whole run that cannot be, or are halves of a pair."""
    pairs = [(f"{pm}_filter", f"{pm}_flow") for pm in ("pm10", "pm25")]
    pairs += [(f"{part}_mass_before", f"{part}_mass_after") for part in ("pads", "disc")]
    for one, other in pairs:
        if np.isfinite(whole[one]) != np.isfinite(whole[other]):
            missing, given = (other, one) if np.isfinite(whole[one]) else (one, other)
            raise UserError(str(manifest), missing, f"missing; {given} is stated")
    for pm in ("pm10", "pm25"):
        gained, drawn = whole[f"{pm}_filter"], whole[f"{pm}_flow"]
        if not 0.0 <= gained < HEAVIEST_FILTER and np.isfinite(gained):
            raise UserError(str(manifest), f"{pm}_filter", f"{gained:g} mg on a filter cannot be; in mg, net")
        if drawn <= 0.0:
            raise UserError(str(manifest), f"{pm}_flow", f"{drawn:g} m^3/s; give the flow drawn")
    if whole["pm25_filter"] / whole["pm25_flow"] > whole["pm10_filter"] / whole["pm10_flow"]:
        remedy = "more than PM10, of which it is a part: are the filters or flows exchanged?"
        raise UserError(str(manifest), "pm25_filter", remedy)
    if whole["pads_mass_before"] <= whole["pads_mass_after"]:
        raise UserError(
            str(manifest), "pads_mass_after", "pads gained mass; weigh them dry, both times alike"
        )
    if not 0.0 < whole["friction_share"] <= 1.0 and np.isfinite(whole["friction_share"]):
        raise UserError(str(manifest), "friction_share", f"{whole['friction_share']:g} is not of 0 to 1")


def _run(path: Path, trip: Recorded, reference: Path | None, columns: RunColumns) -> TripRun:
    violations, outside = -1, math.nan
    if reference is not None:
        violations, outside = speed_violations(trip, reference)
    applications = find_applications(trip)
    air = PERIOD * trip.flow
    work = 1e-6 * PERIOD * float(trip.torque @ trip.speed) / columns.brake.tyre_radius
    delay, ground = _ground(trip)
    after = PERIOD * (len(trip.t) - applications[-1][1]) if applications else math.inf
    return TripRun(
        trip.name,
        1e-3 * PERIOD * float(trip.speed.sum()),
        PERIOD * len(trip.t),
        len(applications),
        work,
        float(np.median(trip.temperature[: round(NEAR_S / PERIOD)])),
        float(trip.temperature.max()),
        violations,
        outside,
        float(air.sum()),
        1e6 * float(air @ trip.concentration),
        1e6 * float(air.sum()) * ground,
        _solid(path, trip, air, columns),
        max(delay - after, 0.0),
    )


def _ground(trip: Recorded) -> tuple[float, float]:
    """Return the delay of the air [s] and the mean background [1/cm^3], NaN where nothing cruises."""
    try:
        delay = transport_time(trip)
    except UserError:  # what is counted follows no braking
        delay = 0.0
    late = aligned(trip, delay)
    try:
        return delay, float(find_background(late, find_applications(late)).at(late.speed).mean())
    except UserError:
        return delay, math.nan


def _solid(path: Path, trip: Recorded, air: Array, columns: RunColumns) -> float:
    """Return the solid particles of a trip; NaN: not counted."""
    (time, _), (name, unit) = columns.columns.time, columns.columns.solid
    try:
        read = read_columns(
            path, (time, name), "trip", counts=(name,), stated=(time, name) == ("t", SOLID[0])
        )
    except UserError as error:
        if error.place == name and "no such" in error.remedy and (name, unit) == SOLID:
            return math.nan
        raise
    t = in_si(columns, "time", read[time])
    counted = COUNTED["concentration"][unit] * on_grid(path, name, t, read[name], t[0] + trip.t)
    if counted.min() < 0.0 or np.median(counted) > MOST_COUNT:
        raise UserError(
            str(path), name, f"{counted.min():.3g} to {counted.max():.3g} cannot be 1/cm^3 of air"
        )
    solid = 1e6 * float(air @ counted)
    if solid > 1e6 * float(air @ trip.concentration):
        raise UserError(str(path), name, "more than all particles; are the columns exchanged?")
    return solid


def speed_violations(trip: Recorded, reference: Path) -> tuple[int, float]:
    """Return the stretches, and their seconds, in which the speed is outside the tolerance of its reference.

    The upper line is the greatest reference within `NEAR_S`, plus `NEAR_SPEED`; the lower one likewise.

    Raises:
        UserError: the reference cannot be read, or is not as long as the trip.
    """
    columns = read_columns(reference, ("t", "vehicle_speed"), "reference")
    t, asked = columns["t"] - columns["t"][0], columns["vehicle_speed"]
    length, ran = float(t[-1]), PERIOD * len(trip.t)
    if abs(length - ran) > 0.02 * length + NEAR_S:
        remedy = f"{length:.0f} s, the trip {ran:.0f} s; give the reference of trip {trip.name}"
        raise UserError(str(reference), "t", remedy)
    grid = np.interp(trip.t, t, asked)
    reach = round(NEAR_S / PERIOD)
    near = np.lib.stride_tricks.sliding_window_view(np.pad(grid, reach, "edge"), 2 * reach + 1)
    outside = (trip.speed > near.max(axis=1) + NEAR_SPEED) | (trip.speed < near.min(axis=1) - NEAR_SPEED)
    return len(stretches(outside)), PERIOD * float(np.count_nonzero(outside))
