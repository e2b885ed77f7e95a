"""Reads CSV text into columns of text, a block of whole lines at a time, so that every row knows its line.

Cells stand between commas, semicolons or tabs, whichever the line of names has; with semicolons or tabs, and
in quotes, a decimal comma is a point, and what separates thousands is left out: which of the two a mark is
follows from lines all over the file. `1,202` alone, with nothing beside it that tells, is 1.202 between
semicolons, which stand there because commas are decimal, and 1202 in quotes between commas. A line that is
damaged is skipped and counted; a last line that is not whole is not used.
"""

import csv
import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv
from numpy.typing import NDArray

from brakelab.logs.log_quality import Damage
from ecu.errors import UserError

BLOCK_BYTES: Final = 1 << 20
_BLANK: Final = re.compile(rb"(?m)^\r?\n")
SAMPLES: Final = 16  # places of a file whose lines show how its numbers are written
SAMPLE_BYTES: Final = 1 << 14
THOUSANDS: Final = 3  # digits
_OTHER: Final = {",": ".", ".": ","}
_BOTH: Final = re.compile(r"[-+]?\d{1,3}(?:([.,])\d{3})(?:\1\d{3})*(?!\1)[.,]\d*")
_GROUPED: Final = re.compile(r"[-+]?[1-9]\d{0,2}([.,])\d{3}(?:\1\d{3})*")
_PLAIN: Final = re.compile(r"[-+]?(\d*)([.,]?)\d*")
_NO_SAMPLE: Final = ["", "null", "NULL", "NA"]


def csv_columns(path: Path) -> tuple[list[str], str]:
    """Return the names in the first line, and their separator.

    Raises:
        UserError: the first line has no names, or the file cannot be opened.
    """
    with path.open("rb") as stream:
        header = stream.readline(BLOCK_BYTES)
    if header[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise UserError(str(path), "line 1", "this is UTF-16; save it as CSV in UTF-8")
    if len(header) == BLOCK_BYTES or b"\r" in header.strip():
        raise UserError(str(path), "line 1", "does not end; every line has to end in LF or CR LF")
    text = header.decode("utf-8", "replace").strip().lstrip("\ufeff")
    delimiter = max(",;\t", key=text.count)
    return [name.strip().strip('"') for name in text.split(delimiter)], delimiter


def csv_rows(
    path: Path,
    names: list[str],
    delimiter: str,
    wanted: list[str],
    damage: Damage,
    skipped: int = 1,
    decimal_comma: bool = False,
) -> Iterator[tuple[NDArray[np.int64], pa.RecordBatch]]:
    """Yield the lines of some rows, shape (rows,), and these rows: the columns `wanted`, as text.

    `names` and `delimiter` as `csv_columns` found them, in a file of `skipped` lines before its rows. What
    cannot be read goes into `damage`. With `decimal_comma` a comma in a cell is a point whatever stands
    between the cells.
    """
    line, rest, too_long = skipped + 1, b"", False
    pointed = decimal_comma or delimiter != ","
    marks: dict[str, str] | None = None
    if pointed or _quotes(path):  # in quotes a comma stands within a cell
        marks = _grouped_marks(path, names, delimiter, wanted, skipped, pointed)
    with path.open("rb") as stream:
        for _ in range(skipped):
            stream.readline()
        while chunk := stream.read(BLOCK_BYTES):
            if too_long:  # its beginning was counted already
                end = chunk.find(b"\n")
                chunk, too_long = chunk[end + 1 :] if end >= 0 else b"", end < 0
            whole, newline, rest = (rest + chunk).rpartition(b"\n")
            if newline:
                yield _parsed(whole + newline, line, names, wanted, delimiter, marks, damage)
                line += whole.count(b"\n") + 1
            if len(rest) >= BLOCK_BYTES:
                damage.note_damage(1, f"line {line}")
                rest, too_long, line = b"", True, line + 1
    if rest.strip():
        last = Damage()
        yield _parsed(rest + b"\n", line, names, wanted, delimiter, marks, last)
        if last.damaged:
            damage.cut = f"line {line}: the last line is cut off and was not used"


def _quotes(path: Path) -> bool:
    with path.open("rb") as stream:
        return b'"' in stream.read(BLOCK_BYTES)


def _grouped_marks(
    path: Path, names: list[str], delimiter: str, wanted: list[str], skipped: int, pointed: bool
) -> dict[str, str]:
    """Return the marks by which whole numbers of columns `wanted` are grouped, by lines from all over.

    `1.234` is grouped where other columns have decimal commas and its own has no `0.5`; where they have both
    or none, only beside `987`, or in quotes between commas. `1.234,5` says it of itself, wherever it is.
    """
    cells: dict[str, set[str]] = {name: set() for name in wanted}
    places = {name: place for place, name in enumerate(names)}
    for row in csv.reader(_some_lines(path, skipped), delimiter=delimiter):
        for name in wanted:
            if places[name] < len(row):
                cells[name].add(row[places[name]].strip())
    seen = {name: {_form(cell) for cell in found} for name, found in cells.items()}
    decimal = {mark for forms in seen.values() for form, mark in forms if form == "decimal"}
    decimal |= {_OTHER[mark] for forms in seen.values() for form, mark in forms if form == "both"}
    marks: dict[str, str] = {}
    for name, forms in seen.items():
        for mark in ",.":
            if decimal == {_OTHER[mark]}:
                sure = True
            elif decimal == {mark} or (mark == "." and not decimal):
                sure = False
            else:
                beside = ("grouped", mark) in forms and ("whole", "") in forms
                sure = (beside or (not decimal and not pointed)) and ("long", "") not in forms
            if sure and ("decimal", mark) not in forms:
                marks[name] = mark
    return marks


def _some_lines(path: Path, skipped: int) -> Iterator[str]:
    """Yield lines of text from places all over a file."""
    size = path.stat().st_size
    with path.open("rb") as stream:
        for place in range(SAMPLES):
            stream.seek(size * place // SAMPLES)
            lines = stream.read(SAMPLE_BYTES).split(b"\n")
            for line in lines[skipped if not place else 1 : None if size < SAMPLE_BYTES else -1]:
                if line.count(b'"') % 2 == 0:
                    yield line.decode("latin-1").rstrip("\r")


def _form(cell: str) -> tuple[str, str]:
    """Return how a number is written, and its mark: whole, long, decimal, grouped or both; else ""."""
    if found := _BOTH.fullmatch(cell):
        return "both", found[1]
    if found := _GROUPED.fullmatch(cell):
        return "grouped", found[1]
    found = _PLAIN.fullmatch(cell)
    if found is None or not any(map(str.isdecimal, cell)):
        return "", ""
    if found[2]:
        return "decimal", found[2]
    return ("whole" if len(found[1]) <= THOUSANDS else "long"), ""


def _plain(column: "pa.Array[Any]", grouped: str, both: bool) -> "pa.Array[Any]":
    """Return cells with a decimal point and without marks of thousands, `grouped` or beside the other."""
    import pyarrow.compute as pc  # see `signal_batches`

    forms = [(grouped, "")] if grouped else []
    forms += [(mark, rf"\{point}\d*") for mark, point in _OTHER.items() if both]
    for mark, end in forms:
        found = pc.match_substring_regex(column, rf"^\s*[-+]?\d{{1,3}}(\{mark}\d{{3}})+{end}\s*$")
        if pc.any(found).as_py():
            if not end:
                found = pc.and_(found, pc.invert(pc.match_substring_regex(column, r"^\s*[-+]?0")))
            column = pc.if_else(found, pc.replace_substring(column, mark, ""), column)
    return pc.replace_substring(column, ",", ".")


def _parsed(
    text: bytes,
    line: int,
    names: list[str],
    wanted: list[str],
    delimiter: str,
    marks: dict[str, str] | None,
    damage: Damage,
) -> tuple[NDArray[np.int64], pa.RecordBatch]:
    """Parse whole lines, of which the first has the number `line`; `marks` of thousands where commas stand
    within cells."""
    # A quote that is never closed would swallow all that follows, a CR alone would end a line.
    if b'"' in text or text.count(b"\r") != text.count(b"\r\n"):
        pieces = text.split(b"\n")[:-1]
        pieces = [b"?" if piece.count(b'"') % 2 or b"\r" in piece[:-1] else piece for piece in pieces]
        text = b"\n".join(pieces) + b"\n"
    lines = line + np.arange(text.count(b"\n"))
    if _BLANK.search(text):
        lines = lines[[len(piece) > piece.endswith(b"\r") for piece in text.split(b"\n")[:-1]]]
    wrong: list[tuple[int, int]] = []

    def skip(row: pa_csv.InvalidRow) -> Literal["skip"]:
        wrong.append(((row.number or 1) - 1, row.actual_columns))
        return "skip"

    table = pa_csv.read_csv(
        io.BytesIO(text),
        # Whatever the bytes are, they are characters of Latin-1.
        read_options=pa_csv.ReadOptions(
            column_names=names, use_threads=False, block_size=len(text) + 1, encoding="latin-1"
        ),
        parse_options=pa_csv.ParseOptions(delimiter=delimiter, invalid_row_handler=skip),
        convert_options=pa_csv.ConvertOptions(
            column_types=dict.fromkeys(wanted, pa.string()),
            include_columns=wanted,
            null_values=_NO_SAMPLE,
            strings_can_be_null=True,
        ),
    ).combine_chunks()
    if wrong:
        row, cells = wrong[0]
        reason = f"{cells} cell{'s' if cells > 1 else ''} instead of {len(names)}"
        damage.note_damage(len(wrong), f"line {lines[row]} ({reason})")
        lines = np.delete(lines, [row for row, _ in wrong])
    columns = [table.column(name).combine_chunks() for name in wanted]
    if marks is not None or b'"' in text:
        given, both = [(marks or {}).get(name, "") for name in wanted], b"," in text and b"." in text
        columns = [_plain(column, mark, both) for column, mark in zip(columns, given, strict=True)]
    return lines, pa.RecordBatch.from_arrays(columns, names=wanted)
