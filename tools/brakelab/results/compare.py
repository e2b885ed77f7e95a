"""Comparison of two results (`brake-ecu compare`), largest differences first.

Rows are matched by `t`, brake applications by their number. A difference matters where it would be visible in
a plot: beyond `MATTERS` in the quantity's unit and 1 % of its root mean square; of a mode, a flag or a fault
mask any difference matters.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from brakelab.results.console import new_console
from brakelab.results.files import Result, brakes_path, read_result
from brakelab.results.prediction import errors
from ecu.contract.signals import CORNERS, without_corner
from ecu.errors import UserError
from ecu.output import give

MATTERS: Final = {
    "m/s": 0.05,
    "m/s^2": 0.05,
    "bar": 0.5,
    "N m": 5.0,
    "N": 20.0,
    "degC": 1.0,
    "K": 1.0,
    "s": 0.02,
    "J": 500.0,
    "mm": 1e-4,
    "g": 1e-3,
    "us": np.inf,  # timing of the machine
}
"""Least difference that matters, by unit."""
OF_RMS: Final = 0.01
EXACT: Final = (
    "mode",
    "active_faults",
    "active_faults_2",
    "braking",
    "overruns",
    "pressure_demand_valid",
    "motor_demand_valid",
)
BRAKES: Final = "brake applications"
PROVENANCE: Final = ("version", "vehicle", "observer", "config_hash", "database_hash", "inputs")

Columns = Mapping[str, NDArray[Any]]


class Difference(NamedTuple):
    """Difference of a column between two results."""

    name: str
    rms: float
    greatest: float
    """b - a where it is largest; NaN: only nulls differ."""
    place: int
    """Row of the greatest difference, or of the first null that only one has."""
    nulls: int
    """Rows in which only one has a value."""
    weight: float
    """Greatest difference over the least that matters; above 1 it does."""


def _threshold(name: str, unit: str, values: NDArray[np.float64]) -> float:
    if without_corner(name) in EXACT:
        return 0.5
    rms = float(np.sqrt(np.mean(np.square(values)))) if len(values) else 0.0
    return max(MATTERS.get(unit, 0.0), OF_RMS * rms, 1e-12)


def differences(a: Columns, b: Columns, units: Mapping[str, str]) -> list[Difference]:
    """Return the differences of columns common to both, largest first; equal ones are omitted.

    Columns are float64 of one length; two NaN are equal.
    """
    found = []
    for name in a:
        if name not in b or a[name].dtype == object:
            continue
        before, after = a[name], b[name]
        known = np.isfinite(before) & np.isfinite(after)
        single = np.isfinite(before) != np.isfinite(after)
        change = np.where(known, after - before, 0.0)
        if not change.any() and not single.any():
            continue
        place = int(np.argmax(np.abs(change))) if change.any() else int(np.argmax(single))
        greatest = float(change[place]) if change.any() else np.nan
        weight = abs(greatest) / _threshold(name, units.get(name, ""), before[known]) if change.any() else 0.0
        if single.any():
            weight = max(weight, 1.0 + float(single.mean()))
        rms = float(np.sqrt(np.mean(np.square(change[known])))) if known.any() else np.nan
        found.append(Difference(name, rms, greatest, place, int(single.sum()), weight))
    return sorted(found, key=lambda difference: -difference.weight)


def _row_keys(columns: Columns) -> NDArray[np.int64]:
    return np.round(1e6 * columns["t"]).astype(np.int64)


def _brake_keys(columns: Columns) -> NDArray[np.int64]:
    corners = [CORNERS.index(corner) for corner in columns["corner"]]
    return len(CORNERS) * columns["brake"].astype(np.int64) + np.array(corners, np.int64)


def _taken(columns: Columns, rows: NDArray[np.int64]) -> Columns:
    return {name: column[rows] for name, column in columns.items()}


def _show(
    console: Console, title: str, of: list[Difference], units: Mapping[str, str], at: list[str]
) -> None:
    table = Table(title=title, title_justify="left", highlight=True)
    for column in ("quantity", "unit", "rms", "greatest", "at", "only in one", "times what matters"):
        table.add_column(
            column, justify="left" if column in ("quantity", "unit", "at") else "right", no_wrap=True
        )
    for row, place in zip(of, at, strict=True):
        table.add_row(
            without_corner(row.name),
            units.get(row.name, ""),
            "" if np.isnan(row.rms) else f"{row.rms:.3g}",
            "" if np.isnan(row.greatest) else f"{row.greatest:+.3g}",
            place,
            str(row.nulls or ""),
            f"{row.weight:.1f}" if row.weight < 10 else f"{row.weight:.0f}",
        )
    console.print(table)


def _provenance(a: Result, b: Result) -> list[str]:
    lines = []
    for key in PROVENANCE:
        before, after = a.metadata.get(key, ""), b.metadata.get(key, "")
        if before != after:
            if key == "inputs":
                before, after = (
                    ", ".join(f"{log['name']} ({log['sha256'][:12]})" for log in json.loads(text or "[]"))
                    for text in (before, after)
                )
            lines.append(f"{key}: {before or 'unknown'} -> {after or 'unknown'}")
    return lines


def _judged(brakes: Columns) -> tuple[str, str]:
    """Return how far the predictions of a result were off, and its friction at the end."""
    counts = (brakes["corner"] == CORNERS[0]) & (brakes["left_out"] == "")
    off = "no brake application to judge it by"
    if counts.any():
        measured, predicted = (brakes[f"specific_force_{name}"][counts] for name in ("mean", "predicted"))
        found = errors(measured.tolist(), predicted.tolist())
        off = f"{100.0 * found.mean:.1f} % on the mean, bias {100.0 * found.bias:+.1f} %"
    last = [brakes["mu_b_end"][brakes["corner"] == corner][-1] for corner in CORNERS]
    return off, f"{0.5 * (last[0] + last[1]):.3f} front, {0.5 * (last[2] + last[3]):.3f} rear"


def _verdicts(a: Columns, b: Columns) -> list[str]:
    """Return what a user compares first: errors of prediction and friction of both."""
    if not all(len(one["corner"]) and "left_out" in one for one in (a, b)):  # an earlier version's
        return []
    names = ("prediction off by", "friction at the end")
    pairs = zip(names, _judged(a), _judged(b), strict=True)
    return [f"{name}: {before} -> {after}" for name, before, after in pairs]


def compare(a: Path, b: Path) -> int:
    """Print the differences of result `b` from `a`; return 1 if one matters, else 0.

    Raises:
        UserError: a file cannot be read, is no result, or the two have no row in common.
    """
    console = new_console()
    matters, listed = 0, []
    first, second = read_result(a), read_result(b)
    for path, result in ((a, first), (b, second)):
        if "t" not in result.columns or "mu_b_fl" not in result.columns:
            raise UserError(str(path), "columns", "no result; give what `brake-ecu replay` wrote")
    for line in _provenance(first, second):
        console.print(line, highlight=False)
    pairs = [("rows", first, second, _row_keys)]
    if brakes_path(a).exists() and brakes_path(b).exists():
        brakes = read_result(brakes_path(a)), read_result(brakes_path(b))
        pairs += [(BRAKES, *brakes, _brake_keys)]
        for line in (verdicts := _verdicts(*(one.columns for one in brakes))):
            console.print(line, highlight=False)
        give(verdicts=verdicts)
    for title, one, other, keys in pairs:
        own, others = keys(one.columns), keys(other.columns)
        both, rows_a, rows_b = np.intersect1d(own, others, return_indices=True)
        only_a, only_b = len(own) - len(both), len(others) - len(both)
        if not len(both) and title != BRAKES:
            raise UserError(str(b), "t", f"has no row in common with {a}; compare results of one drive")
        if only_a or only_b:
            console.print(f"{title}: {only_a} only in {a}, {only_b} only in {b}", highlight=False)
            matters += 1
        before, after = _taken(one.columns, rows_a), _taken(other.columns, rows_b)
        units = one.units
        found = differences(before, after, units)
        heavy = [row for row in found if row.weight > 1.0]
        matters += len(heavy)
        light = len(found) - len(heavy)
        equal = len(set(before) & set(after)) - len(found)
        by_quantity: dict[str, Difference] = {}
        for row in heavy:
            by_quantity.setdefault(without_corner(row.name), row)
        worst = list(by_quantity.values())
        listed += [
            row._asdict() | {"of": title, "unit": units.get(row.name, ""), "at": _place(title, before, row)}
            for row in found
        ]
        if worst:
            places = [_place(title, before, row) for row in worst]
            _show(console, f"{title} that differ, by their worst corner", worst, units, places)
        console.print(
            f"{title}: {len(heavy)} columns differ, {light} by less than matters, {equal} are equal",
            highlight=False,
        )
    give(matter=matters, provenance=_provenance(first, second), differences=listed)
    return 1 if matters else 0


def _place(title: str, columns: Columns, difference: Difference) -> str:
    row = difference.place
    if title == BRAKES:
        return f"braking {columns['brake'][row] + 1:.0f} {columns['corner'][row]}"
    corner = difference.name[len(without_corner(difference.name)) + 1 :]
    return f"{columns['t'][row]:.2f} s {corner}".rstrip()
