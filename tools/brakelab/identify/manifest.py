"""Manifests: tables, as a spreadsheet writes them, of what was measured besides the files they name."""

import codecs
import csv
import re
from itertools import zip_longest
from pathlib import Path
from typing import Final

from brakelab.logs.csv_header import split_title
from brakelab.logs.workbook import MAGIC, sheet_rows
from ecu.errors import UserError
from ecu.settings.resources import regular
from ecu.settings.toml_file import read_toml

NAMES: Final = ("file", "block", "trip", "test", "programme", "road_energy")
"""Columns of a manifest that measure nothing."""
UTF16: Final = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_DECIMAL: Final = re.compile(r"^([-+]?\d+),(\d+)$")
_THOUSANDS: Final = re.compile(r"[-+]?\d{1,3}(?:([.,' ])\d{3})+(?!\1)[.,]\d*")
_SEPARATOR: Final = re.compile(r'"?sep=.?"?', re.IGNORECASE)
"""First line of a CSV file that Excel wrote for itself."""
_WEIGHED: Final = {
    "g": ("g", 1.0), "kg": ("g", 1e3), "mg": ("g", 1e-3), "mm": ("mm", 1.0), "µm": ("mm", 1e-3),
    "μm": ("mm", 1e-3), "um": ("mm", 1e-3), "MJ": ("MJ", 1.0),
}  # fmt: skip
"""Units of a manifest: of what, and factor."""
_NOTHING: Final = ("-", "–", "n/a", "na", "nan")


def read_manifest(path: Path, given: Path | None = None) -> list[tuple[int, dict[str, str]]]:
    """Return the rows of a manifest, CSV or .xlsx, each with its line in the file; decimal commas are points.

    Rows above the names, of which one is `file`, are a title. Units in brackets behind the names or in a row
    below them are converted to g, mm and mg; rows without a word count for nothing.

    Args:
        path: of the manifest.
        given: file of columns, whose `[manifest]` states the manifest's own names.

    Raises:
        UserError: it cannot be read, lacks a name that is stated, or has another unit.
    """
    regular(path, "a manifest as CSV or .xlsx")
    try:
        text = path.read_bytes()
    except OSError as error:
        raise UserError(
            str(path), "", f"cannot be read ({error.strerror}); give a manifest as CSV or .xlsx"
        ) from None
    table = sheet_rows(str(path), text) if text.startswith(MAGIC) else _lines(path, text)
    rows = [(line, [cell.strip() for cell in row]) for line, row in table if any(row)]
    names = _own_names(given)
    titles = [[split_title(title) for title in row] for _, row in rows]
    files = {"file", *(theirs for theirs, ours in names.items() if ours == "file")}
    head = next((place for place, row in enumerate(titles) if files & {name for name, _ in row}), 0)
    columns = _renamed(path, titles[head] if rows else [], names)
    rows = rows[head + 1 :]
    units = [unit for _, unit in columns]
    if rows and _is_units(rows[0][1]):
        units = [
            under or unit for unit, under in zip_longest(units, rows.pop(0)[1][: len(units)], fillvalue="")
        ]
    factors = [_factor(path, name, unit) for (name, _), unit in zip(columns, units, strict=True)]
    known = list(zip((name for name, _ in columns), factors, strict=True))
    return [
        (line, {name: _cell(text, by) for (name, by), text in zip(known, row, strict=False) if name})
        for line, row in rows
    ]


def _lines(path: Path, text: bytes) -> list[tuple[int, list[str]]]:
    """Return the cells of each line of CSV with its number."""
    if text[:2] not in UTF16 and b"\0" in text:
        remedy = "is no text; save it as CSV or .xlsx: a table that names the measured files"
        raise UserError(str(path), "", remedy)
    lines = _decoded(text).splitlines(keepends=True)
    skipped = 1 if lines and _SEPARATOR.fullmatch(lines[0].strip()) else 0
    delimiter = max(";\t,", key=lambda mark: sum(line.count(mark) > 0 for line in lines[skipped:]))
    table = csv.reader(lines[skipped:], delimiter=delimiter)
    return [(table.line_num + skipped, row) for row in table]


def measured_rows(rows: list[tuple[int, dict[str, str]]]) -> list[tuple[int, dict[str, str]]]:
    """Return those of a manifest's rows that name a file, all where none does: sums and means do not."""
    return [row for row in rows if row[1].get("file")] or rows


def _own_names(given: Path | None) -> dict[str, str]:
    """Return our name by theirs, of the columns that `given` states."""
    stated = read_toml(given).get("manifest", {}) if given is not None else {}
    if not isinstance(stated, dict) or not all(isinstance(theirs, str) for theirs in stated.values()):
        raise UserError(str(given), "manifest", 'give a table of names, mass_before = "Masse vorher"')
    return {split_title(theirs)[0]: name for name, theirs in stated.items()}


def _renamed(path: Path, columns: list[tuple[str, str]], ours: dict[str, str]) -> list[tuple[str, str]]:
    """Return names and units, those of `ours` by our name."""
    found = [name for name, _ in columns]
    if missing := [name for name in ours if name not in found]:
        raise UserError(str(path), missing[0], f"no such column; this manifest has {', '.join(found)}")
    return [(ours.get(name, name), unit) for name, unit in columns]


def refuse_row(path: Path, line: int, row: dict[str, str], needed: str) -> UserError:
    """Return the refusal of a row that lacks something `needed`."""
    columns = f"this manifest has {', '.join(name for name in row if name)}"
    return UserError(str(path), f"line {line}", f"needs {needed}; {columns}; [manifest] of --columns renames")


def _is_units(row: list[str]) -> bool:
    known = [cell.strip("[]()") for cell in row if cell and cell != "-"]
    return bool(known) and all(cell in _WEIGHED for cell in known)


def _factor(path: Path, name: str, unit: str) -> float:
    """Return the factor to g, mm or mg from the unit that a manifest states of a column."""
    unit = unit.strip("[]()")
    own = "mm" if "thickness" in name else "mg" if "filter" in name else "g" if "mass" in name else ""
    if not own or unit in ("", "-", own):
        return 1.0
    if unit not in _WEIGHED or (own == "mm") != (_WEIGHED[unit][0] == "mm"):
        raise UserError(str(path), name, f"unit {unit!r} unknown; give it in {own}")
    return _WEIGHED[unit][1] / _WEIGHED[own][1]


def _cell(text: str, factor: float) -> str:
    if grouped := _THOUSANDS.fullmatch(text):
        text = text.replace(grouped[1], "")
    plain = "" if text.lower() in _NOTHING else _DECIMAL.sub(r"\1.\2", text)
    try:
        return plain if factor == 1.0 else f"{factor * float(plain):.12g}"
    except ValueError:
        return plain


def _decoded(given: bytes) -> str:
    """Return text of whatever a spreadsheet writes: UTF-8 with or without a mark, UTF-16, Windows-1252."""
    if given[:2] in UTF16:
        return given.decode("utf-16", "replace")
    try:
        return given.decode("utf-8-sig")
    except UnicodeDecodeError:
        return given.decode("cp1252", "replace")
