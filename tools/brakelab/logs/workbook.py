"""First sheet of an Excel workbook (.xlsx, ISO/IEC 29500) as rows of text: XML in a zip."""

import io
import re
import zipfile
from typing import Final
from xml.etree import ElementTree

from ecu.errors import UserError

MAGIC: Final = b"PK\x03\x04"
MOST_BYTES: Final = 1 << 28  # of a part, unpacked: more is no manifest
WORDS: Final = "xl/sharedStrings.xml"
_SPACE: Final = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"
_PLACE: Final = re.compile(r"([A-Z]+)(\d+)")


def sheet_rows(where: str, given: bytes) -> list[tuple[int, list[str]]]:
    """Return the rows of the first sheet, each with its number, numbers as they are stored.

    Raises:
        UserError: it is no workbook.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(given)) as book:
            names = book.namelist()
            shared = _part(book, WORDS).iter(f"{_SPACE}si") if WORDS in names else ()
            words = [_text(one) for one in shared]
            sheet = min(
                (name for name in names if re.fullmatch(r"xl/worksheets/sheet\d+\.xml", name)),
                key=lambda name: (len(name), name),
            )
            rows = list(_part(book, sheet).iter(f"{_SPACE}row"))
            return [(int(row.get("r", place)), _cells(row, words)) for place, row in enumerate(rows, 1)]
    except (zipfile.BadZipFile, ElementTree.ParseError, ValueError, KeyError, IndexError):
        raise UserError(where, "", "is no Excel workbook that can be read; save it as CSV") from None


def _part(book: zipfile.ZipFile, name: str) -> ElementTree.Element:
    if book.getinfo(name).file_size > MOST_BYTES:
        raise ValueError(name)
    return ElementTree.fromstring(book.read(name))


def _text(element: ElementTree.Element) -> str:
    return "".join(part.text or "" for part in element.iter(f"{_SPACE}t"))


def _cells(row: ElementTree.Element, words: list[str]) -> list[str]:
    cells: list[str] = []
    for cell in row.iter(f"{_SPACE}c"):
        found = _PLACE.fullmatch(cell.get("r", ""))
        column = len(cells) if found is None else _column(found[1])
        cells += [""] * (column + 1 - len(cells))
        value = cell.findtext(f"{_SPACE}v", "")
        kind = cell.get("t", "n")
        cells[column] = words[int(value)] if kind == "s" else _text(cell) if kind == "inlineStr" else value
    return cells


def _column(letters: str) -> int:
    """Return the place of a column by its letters: A 0, Z 25, AA 26."""
    place = 0
    for letter in letters:
        place = 26 * place + ord(letter) - ord("A") + 1
    return place - 1
