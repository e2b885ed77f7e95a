"""Manifests as spreadsheets write them, with the contract's names or with somebody's own."""

import os
from pathlib import Path

import pytest

from brakelab.identify.manifest import measured_rows, read_manifest
from ecu.errors import UserError
from tests.brakelab.logs.test_workbook import workbook

MANIFEST = "block,file,mass_before\nkühl,b1.csv,905.123\n"
EXPORTS = {
    "Excel, CSV UTF-8": MANIFEST.encode("utf-8-sig"),
    "Excel, German": MANIFEST.replace(",", ";").replace(".123", ",123").encode("cp1252"),
    "Excel, Unicode text": MANIFEST.replace(",", "\t").encode("utf-16"),
    "LibreOffice": MANIFEST.encode(),
    "units in brackets": MANIFEST.replace("mass_before", "mass_before [kg]")
    .replace("905.", "0.905")
    .encode(),
    "a row of units, an empty one": (
        MANIFEST.replace("\nk", "\n-,,mg\nk").replace("905.123", "905123") + ",,\n"
    ).encode(),
    "Excel's first line": b"sep=,\n" + MANIFEST.encode(),
}


@pytest.mark.parametrize("text", EXPORTS.values(), ids=EXPORTS)
def test_a_manifest_is_what_a_spreadsheet_writes(tmp_path: Path, text: bytes) -> None:
    (tmp_path / "manifest.csv").write_bytes(text)
    row = {"block": "kühl", "file": "b1.csv", "mass_before": "905.123"}
    ((line, found),) = read_manifest(tmp_path / "manifest.csv")
    assert found == row
    assert text.splitlines()[line - 1].find(b"b1.csv") > 0 or text[:2] == b"\xff\xfe"


@pytest.mark.parametrize(
    "grams", ["1.905,123", "1,905.123", "1 905,123", "1'905.123", "+1905.123", "1905,123"]
)
def test_masses_above_a_kilogram_are_numbers(tmp_path: Path, grams: str) -> None:
    (tmp_path / "manifest.csv").write_text(MANIFEST.replace(",", ";").replace("905.123", grams))
    ((_, found),) = read_manifest(tmp_path / "manifest.csv")
    assert float(found["mass_before"]) == 1905.123


def test_a_manifest_is_a_workbook(tmp_path: Path) -> None:
    heads = "".join(f'<c t="inlineStr"><is><t>{name}</t></is></c>' for name in ("block", "file", "mass [kg]"))
    cells = '<c t="inlineStr"><is><t>cold</t></is></c><c t="inlineStr"><is><t>b1.csv</t></is></c>'
    rows = f'<row r="1">{heads}</row><row r="4">{cells}<c><v>0.905123</v></c></row>'
    (tmp_path / "manifest.xlsx").write_bytes(workbook(rows))
    assert read_manifest(tmp_path / "manifest.xlsx") == [
        (4, {"block": "cold", "file": "b1.csv", "mass": "905.123"})
    ]


def test_a_unit_that_is_not_known_is_refused(tmp_path: Path) -> None:
    (tmp_path / "manifest.csv").write_text(MANIFEST.replace("mass_before", "mass_before (oz)"))
    with pytest.raises(UserError, match=r"mass_before: unit 'oz' unknown; give it in g"):
        read_manifest(tmp_path / "manifest.csv")


def test_a_measured_file_in_the_manifests_place_is_refused_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "block.parquet").write_bytes(b"PAR1\x00\r\x00\n")
    with pytest.raises(UserError, match=r"block\.parquet: is no text; save it as CSV"):
        read_manifest(tmp_path / "block.parquet")


def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "manifest.csv")
    with pytest.raises(UserError, match="is no regular file"):
        read_manifest(tmp_path / "manifest.csv")


OWN = "Block;Datei;Masse vorher [kg]\nkühl;b1.csv;0,905123\n"
NAMED = '[manifest]\nblock = "Block"\nfile = "Datei"\nmass_before = "Masse vorher"\n'


@pytest.mark.parametrize("theirs", ["Masse vorher", "Masse vorher [kg]"])
def test_a_file_of_columns_renames_a_manifest_s_own_columns(tmp_path: Path, theirs: str) -> None:
    (tmp_path / "manifest.csv").write_text(OWN)
    (tmp_path / "mine.toml").write_text(NAMED.replace("Masse vorher", theirs))
    ((_, row),) = read_manifest(tmp_path / "manifest.csv", tmp_path / "mine.toml")
    assert row == {"block": "kühl", "file": "b1.csv", "mass_before": "905.123"}


def test_a_title_above_the_names_and_a_sum_below_the_rows_are_no_measurements(tmp_path: Path) -> None:
    (tmp_path / "manifest.csv").write_text(f"Pad wear, rig 3\n\n{OWN}Sum;;12,5\n")
    (tmp_path / "mine.toml").write_text(NAMED)
    ((line, row),) = measured_rows(read_manifest(tmp_path / "manifest.csv", tmp_path / "mine.toml"))
    assert (line, row["block"], row["mass_before"]) == (4, "kühl", "905.123")


def test_without_any_file_every_row_is_kept_to_be_refused(tmp_path: Path) -> None:
    (tmp_path / "manifest.csv").write_text("block,mass_before\nkühl,905.123\n")
    assert len(measured_rows(read_manifest(tmp_path / "manifest.csv"))) == 1


@pytest.mark.parametrize(
    ("given", "line"),
    [
        (
            NAMED.replace("vorher", "vorhr"),
            r"manifest\.csv: Masse vorhr: no such column; this manifest has Block, Datei, Masse vorher",
        ),
        ("manifest = 3\n", r"mine\.toml: manifest: give a table of names"),
        ("[manifest]\nfile = 3\n", r"mine\.toml: manifest: give a table of names"),
    ],
)
def test_wrong_names_of_a_manifest_are_refused(tmp_path: Path, given: str, line: str) -> None:
    (tmp_path / "manifest.csv").write_text(OWN)
    (tmp_path / "mine.toml").write_text(given)
    with pytest.raises(UserError, match=line):
        read_manifest(tmp_path / "manifest.csv", tmp_path / "mine.toml")
