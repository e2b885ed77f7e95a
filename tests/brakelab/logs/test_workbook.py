"""First sheet of a workbook as spreadsheets store it: shared words, inline ones, cells that are missing."""

import io
import zipfile

import pytest

from brakelab.logs.workbook import sheet_rows
from ecu.errors import UserError

SPACE = 'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"'
WORDS = f"<sst {SPACE}><si><t>block</t></si><si><r><t>kü</t></r><r><t>hl</t></r></si></sst>"
ROWS = (
    '<row r="1"><c r="A1" t="s"><v>0</v></c><c r="C1" t="inlineStr"><is><t>mass_before</t></is></c></row>'
    '<row r="3"><c r="A3" t="s"><v>1</v></c><c r="AA3"><v>905.123</v></c></row>'
)
CELLS = [(1, ["block", "", "mass_before"]), (3, ["kühl", *[""] * 25, "905.123"])]


def workbook(rows: str = ROWS, words: str = WORDS) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as book:
        book.writestr("xl/sharedStrings.xml", words)
        book.writestr("xl/worksheets/sheet10.xml", "<no/>")
        book.writestr(
            "xl/worksheets/sheet2.xml", f"<worksheet {SPACE}><sheetData>{rows}</sheetData></worksheet>"
        )
    return packed.getvalue()


def test_a_sheet_is_rows_of_text() -> None:
    assert sheet_rows("m.xlsx", workbook()) == CELLS


@pytest.mark.parametrize(
    "given",
    [
        pytest.param(workbook()[:200], id="cut off"),
        pytest.param(workbook('<row><c r="A1" t="s"><v>7</v></c></row>'), id="a word that is missing"),
        pytest.param(workbook("<row>"), id="no XML"),
    ],
)
def test_what_is_no_workbook_is_refused(given: bytes) -> None:
    with pytest.raises(UserError, match=r"m\.xlsx: is no Excel workbook that can be read; save it as CSV"):
        sheet_rows("m.xlsx", given)
