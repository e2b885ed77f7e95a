"""Reads the recording of a dynamometer, ours or a stranger's: CSV, Parquet or MDF4, by a file of columns.

Rows whose numbers cannot be read, or whose time does not rise, are left out and counted. Torque and speed are
turned to be positive; torque of one pad is doubled where the file of columns says so.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector
from brakelab.identify.friction.columns import ENDS, Columns, load_columns
from brakelab.identify.friction.recording import NAMES, Recording
from brakelab.identify.friction.sensors import without_zero
from brakelab.identify.measurement_files import header_of, numbers_in
from brakelab.identify.samples import LONGEST_GAP, alone, bridged, continued
from brakelab.identify.units import UNITS, ZEROS
from brakelab.logs.csv_rows import csv_rows
from brakelab.logs.log_quality import Damage
from ecu.errors import UserError
from ecu.settings.resources import regular

Places = NDArray[np.int64]
Labels = NDArray[np.str_]

LEAST_SAMPLES: Final = 100
LEAST_STOPS: Final = 5  # of summaries
STEP_S: Final = 0.01  # of the samples that stand for a summary
PAUSE_S: Final = 60.0  # between two of them
SLOWER: Final = 0.3  # share of a column's cells that are empty because it is sampled less often than others
PLACES = {".csv": ("line", 2), ".txt": ("line", 2), ".parquet": ("row", 1), ".mf4": ("sample", 1)}
"""Name of a row for each file ending, and the number of the first."""


class Read(NamedTuple):
    """Recording with its description."""

    recording: Recording
    columns: Columns
    sections: Labels
    """What the column of sections has, shape (samples,); without one, empty texts."""
    damaged: str
    """Rows that were left out, one line; empty if none."""


def read_recording(path: Path, columns: Path | None = None, known: Columns | None = None) -> Read:
    """Return the recording `path`; `columns` defaults to the file of the same name that ends in .toml.

    `known`: brake, rig and disc, where the file of columns has none.

    Raises:
        UserError: a file, a column or a unit is missing or wrong, or too few rows are whole; one line.
    """
    regular(path, "a recording as CSV, Parquet or MDF4")
    if path.suffix.lower() not in PLACES:
        raise UserError(str(path), "", f"ends in none of {' '.join(PLACES)}; export it as CSV")
    beside = columns or path.with_suffix(".toml")
    if not beside.is_file():
        if columns is not None:
            raise UserError(str(columns), "", "no such file")
        remedy = "no file of columns; give --columns (docs/results/friction-lab.md has one)"
        raise UserError(str(path), "", remedy)
    described = load_columns(beside, known)
    ends = [name for name in ENDS if getattr(described.columns, name)]
    names = [getattr(described.columns, quantity)[0] for quantity in (*NAMES, *ends)]
    damage = Damage()
    word, first = PLACES[path.suffix.lower()]
    parts = list(_rows(path, names, described.columns.section, damage, first))
    lines, raw, labels = _joined(parts, len(names))
    strange = np.array([alone(values) if not ends else np.zeros(len(values), bool) for values in raw[1:]])
    lone = strange.any(axis=0)
    if lone.any():
        row = int(np.argmax(lone))
        which = 1 + int(np.argmax(strange[:, row]))
        said = f"{word} {lines[row]} ({names[which]} {raw[which, row]:g} stands alone)"
        damage.note_damage(int(lone.sum()), said)
        lines, raw, labels = lines[~lone], raw[:, ~lone], labels[~lone]
    if not ends:
        raw = _filled(raw, described)
    whole = np.isfinite(raw)
    missing = ~whole.all(axis=0)
    if missing.any():
        row = int(np.argmax(missing))
        name = names[int(np.argmin(whole[:, row]))]
        damage.note_damage(int(missing.sum()), f"{word} {lines[row]} ({name} is no number)")
    lines, raw, labels = lines[~missing], raw[:, ~missing], labels[~missing]
    if ends:
        raw, labels = _as_samples(path, raw, ends, labels, described)
    raw[0] = continued(raw[0])
    back = np.concatenate([[False], raw[0, 1:] <= np.maximum.accumulate(raw[0])[:-1]])[: raw.shape[1]]
    if back.any():
        damage.note_damage(int(back.sum()), f"{word} {lines[int(np.argmax(back))]} (time does not rise)")
    raw, labels = raw[:, ~back], labels[~back]
    if raw.shape[1] < LEAST_SAMPLES:
        because = f"; first left out: {damage.first_damaged}" if damage.damaged else ""
        raise UserError(str(path), "", f"only {raw.shape[1]} whole rows; needs {LEAST_SAMPLES}{because}")
    rows = "row" if damage.damaged == 1 else "rows"
    note = (
        f"{path}: {damage.damaged} {rows} left out, first: {damage.first_damaged}" if damage.damaged else ""
    )
    cut = f"{path}: {damage.cut}" if damage.cut else ""
    recording = _in_si(raw, described)
    if not ends:
        recording = without_zero(recording, described, str(path))
    return Read(recording, described, labels, "; ".join(part for part in (note, cut) if part))


def _filled(raw: Vector, described: Columns) -> Vector:
    """Return samples, shape (5, n), those of columns that are slower than the others interpolated."""
    slow = np.isnan(raw).mean(axis=1) > SLOWER
    if not slow.any() or not np.isfinite(raw[0]).all():
        return raw
    t = UNITS["time"][described.columns.time[1]] * continued(raw[0])
    columns = zip(raw, slow, strict=True)
    return np.array([bridged(t, values, LONGEST_GAP) if late else values for values, late in columns])


def _as_samples(
    path: Path, rows: Vector, ends: list[str], labels: Labels, described: Columns
) -> tuple[Vector, Labels]:
    """Return samples, shape (5, n), that stand for summaries, shape (5 + ends, stops), and their sections.

    A stop slows evenly at its mean pressure and torque; its disc warms evenly.
    """
    if path.suffix.lower() == ".mf4":
        raise UserError(str(path), "speed_end", "a summary of stops is a table: export it as CSV or Parquet")
    if rows.shape[1] < LEAST_STOPS:
        raise UserError(str(path), "", f"summaries of {rows.shape[1]} stops; needs {LEAST_STOPS}")
    bad = np.flatnonzero((rows[:2] <= 0.0).any(axis=0))
    if len(bad):
        names = described.columns.time[0], described.columns.pressure[0]
        remedy = f"{' and '.join(names)} must be above zero in a summary"
        raise UserError(str(path), f"stop {bad[0] + 1}", remedy)
    unit = UNITS["time"][described.columns.time[1]]
    samples: list[Vector] = []
    begin = 0.0
    for row in rows.T:
        lasts, *means = row[:3]
        t = np.arange(0.0, lasts + 1e-9, STEP_S / unit)
        end = dict(zip(ends, row[5:], strict=True))
        slope = np.array([end["speed_end"] - row[3], end.get("temperature_end", row[4]) - row[4]]) / lasts
        held = np.repeat(np.array(means)[:, None], len(t), 1)
        samples.append(np.vstack([begin + t, held, row[3:5, None] + slope[:, None] * t]))
        begin += lasts + PAUSE_S / unit
    return np.concatenate(samples, axis=1), np.repeat(labels, [part.shape[1] for part in samples])


def _joined(blocks: list[tuple[Places, Vector, Labels]], columns: int) -> tuple[Places, Vector, Labels]:
    lines, rows, labels = zip(*blocks, strict=True) if blocks else ((), (), ())
    return (
        np.concatenate([np.empty(0, np.int64), *lines]),
        np.concatenate([np.empty((columns, 0)), *rows], axis=1),
        np.concatenate([np.empty(0, np.str_), *labels]),
    )


def _rows(
    path: Path, names: list[str], section: str | None, damage: Damage, first: int
) -> Iterator[tuple[Places, Vector, Labels]]:
    """Yield where rows stand in the file, columns as numbers in its units, shape (5, rows), sections."""
    if path.suffix.lower() == ".mf4":
        channels, labels = _mdf(path, names, section)
        yield first + np.arange(channels.shape[1]), channels, labels
        return
    read = list(dict.fromkeys([*names, *([section] if section else [])]))
    if path.suffix.lower() == ".parquet":
        import pyarrow.parquet as pq

        _refuse_missing(path, read, pq.read_schema(path).names)
        table = pq.read_table(path, columns=read)
        columns = np.array([_column(path, name, table[name]) for name in names])
        labels = _labels(table[section].to_pylist() if section else [""] * columns.shape[1])
        yield first + np.arange(columns.shape[1]), columns, labels
        return
    found, delimiter, above, _ = header_of(path, names)
    _refuse_missing(path, read, found)
    for lines, batch in csv_rows(path, found, delimiter, read, damage, above):
        cells = {name: numbers_in(batch.column(name)) for name in dict.fromkeys(names)}
        labels = _labels(batch.column(section).to_pylist() if section else [""] * len(lines))
        yield lines, np.array([cells[name] for name in names]), labels


def _labels(cells: Sequence[object]) -> Labels:
    """Return cells of a column of sections as text."""
    return np.array(["" if cell is None else str(cell) for cell in cells], np.str_)


def _refuse_missing(path: Path, names: list[str], found: list[str]) -> None:
    for name in names:
        if name not in found:
            raise UserError(str(path), name, f"no such column; the file has {', '.join(found[:20])}")


def _column(path: Path, name: str, column: Any) -> Vector:
    try:
        return np.asarray(column.to_numpy().astype(float))
    except (TypeError, ValueError):
        raise UserError(str(path), name, f"is {column.type}, not numbers; write it as float") from None


def _mdf(path: Path, names: list[str], section: str | None) -> tuple[Vector, Labels]:
    """Return channels of an MDF4 file on the time of the pressure, shape (5, rows), and its sections."""
    try:
        from asammdf import MDF
    except ImportError:
        raise UserError(str(path), "", "MDF4 needs asammdf: pip install asammdf") from None
    with MDF(path) as file:
        _refuse_missing(path, [*names[1:], *([section] if section else [])], list(file.channels_db))
        pressure = file.get(names[1])
        time = np.asarray(pressure.timestamps, dtype=float)
        others = [file.get(name) for name in names[2:]]
        values = [np.interp(time, other.timestamps, np.asarray(other.samples, float)) for other in others]
        labels = _labels([""] * len(time))
        if section:
            steps = file.get(section)
            held = np.maximum(np.searchsorted(steps.timestamps, time, side="right") - 1, 0)
            labels = _labels([_text(steps.samples[place]) for place in held])
        return np.array([time, np.asarray(pressure.samples, float), *values]), labels


def _text(sample: object) -> str:
    return sample.decode("utf-8", "replace") if isinstance(sample, bytes) else str(sample)


def _in_si(raw: Vector, described: Columns) -> Recording:
    """Return the numbers of a file in the units of a recording."""
    si = {quantity: in_si(described, quantity, values) for quantity, values in zip(NAMES, raw, strict=True)}
    si["torque"] = positive(si["torque"]) * (2.0 / described.rig.pads)
    si["speed"] = positive(si["speed"])
    return Recording(**si)


def in_si(described: Columns, quantity: str, values: Vector) -> Vector:
    """Return a quantity of `UNITS` from the unit that the file of columns states; speed is the disc's."""
    unit = getattr(described.columns, quantity)[1]
    factor = UNITS[quantity][unit]
    if factor < 0.0:
        factor = -factor / described.brake.tyre_radius
    return np.asarray((values - ZEROS.get(unit, 0.0)) * factor)


def positive(values: Vector) -> Vector:
    """Return `values` with the sign that makes their sum positive: noise about zero keeps its own."""
    return -values if np.nansum(values) < 0.0 else values
