"""Reads CSV text into columns of text, a block of whole lines at a time, so that every row knows its line.

Cells stand between commas, semicolons or tabs, whichever the line of names has; with semicolons or tabs, and
in quotes, a decimal comma is a point, and what separates thousands is left out. A line that is damaged is
skipped and counted; a last line that is not whole is not used.
"""

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
    with path.open("rb") as stream:
        for _ in range(skipped):
            stream.readline()
        while chunk := stream.read(BLOCK_BYTES):
            if too_long:  # its beginning was counted already
                end = chunk.find(b"\n")
                chunk, too_long = chunk[end + 1 :] if end >= 0 else b"", end < 0
            whole, newline, rest = (rest + chunk).rpartition(b"\n")
            if newline:
                yield _parsed(whole + newline, line, names, wanted, delimiter, pointed, damage)
                line += whole.count(b"\n") + 1
            if len(rest) >= BLOCK_BYTES:
                damage.note_damage(1, f"line {line}")
                rest, too_long, line = b"", True, line + 1
    if rest.strip():
        last = Damage()
        yield _parsed(rest + b"\n", line, names, wanted, delimiter, pointed, last)
        if last.damaged:
            damage.cut = f"line {line}: the last line is cut off and was not used"


def _pointed(column: "pa.Array[Any]") -> "pa.Array[Any]":
    """Return cells with a decimal point; `1.234,5` and `1,234.5` are numbers with thousands."""
    import pyarrow.compute as pc  # see `signal_batches`

    for thousands, point in ((".", ","), (",", ".")):
        grouped = rf"^\s*[-+]?\d{{1,3}}(\{thousands}\d{{3}})+\{point}\d*\s*$"
        if pc.any(pc.match_substring_regex(column, grouped)).as_py():
            column = pc.replace_substring(column, thousands, "")
    return pc.replace_substring(column, ",", ".")


def _without_groups(columns: list["pa.Array[Any]"]) -> list["pa.Array[Any]"]:
    """Return columns, those of whole numbers without the mark of thousands, `987` and `1.234`.

    A point is one where other columns have decimal commas, and the reverse.
    """
    import pyarrow.compute as pc  # see `signal_batches`

    def some(column: "pa.Array[Any]", form: str) -> bool:
        return bool(pc.any(pc.match_substring_regex(column, form)).as_py())

    for thousands, point in ((".", ","), (",", ".")):
        if not any(some(column, rf"^\s*[-+]?\d+\{point}\d+\s*$") for column in columns):
            continue
        grouped = rf"[1-9]\d{{0,2}}(\{thousands}\d{{3}})+"
        for place, column in enumerate(columns):
            whole = pc.match_substring_regex(column, rf"^\s*[-+]?(\d{{1,3}}|{grouped})\s*$")
            if pc.all(whole).as_py() and all(
                some(column, rf"^\s*[-+]?{form}\s*$") for form in (r"\d{1,3}", grouped)
            ):
                columns[place] = pc.replace_substring(column, thousands, "")
    return columns


def _parsed(
    text: bytes,
    line: int,
    names: list[str],
    wanted: list[str],
    delimiter: str,
    pointed: bool,
    damage: Damage,
) -> tuple[NDArray[np.int64], pa.RecordBatch]:
    """Parse whole lines, of which the first has the number `line`."""
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
    if pointed or b'"' in text:  # in quotes a comma stands within a cell
        if b"," in text and b"." in text:
            columns = _without_groups(columns)
        columns = [_pointed(column) for column in columns]
    return lines, pa.RecordBatch.from_arrays(columns, names=wanted)
