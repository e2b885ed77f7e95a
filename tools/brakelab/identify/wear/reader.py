"""Blocks of a brake dynamometer: their manifest, regressors (7.16) and wear.

The manifest is a CSV file, a row a block: `block`, `file`, `mass_before`, `mass_after` [g, of the two pads of
one calliper] and, where measured, `thickness_before_1…6`, `thickness_after_1…6` [mm]. A block's file (CSV or
Parquet) has `t` [s], `omega` [rad/s], `calliper_pressure` [bar], `brake_torque` [N m] and `disc_temperature`
[degC]; stops are found by the pressure.
"""

import math
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Array
from brakelab.identify.friction.check import refuse_units
from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.recording import Recording
from brakelab.identify.measurement_files import check_celsius, read_columns, read_manifest
from brakelab.results.wear import regressors_of
from brakelab.stretches import stretches
from ecu.errors import UserError
from ecu.settings.config import Config
from ecu.settings.pad import Pad

COLUMNS: Final = ("t", "omega", "calliper_pressure", "brake_torque", "disc_temperature")
IN_ORDER: Final = ("t", "calliper_pressure", "brake_torque", "omega", "disc_temperature")
"""As `Columns.contract` has them."""
POINTS: Final = 6
FEWEST_APPLICATIONS: Final = 100  # applications of a block; the thesis has 250 and more
PRESSED: Final = 1.0  # bar
SHORTEST_APPLICATION: Final = 0.1  # s of an application
SLOPE_S: Final = 0.2  # s to either side, for the slope of the speed
UNEVEN: Final = 0.3  # mm by which a point may lose more or less than the others, beside what all lose
HIGHEST_TEMPERATURE: Final = 1100.0  # degC
SPECIFIC: Final = (2e-3, 20.0)  # g/MJ: linings 0.05 to 1, some tens of times less or more where cold or hot


class Block(NamedTuple):
    """A block of brake applications between two measurements of the pads."""

    name: str
    applications: int
    regressors: Array
    """Units of `REGRESSORS`, shape (7,)."""
    mass: float
    """Lost by the balance, g."""
    wear: float
    """By thickness, mm; NaN: not measured."""
    temperature: float
    """Mean of the disc while braking, by energy [degC]."""


def read_blocks(manifest: Path, config: Config, axle: str) -> list[Block]:
    """Return the blocks of a manifest, measured on a brake of an `axle` of `config`.

    Raises:
        UserError: a file, a row or a value of it is not right.
    """
    rows = read_manifest(manifest)
    if not rows:
        raise UserError(str(manifest), "", "no blocks; give a row with block, file, mass_before, mass_after")
    return [_block(manifest, line, row, config, axle) for line, row in rows]


def _block(manifest: Path, line: int, row: dict[str, str], config: Config, axle: str) -> Block:
    where = f"line {line}"
    if not row.get("block") or not row.get("file"):
        raise UserError(str(manifest), where, "needs block, file, mass_before and mass_after")
    before, after = (_number(manifest, where, row, name) for name in ("mass_before", "mass_after"))
    if not before > after:
        raise UserError(
            str(manifest), f"{where}, block {row['block']}", f"pads gained mass ({before:g} to {after:g} g)"
        )
    wear = _thickness(manifest, where, row, getattr(config, axle).pad)
    path = manifest.parent / row["file"]
    stops = read_stops(path)
    if stops:
        _check_physics(path, stops, Columns.contract(IN_ORDER, "rad/s", config, axle))
    if len(stops) < FEWEST_APPLICATIONS:
        needed = f"a block needs {FEWEST_APPLICATIONS} or more to wear what can be measured"
        remedy = f"{len(stops)} applications; {needed}"
        raise UserError(str(path), f"block {row['block']}", remedy)
    regressors = np.sum([stop_regressors(stop) for stop in stops], axis=0)
    specific = (before - after) / float(regressors[0])
    if not SPECIFIC[0] < specific < SPECIFIC[1]:
        remedy = (
            f"{before - after:.3g} over {regressors[0]:.3g} MJ make {specific:.2g} g/MJ, which no lining "
            "wears; give masses in g"
        )
        raise UserError(str(manifest), f"{where}, block {row['block']}", remedy)
    mean = regressors[1] / regressors[0]
    return Block(row["block"], len(stops), regressors, before - after, wear, float(mean))


def _number(manifest: Path, where: str, row: dict[str, str], name: str) -> float:
    try:
        value = float(row[name])
    except (KeyError, TypeError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        raise UserError(str(manifest), f"{where}, {name}", f"give a number (found {row.get(name)!r})")
    return value


def _thickness(manifest: Path, where: str, row: dict[str, str], pad: Pad) -> float:
    if not row.get("thickness_before_1"):
        return math.nan
    lost: list[float] = []
    for point in range(1, POINTS + 1):
        names = f"thickness_before_{point}", f"thickness_after_{point}"
        before, after = (_number(manifest, where, row, name) for name in names)
        if not 0.0 < before < pad.thickness_new + 1.0:
            remedy = f"{before:g} mm cannot be of a pad that is {pad.thickness_new:g} mm thick when new"
            raise UserError(str(manifest), f"{where}, {names[0]}", remedy)
        lost.append(before - after)
    off = np.abs(np.array(lost) - np.median(lost))
    if off.max() > UNEVEN + np.abs(np.median(lost)):
        point = int(np.argmax(off)) + 1
        said = " and ".join(
            f"{name} {row[name]}" for name in (f"thickness_before_{point}", f"thickness_after_{point}")
        )
        remedy = f"{off.max():.1f} mm off what the other points lost; correct the reading"
        raise UserError(str(manifest), f"{where}, {said} mm", remedy)
    if np.mean(lost) <= 0.0:
        remedy = f"the pads grew by {-1e3 * float(np.mean(lost)):.0f} µm; measure them cold, same points"
        raise UserError(str(manifest), f"{where}, thickness_after_1…{POINTS}", remedy)
    return float(np.mean(lost))


def read_stops(path: Path) -> list[dict[str, Array]]:
    """Return the applications of a block, each by `COLUMNS` with arrays of shape (n,).

    Raises:
        UserError: the file cannot be read or lacks a column.
    """
    columns = read_columns(path, COLUMNS, "block")
    pressed = columns["calliper_pressure"] > PRESSED
    stops = [
        {name: column[start:end] for name, column in columns.items()} for start, end in stretches(pressed)
    ]
    return [stop for stop in stops if stop["t"][-1] - stop["t"][0] >= SHORTEST_APPLICATION]


def stop_regressors(stop: dict[str, Array]) -> Array:
    """Return the integrals of (7.16) over an application, shape (7,)."""
    period = float(np.median(np.diff(stop["t"])))
    torque, omega = np.abs(stop["brake_torque"]), np.abs(stop["omega"])
    return regressors_of(torque, omega, stop["disc_temperature"], period, max(round(SLOPE_S / period), 1))


def _check_physics(path: Path, stops: list[dict[str, Array]], columns: Columns) -> None:
    """Refuse columns that have gaps or cannot be in the units that they should have."""
    for name in COLUMNS[1:]:
        everything = np.concatenate([stop[name] for stop in stops])
        if not np.isfinite(everything).all():
            raise UserError(str(path), name, "has gaps while the brake is applied; fill them")
    heat = np.concatenate([stop["disc_temperature"] for stop in stops])
    check_celsius(path, "disc_temperature", heat, HIGHEST_TEMPERATURE)
    applications = [
        Recording(
            stop["t"],
            1e5 * stop["calliper_pressure"],
            np.abs(stop["brake_torque"]),
            np.abs(stop["omega"]),
            stop["disc_temperature"],
        )
        for stop in stops
    ]
    refuse_units(applications, columns, str(path))
