"""Finds the table in a CSV file of a measuring program: lines about the session, names, units, numbers.

Known by their shape, not by their program. AiM Race Studio and MoTeC i2 put lines about the session above the
names and the units below them; RaceCapture writes `"AccelX"|"G"|-3.0|3.0|25` in one line; CANape and INCA
export names and a line of units, or `Speed [km/h]`. Semicolons or tabs, decimal commas, a byte order mark and
Latin-1 are read.
"""

import csv
import re
from pathlib import Path
from typing import Final, NamedTuple

from brakelab.logs.column_map import seconds_of
from ecu.bus.units import CONVERSIONS, spelled
from ecu.errors import UserError

HEAD_BYTES: Final = 1 << 18
LONGEST_HEAD: Final = 400  # lines in which the table has to begin
SHOWN: Final = 3  # rows of numbers that make a table
MOSTLY: Final = 0.7  # of the cells are numbers in a row of the table; half, where the first is one
_NUMBER: Final = re.compile(
    r"[-+]?(\d+([.,]\d*)?|[.,]\d+)([eE][-+]?\d+)?|nan|null|NA|"
    r"(.*[ T])?\d+:\d\d:\d\d([.,]\d+)?( ?[AP]M| ?Z|[-+]\d\d:?\d\d)?",
    re.IGNORECASE,
)
"""A cell of a table of numbers, or a time of day."""
_BRACKETS: Final = re.compile(r"(.*?\S)\s*[\[(]([^\])]*)[\])]")
_LEVELS: Final = re.compile(r"\('([^']*)', '([^']*)'\)")
"""Heading of two levels as pandas writes it to Parquet."""
_WORDS: Final = re.compile(r"(.*\S) in (\S+)", re.IGNORECASE)

Row = list[str]


class CsvHeader(NamedTuple):
    """Line at which the numbers of a file begin, and its columns."""

    names: list[str]
    units: list[str]
    """Of each column as the file spells it, empty: it does not say."""
    titles: list[str]
    """Heading of each column with its unit."""
    delimiter: str
    lines: int
    """Lines before the first row of numbers."""


def find_header(path: Path) -> CsvHeader:
    """Return the header of a CSV file of whatever program.

    Raises:
        UserError: the file is UTF-16, or has no names above rows of numbers.
    """
    with path.open("rb") as stream:
        head = stream.read(HEAD_BYTES)
    if head[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise UserError(str(path), "line 1", "this is UTF-16; save it as CSV in UTF-8")
    lines = _decoded(head).splitlines()[:LONGEST_HEAD]
    found = [one for delimiter in ";\t," if (one := _table(lines, delimiter))]
    if not found:
        remedy = f"no names above rows of numbers in the first {LONGEST_HEAD} lines; give a table as CSV"
        raise UserError(str(path), "line 1", remedy)
    return max(found, key=lambda header: len(header.names))


def _decoded(head: bytes) -> str:
    try:
        return head.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        cut = error.start >= len(head) - 4  # within the last character that was read
        return head[: error.start].decode("utf-8-sig") if cut else head.decode("cp1252", "replace")


def _table(lines: list[str], delimiter: str) -> CsvHeader | None:
    rows = [_cells(line, delimiter) for line in lines]
    first = next((place for place in range(len(rows)) if _begins(rows, place)), None)
    if first is None:
        return None
    above = _above(rows, first)
    if not above:
        return None
    width = len(rows[first])
    padded = [(row + [""] * width)[:width] for row in above[:2]]
    parts = [split_title(title) for title in padded[0]]
    if len(padded) > 1:
        below = [cell.strip().strip("[]()") for cell in padded[1]]
        parts = [(name, unit or under) for (name, unit), under in zip(parts, below, strict=True)]
    titles = [title.strip() for title in padded[0]]
    return CsvHeader(
        distinct([name for name, _ in parts]), [unit for _, unit in parts], titles, delimiter, first
    )


def _cells(line: str, delimiter: str) -> Row:
    return next(csv.reader([line], delimiter=delimiter), []) if line.strip() else []


def _numeric(row: Row) -> bool:
    known = [cell.strip() for cell in row if cell.strip()]
    numbers = [_NUMBER.fullmatch(cell) is not None for cell in known]
    least = 0.5 if numbers and numbers[0] else MOSTLY
    return len(row) > 1 and any(numbers) and sum(numbers) >= least * len(known)


def _begins(rows: list[Row], place: int) -> bool:
    """Return whether rows of numbers begin here; numbers of channels above them do not."""
    rest = rows[place : place + SHOWN]
    return place > 0 and all(_numeric(row) and len(row) == len(rest[0]) for row in rest)


def _above(rows: list[Row], first: int) -> list[Row]:
    """Return the lines of names, units and others right above the numbers, from the top."""
    place = first - 1
    while place >= 0 and (not any(rows[place]) or _numeric(rows[place])):
        place -= 1
    block: list[Row] = []
    while place >= 0 and abs(len(rows[place]) - len(rows[first])) <= 1 and any(rows[place]):
        block.insert(0, rows[place])
        place -= 1
    return block


def split_title(title: str) -> tuple[str, str]:
    """Return name and unit of `Speed [km/h]`, `Speed (km/h)`, `Speed in km/h`, `('Speed', 'km/h')` or
    `"Speed"|"km/h"|0|200|10`."""
    title = title.strip()
    if levels := _LEVELS.fullmatch(title):
        return levels[1], levels[2]
    if (spoken := _WORDS.fullmatch(title)) and _is_unit(spoken[2]):
        return spoken[1], spoken[2]
    if title.count("|") >= 2:
        name, unit = (part.strip(' "') for part in title.split("|")[:2])
        return name, unit
    found = _BRACKETS.fullmatch(title)
    return (found[1], found[2]) if found else (title, "")


def _is_unit(word: str) -> bool:
    known = any(spelled(word) in units for units in CONVERSIONS.values()) and spelled(word) != "-"
    return known or seconds_of(word) is not None


def distinct(names: list[str]) -> list[str]:
    """Return the names, the second of the same with `#2` and so on."""
    counts: dict[str, int] = {}
    distinct = []
    for name in names:
        counts[name] = counts.get(name, 0) + 1
        distinct.append(f"{name}#{counts[name]}" if counts[name] > 1 else name)
    return distinct
