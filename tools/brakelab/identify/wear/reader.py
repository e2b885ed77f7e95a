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
from brakelab.identify.measurement_files import check_celsius, read_columns, read_manifest
from brakelab.results.wear import regressors_of
from brakelab.stretches import stretches
from ecu.errors import UserError
from ecu.settings.pad import Pad

COLUMNS: Final = ("t", "omega", "calliper_pressure", "brake_torque", "disc_temperature")
POINTS: Final = 6
FEWEST: Final = 100  # applications of a block; the thesis has 250 and more
PRESSED: Final = 1.0  # bar
SHORTEST: Final = 0.1  # s of an application
SLOPE_S: Final = 0.2  # s to either side, for the slope of the speed
FAHRENHEIT: Final = 1.8
HOTTEST: Final = 1100.0  # degC


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


class Heat(NamedTuple):
    """Configured heating and cooling of the disc (3.7)."""

    heating: float
    cooling: float


def read_blocks(manifest: Path, pad: Pad, heat: Heat) -> list[Block]:
    """Return the blocks of a manifest.

    Raises:
        UserError: a file, a row or a value of it is not right.
    """
    rows = read_manifest(manifest)
    if not rows:
        raise UserError(str(manifest), "", "no blocks; give a row with block, file, mass_before, mass_after")
    return [_block(manifest, number, row, pad, heat) for number, row in enumerate(rows, 2)]


def _block(manifest: Path, line: int, row: dict[str, str], pad: Pad, heat: Heat) -> Block:
    where = f"line {line}"
    if not row.get("block") or not row.get("file"):
        raise UserError(str(manifest), where, "needs block, file, mass_before and mass_after")
    before, after = (_number(manifest, where, row, name) for name in ("mass_before", "mass_after"))
    if not before > after:
        raise UserError(
            str(manifest), f"{where}, block {row['block']}", f"pads gained mass ({before:g} to {after:g} g)"
        )
    wear = _thickness(manifest, where, row, pad)
    stops = read_stops(manifest.parent / row["file"])
    if len(stops) < FEWEST:
        remedy = f"{len(stops)} applications; a block needs {FEWEST} or more to wear what can be measured"
        raise UserError(str(manifest.parent / row["file"]), f"block {row['block']}", remedy)
    _check_temperature(manifest.parent / row["file"], stops, heat)
    regressors = np.sum([stop_regressors(stop) for stop in stops], axis=0)
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
    lost = []
    for point in range(1, POINTS + 1):
        names = f"thickness_before_{point}", f"thickness_after_{point}"
        before, after = (_number(manifest, where, row, name) for name in names)
        if not 0.0 < before < pad.thickness_new + 1.0:
            remedy = f"{before:g} mm cannot be of a pad that is {pad.thickness_new:g} mm thick when new"
            raise UserError(str(manifest), f"{where}, {names[0]}", remedy)
        lost.append(before - after)
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
    return [stop for stop in stops if stop["t"][-1] - stop["t"][0] >= SHORTEST]


def stop_regressors(stop: dict[str, Array]) -> Array:
    """Return the integrals of (7.16) over an application, shape (7,)."""
    period = float(np.median(np.diff(stop["t"])))
    torque, omega = np.abs(stop["brake_torque"]), np.abs(stop["omega"])
    return regressors_of(torque, omega, stop["disc_temperature"], period, max(round(SLOPE_S / period), 1))


def _check_temperature(path: Path, stops: list[dict[str, Array]], heat: Heat) -> None:
    """Refuse temperatures that cannot be degC: by their range, and by the heating per work."""
    everything = np.concatenate([stop["disc_temperature"] for stop in stops])
    if not np.isfinite(everything).all():
        raise UserError(str(path), "disc_temperature", "has gaps while the brake is applied; fill them")
    check_celsius(path, "disc_temperature", everything, HOTTEST)
    ratios = []
    for stop in stops:
        seconds = stop["t"][-1] - stop["t"][0]
        work = float(np.trapezoid(np.abs(stop["brake_torque"] * stop["omega"]), stop["t"]))
        if heat.heating * work > 5.0:  # K
            loss = 1.0 - 0.5 * heat.cooling * seconds
            rise = stop["disc_temperature"][-1] - stop["disc_temperature"][0]
            ratios.append(rise / (heat.heating * work * max(loss, 0.3)))
    middle = float(np.median(ratios)) if ratios else 1.0
    if 0.8 * FAHRENHEIT < middle < 1.3 * FAHRENHEIT:
        remedy = (
            f"rises {middle:.1f} times what the work warms the disc: °F? convert it to degC "
            "(or correct disc_heating in CONFIG)"
        )
        raise UserError(str(path), "disc_temperature", remedy)
