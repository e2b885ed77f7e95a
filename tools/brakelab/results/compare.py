"""Comparison of two results (`brake-ecu compare`), largest differences first.

Rows are matched by `t`, brake applications by their number. A difference matters where it would be visible in
a plot: beyond `MATTERS` in the quantity's unit and 1 % of its root mean square; of a mode, a flag or a fault
mask any difference matters.
"""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from brakelab.results.columns import Columns
from brakelab.results.console import new_console
from brakelab.results.files import Result, brakes_path, read_result
from brakelab.results.prediction import Errors, errors
from ecu.contract.faults import WORDS, fault_mask, fault_names
from ecu.contract.signals import CORNERS, STARTING, without_corner
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

Named = Mapping[str, NDArray[Any]]


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


class Part(NamedTuple):
    """Rows, or brake applications, that two results have in common."""

    title: str
    before: Named
    after: Named
    units: Mapping[str, str]
    only: tuple[int, int]
    """How many only the one and only the other has."""
    differences: list[Difference]

    @property
    def matter(self) -> int:
        """Number of columns whose difference matters."""
        return sum(row.weight > 1.0 for row in self.differences)

    def worst(self) -> list[Difference]:
        """Return what matters, of each quantity the corner that differs most."""
        by_quantity: dict[str, Difference] = {}
        for row in self.differences:
            if row.weight > 1.0:
                by_quantity.setdefault(without_corner(row.name), row)
        return list(by_quantity.values())

    def place(self, difference: Difference) -> str:
        """Return where the greatest difference is: time or application, and corner."""
        row = difference.place
        if self.title == BRAKES:
            return f"braking {self.before['brake'][row] + 1:.0f} {self.before['corner'][row]}"
        corner = difference.name[len(without_corner(difference.name)) + 1 :]
        return f"{self.before['t'][row]:.2f} s {corner}".rstrip()


class Judged(NamedTuple):
    """What a user compares first."""

    prediction: Errors
    front: float
    """Friction after the last brake application [-]."""
    rear: float

    def text(self) -> tuple[str, str]:
        """Return how far the predictions were off, and the friction at the end."""
        off = "no brake application to judge it by"
        if self.prediction.counted:
            mean, bias = 100.0 * self.prediction.mean, 100.0 * self.prediction.bias
            off = f"{mean:.1f} % on the mean, bias {bias:+.1f} %"
        return off, f"{self.front:.3f} front, {self.rear:.3f} rear"


class Comparison(NamedTuple):
    """Two results side by side."""

    provenance: list[str]
    """Version, configuration and logs, where they differ."""
    judged: tuple[Judged, Judged] | None
    """None without brake applications."""
    parts: list[Part]

    faults: tuple[list[str], list[str]]
    """Seen by only the one, and by only the other."""

    @property
    def verdicts(self) -> list[str]:
        """Error of prediction and friction at the end of both, and faults that only one has seen."""
        lines = []
        if self.judged is not None:
            names = ("prediction off by", "friction at the end")
            pairs = zip(names, *(one.text() for one in self.judged), strict=True)
            lines = [f"{name}: {before} -> {after}" for name, before, after in pairs]
        if any(self.faults):
            before, after = (", ".join(names) or "none" for names in self.faults)
            lines.append(f"faults that only one has: {before} -> {after}")
        return lines

    @property
    def matter(self) -> int:
        """Number of differences that matter."""
        return sum(part.matter + bool(any(part.only)) for part in self.parts)


def _threshold(name: str, unit: str, values: NDArray[np.float64]) -> float:
    if without_corner(name) in EXACT:
        return 0.5
    rms = float(np.sqrt(np.mean(np.square(values)))) if len(values) else 0.0
    return max(MATTERS.get(unit, 0.0), OF_RMS * rms, 1e-12)


def differences(a: Named, b: Named, units: Mapping[str, str]) -> list[Difference]:
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


def _row_keys(columns: Named) -> NDArray[np.int64]:
    return np.round(1e6 * columns["t"]).astype(np.int64)


def _brake_keys(columns: Named) -> NDArray[np.int64]:
    corners = [CORNERS.index(corner) for corner in columns["corner"]]
    return len(CORNERS) * columns["brake"].astype(np.int64) + np.array(corners, np.int64)


def _taken(columns: Named, rows: NDArray[np.int64]) -> Named:
    return Columns(columns, lambda name: columns[name][rows])


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


def _judged(brakes: Named) -> Judged:
    counts = (brakes["corner"] == CORNERS[0]) & (brakes["left_out"] == "")
    measured, predicted = (brakes[f"specific_force_{name}"][counts] for name in ("mean", "predicted"))
    last = [float(brakes["mu_b_end"][brakes["corner"] == corner][-1]) for corner in CORNERS]
    found = errors(measured.tolist(), predicted.tolist())
    return Judged(found, 0.5 * (last[0] + last[1]), 0.5 * (last[2] + last[3]))


def find(a: Path, b: Path) -> Comparison:
    """Return the differences of result `b` from `a`.

    Raises:
        UserError: a file cannot be read, is no result, or the two have no row in common.
    """
    first, second = read_result(a), read_result(b)
    for path, result in ((a, first), (b, second)):
        if "t" not in result.columns or "mu_b_fl" not in result.columns:
            raise UserError(str(path), "columns", "no result; give what `brake-ecu replay` wrote")
    rows = _part("rows", first, second, _row_keys)
    if not len(rows.before["t"]):
        raise UserError(str(b), "t", f"has no row in common with {a}; compare results of one drive")
    parts, judged = [rows], None
    if brakes_path(a).exists() and brakes_path(b).exists():
        brakes = read_result(brakes_path(a)), read_result(brakes_path(b))
        parts.append(_part(BRAKES, *brakes, _brake_keys))
        a_brakes, b_brakes = (one.columns for one in brakes)
        if all(
            len(one["corner"]) and "left_out" in one for one in (a_brakes, b_brakes)
        ):  # no earlier version's
            judged = _judged(a_brakes), _judged(b_brakes)
    return Comparison(_provenance(first, second), judged, parts, _faults(rows))


def _faults(rows: Part) -> tuple[list[str], list[str]]:
    a, b = (_seen(columns) for columns in (rows.before, rows.after))
    return fault_names(a & ~b), fault_names(b & ~a)


def _seen(columns: Named) -> int:
    """Return the mask of every fault since the ECU has started."""
    unknown = np.full(len(columns["t"]), np.nan)
    words = {word: columns.get(word, unknown) for word in WORDS}
    starting = columns.get("mode", unknown) == STARTING
    return int(np.bitwise_or.reduce(np.where(starting, 0, fault_mask(words))))


def _part(title: str, one: Result, other: Result, keys: Callable[[Named], NDArray[np.int64]]) -> Part:
    own, others = keys(one.columns), keys(other.columns)
    both, rows_a, rows_b = np.intersect1d(own, others, return_indices=True)
    before, after = _taken(one.columns, rows_a), _taken(other.columns, rows_b)
    only = len(own) - len(both), len(others) - len(both)
    return Part(title, before, after, one.units, only, differences(before, after, one.units))


def show(found: Comparison, a: Path, b: Path) -> None:
    """Print the differences of result `b` from `a`, and give them to `--json`."""
    console = new_console()
    for line in found.provenance + found.verdicts:
        console.print(line, highlight=False)
    if found.verdicts:
        give(verdicts=found.verdicts)
    listed = []
    for part in found.parts:
        if any(part.only):
            line = f"{part.title}: {part.only[0]} only in {a}, {part.only[1]} only in {b}"
            console.print(line, highlight=False)
        if part.matter:
            console.print(_table(part))
        light = len(part.differences) - part.matter
        equal = len(set(part.before) & set(part.after)) - len(part.differences)
        line = f"{part.title}: {part.matter} columns differ, {light} by less than matters, {equal} are equal"
        console.print(line, highlight=False)
        listed += [
            row._asdict() | {"of": part.title, "unit": part.units.get(row.name, ""), "at": part.place(row)}
            for row in part.differences
        ]
    give(matter=found.matter, provenance=found.provenance, differences=listed)


def _table(part: Part) -> Table:
    title = f"{part.title} that differ, by their worst corner"
    table = Table(title=title, title_justify="left", highlight=True)
    for column in ("quantity", "unit", "rms", "greatest", "at", "only\nin one", "times what\nmatters"):
        table.add_column(
            column, justify="left" if column in ("quantity", "unit", "at") else "right", no_wrap=True
        )
    for row in part.worst():
        table.add_row(*cells(part, row))
    return table


def cells(part: Part, row: Difference) -> tuple[str, ...]:
    """Return a difference as text: quantity, unit, rms, greatest, place, nulls, weight."""
    return (
        without_corner(row.name),
        part.units.get(row.name, ""),
        "" if np.isnan(row.rms) or row.name in WORDS else f"{row.rms:.3g}",
        "" if np.isnan(row.greatest) or row.name in WORDS else f"{row.greatest:+.3g}",
        part.place(row),
        str(row.nulls or ""),
        f"{row.weight:.1f}" if row.weight < 10 else f"{row.weight:.0f}",
    )
