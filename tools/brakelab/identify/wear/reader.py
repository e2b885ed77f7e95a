"""Blocks of a brake dynamometer: their manifest, regressors (7.16) and wear.

The manifest is a CSV file, a row a block: `block`, `file`, and what was weighed and measured before and after
(`weighings`). A block's file (CSV or Parquet) has `t` [s], `omega` [rad/s], `calliper_pressure` [bar],
`brake_torque` [N m] and `disc_temperature` [degC], or any other names and units that a file of columns beside
it or `--columns` states, as of `lab run`; stops are found by the pressure. `programme` names what the rig was
asked to do.
"""

import math
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Array
from brakelab.identify.friction.check import Numbers, refuse_units, say_unlike
from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.reader import positive, read_recording
from brakelab.identify.friction.recording import Recording
from brakelab.identify.friction.sensors import without_zero
from brakelab.identify.friction.sequence import read_sequence
from brakelab.identify.manifest import measured_rows, read_manifest, refuse_row
from brakelab.identify.measurement_files import check_celsius, read_columns
from brakelab.identify.samples import LONGEST_GAP, bridged
from brakelab.identify.wear.reproduced import Reproduced, reproduced
from brakelab.identify.wear.weighings import Lost, read_lost
from brakelab.results.wear import regressors_of
from brakelab.stretches import stretches
from ecu.errors import UserError
from ecu.output import say
from ecu.settings.config import Config

COLUMNS: Final = ("t", "omega", "calliper_pressure", "brake_torque", "disc_temperature")
IN_ORDER: Final = ("t", "calliper_pressure", "brake_torque", "omega", "disc_temperature")
"""As `Columns.contract` has them."""
FEWEST_APPLICATIONS: Final = 100  # applications of a block; the thesis has 250 and more
PRESSED: Final = 1.0  # bar
SHORTEST_APPLICATION: Final = 0.1  # s of an application
SLOPE_S: Final = 0.2  # s to either side, for the slope of the speed
HIGHEST_TEMPERATURE: Final = 1100.0  # degC
SPECIFIC: Final = (2e-3, 20.0)  # g/MJ: linings 0.05 to 1, some tens of times less or more where cold or hot


class Block(NamedTuple):
    """A block of brake applications between two measurements of the pads."""

    name: str
    applications: int
    regressors: Array
    """Units of `REGRESSORS`, shape (7,)."""
    lost: Lost
    temperature: float
    """Mean of the disc while braking, by energy [degC]."""
    reproduced: Reproduced | None
    """Beside the programme that the manifest names."""


def read_blocks(manifest: Path, config: Config, axle: str, columns: Path | None = None) -> list[Block]:
    """Return the blocks of a manifest, measured on a brake of an `axle` of `config`.

    `columns`: file of columns of all blocks; without, the one beside each, or the contract's names and units.

    Raises:
        UserError: a file, a row or a value of it is not right.
    """
    rows = measured_rows(read_manifest(manifest, columns))
    if not rows:
        raise UserError(str(manifest), "", "no blocks; give a row with block, file, mass_before, mass_after")
    read = [_block(manifest, line, row, config, axle, columns) for line, row in rows]
    blocks = [block for block, _ in read]
    say_unlike([block.name for block in blocks], [numbers for _, numbers in read], str(manifest), "block")
    return blocks


def _block(
    manifest: Path, line: int, row: dict[str, str], config: Config, axle: str, given: Path | None
) -> tuple[Block, Numbers]:
    where = f"line {line}"
    if not row.get("block") or not row.get("file"):
        raise refuse_row(manifest, line, row, "block, file, mass_before and mass_after")
    lost = read_lost(manifest, line, row, getattr(config, axle).pad)
    path = manifest.parent / row["file"]
    stops, columns, whole = read_stops(path, Columns.contract(IN_ORDER, "rad/s", config, axle), given)
    numbers = _check_physics(path, stops, columns, whole) if stops else None
    if numbers is None or len(stops) < FEWEST_APPLICATIONS:
        needed = f"a block needs {FEWEST_APPLICATIONS} or more to wear what can be measured"
        remedy = f"{len(stops)} applications; {needed}"
        raise UserError(str(path), f"block {row['block']}", remedy)
    regressors = np.sum([stop_regressors(stop) for stop in stops], axis=0)
    specific = lost.mass / float(regressors[0])
    if not SPECIFIC[0] < specific < SPECIFIC[1]:
        remedy = (
            f"{lost.mass:.3g} over {regressors[0]:.3g} MJ make {specific:.2g} g/MJ, which no lining "
            "wears; give masses in g"
        )
        raise UserError(str(manifest), f"{where}, block {row['block']}", remedy)
    mean = regressors[1] / regressors[0]
    beside = _beside(manifest, where, row, stops, columns.brake.tyre_radius) if row.get("programme") else None
    return Block(row["block"], len(stops), regressors, lost, float(mean), beside), numbers


def _beside(
    manifest: Path, where: str, row: dict[str, str], stops: list[dict[str, Array]], radius: float
) -> Reproduced:
    """Return the stops of a block beside its programme."""
    path = manifest.parent / row["programme"]
    if not path.is_file():
        raise UserError(str(manifest), f"{where}, programme", f"{row['programme']}: no such file beside it")
    programme = read_sequence(path)
    if held := [section.name for section in programme.section if section.control != "deceleration"]:
        remedy = (
            f"{row['programme']}, section {held[0]} asks for a pressure, which says no speed; leave it empty"
        )
        raise UserError(str(manifest), f"{where}, programme", remedy)
    road = math.nan
    if row.get("road_energy"):
        try:
            road = float(row["road_energy"])
        except ValueError:
            remedy = f"give a number of MJ (found {row['road_energy']!r}), or nothing"
            raise UserError(str(manifest), f"{where}, road_energy", remedy) from None
    return reproduced(row["block"], programme, stops, radius, road)


def read_stops(
    path: Path, contract: Columns, given: Path | None = None
) -> tuple[list[dict[str, Array]], Columns, dict[str, Array]]:
    """Return the applications of a block, each by `COLUMNS` with arrays of shape (n,), its description, all.

    The description is `contract`, or the file of columns `given` or beside `path`, where there is one.

    Raises:
        UserError: the file cannot be read or lacks a column.
    """
    described, push_out = contract, 0.0
    if given is not None or path.with_suffix(".toml").is_file():
        read = read_recording(path, given, contract)
        if read.damaged:
            say(read.damaged)
        described, push_out = read.columns, read.columns.rig.push_out_pressure
        time, pressure, torque, speed, heat = read.recording
        columns = dict(zip(COLUMNS, (time, speed, 1e-5 * pressure, torque, heat), strict=True))
    else:
        columns = read_columns(path, COLUMNS, "block")
        t = columns["t"]
        columns = {name: bridged(t, values, LONGEST_GAP) for name, values in columns.items()}
        signed = _recording(columns)._replace(torque=positive(columns["brake_torque"]))
        columns["brake_torque"] = without_zero(signed, described, str(path)).torque
    pressed = columns["calliper_pressure"] > push_out + PRESSED
    stops = [
        {name: column[start:end] for name, column in columns.items()} for start, end in stretches(pressed)
    ]
    stops = [stop for stop in stops if stop["t"][-1] - stop["t"][0] >= SHORTEST_APPLICATION]
    return stops, described, columns


def stop_regressors(stop: dict[str, Array]) -> Array:
    """Return the integrals of (7.16) over an application, shape (7,)."""
    period = float(np.median(np.diff(stop["t"])))
    torque, omega = np.abs(stop["brake_torque"]), np.abs(stop["omega"])
    return regressors_of(torque, omega, stop["disc_temperature"], period, max(round(SLOPE_S / period), 1))


def _check_physics(
    path: Path, stops: list[dict[str, Array]], columns: Columns, whole: dict[str, Array]
) -> Numbers:
    """Return the numbers of stops; refuse columns that have gaps or cannot be in their units."""
    for name in COLUMNS[1:]:
        everything = np.concatenate([stop[name] for stop in stops])
        if not np.isfinite(everything).all():
            raise UserError(str(path), name, "has gaps while the brake is applied; fill them")
    heat = np.concatenate([stop["disc_temperature"] for stop in stops])
    check_celsius(path, "disc_temperature", heat, HIGHEST_TEMPERATURE)
    return refuse_units([_recording(stop) for stop in stops], columns, str(path), _recording(whole))


def _recording(stop: dict[str, Array]) -> Recording:
    return Recording(
        stop["t"],
        1e5 * stop["calliper_pressure"],
        np.abs(stop["brake_torque"]),
        np.abs(stop["omega"]),
        stop["disc_temperature"],
    )
