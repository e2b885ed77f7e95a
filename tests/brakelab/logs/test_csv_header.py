"""Tables of measuring programs: where they begin, their names and units, in every shape."""

from pathlib import Path

import pytest

from brakelab.logs.csv_header import find_header
from ecu.errors import UserError

EXPORTS = Path(__file__).parents[2] / "data" / "exports"
ROWS = "1,2\n2,3\n3,4\n"


@pytest.mark.parametrize(
    ("name", "delimiter", "lines", "first", "last"),
    [
        ("aim", ",", 17, ("Time", "s"), ("BrakePress_R", "bar")),
        ("motec", ",", 18, ("Time", "s"), ("Brake Pressure Rear", "kPa")),
        ("racecapture", ",", 1, ("Interval", "ms"), ("BrakeR", "psi")),
        ("canape", ";", 2, ("Zeit", "s"), ("p_HZ", "bar")),
        ("inca", "\t", 5, ("time", "s"), ("pbrk\\ESP:1", "MPa")),
    ],
)
def test_the_table_of_a_program_is_found(
    name: str, delimiter: str, lines: int, first: tuple[str, str], last: tuple[str, str]
) -> None:
    header = find_header(EXPORTS / f"{name}.csv")
    assert (header.delimiter, header.lines) == (delimiter, lines)
    assert (header.names[0], header.units[0]) == first
    assert (header.names[-1], header.units[-1]) == last


@pytest.mark.parametrize(
    ("text", "names", "units", "lines"),
    [
        ("Time [s],v (km/h)\n" + ROWS, ["Time", "v"], ["s", "km/h"], 1),
        ("t;v\n0,5;1,25\n1,5;2\n2,5;3\n", ["t", "v"], ["", ""], 1),
        ("t,v,v\n1,2,3\n2,3,4\n3,4,5\n", ["t", "v", "v#2"], ["", "", ""], 1),
        ("note\n\nt,v\ns,m/s\n1,2\n\n" + ROWS, ["t", "v"], ["s", "m/s"], 6),  # numbers of channels above
        ('"t","v"\r\n"0","1,5"\r\n"1","2,5"\r\n"2","3,5"\r\n', ["t", "v"], ["", ""], 1),
        ("t,v\n1,2\n", ["t", "v"], ["", ""], 1),
        ("t,v,note\n0,1,a\n1,,b\n2,3,\n3,4,\n", ["t", "v", "note"], ["", "", ""], 1),
        (
            "t;v;note\n2024-03-12T10:00:00+01:00;1;on\n2024-03-12T10:00:01+0100;1;on\n"
            "12.03.2024 10:00:02 AM;1;on\n",
            ["t", "v", "note"],
            ["", "", ""],
            1,
        ),
        ("t,p\n0,\n1,2\n2,\n", ["t", "p"], ["", ""], 1),
        (
            "Zeit in ms;Druck in bar;Gang in use\n" + ROWS.replace(",", ";").replace("\n", ";1\n"),
            ["Zeit", "Druck", "Gang in use"],
            ["ms", "bar", ""],
            1,
        ),
        ("\"('t', 's')\",\"('v', 'km/h')\"\n" + ROWS, ["t", "v"], ["s", "km/h"], 1),
    ],
)
def test_shapes(text: str, names: list[str], units: list[str], lines: int, tmp_path: Path) -> None:
    path = tmp_path / "drive.csv"
    path.write_text(text, newline="")
    header = find_header(path)
    assert (header.names, header.units, header.lines) == (names, units, lines)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1"])
def test_an_encoding_is_no_matter(encoding: str, tmp_path: Path) -> None:
    path = tmp_path / "drive.csv"
    path.write_bytes("t;längs\ns;m/s²\n0;1\n1;2\n2;3\n".encode(encoding))
    header = find_header(path)
    assert (header.names, header.units) == (["t", "längs"], ["s", "m/s²"])


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "no names above rows of numbers"),
        (b"1,2\n2,3\n3,4\n", "no names above rows of numbers"),
        (b"only words\nand more\n", "no names above rows of numbers"),
        ("t,v\n1,2\n".encode("utf-16"), "this is UTF-16"),
        (bytes(range(256)) * 40, "no names above rows of numbers"),
    ],
)
def test_no_table_is_one_line(content: bytes, says: str, tmp_path: Path) -> None:
    path = tmp_path / "drive.csv"
    path.write_bytes(content)
    with pytest.raises(UserError, match=says):
        find_header(path)
