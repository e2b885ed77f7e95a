"""A stranger's recording: other columns, units and separators, damaged rows; and each line that he gets."""

import datetime
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
import pyarrow.parquet as pq
import pytest

from brakelab.identify.friction.columns import Columns, columns_text
from brakelab.identify.friction.reader import read_recording
from brakelab.identify.friction.recording import Recording, write_recording
from brakelab.identify.friction.stops import find_stops
from brakelab.plant.linings import Lining
from ecu.errors import UserError

pytestmark = pytest.mark.study

Write = Callable[..., Path]


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_what_we_write_is_what_we_read(
    tmp_path: Path, recording: Recording, lining: Lining, ending: str
) -> None:
    path = tmp_path / f"own{ending}"
    write_recording(path, recording, lining, 129.0)
    read = read_recording(path)
    assert read.damaged == ""
    assert read.columns.brake == lining.brake
    assert read.columns.rig.inertia == 129.0
    for found, written, digits in zip(read.recording, recording, (1e-3, 100.0, 0.1, 1e-3, 0.01), strict=True):
        np.testing.assert_allclose(found, written, atol=digits)


def test_a_stranger_s_units_become_si(tmp_path: Path, recording: Recording, strange: Write) -> None:
    read = read_recording(strange(tmp_path, recording))
    for found, written in zip(read.recording, recording, strict=True):
        np.testing.assert_allclose(found, written, rtol=1e-4, atol=2e-3)


def test_damaged_rows_are_left_out_and_counted(tmp_path: Path, recording: Recording, strange: Write) -> None:
    path = strange(tmp_path, recording, damaged=True)
    read = read_recording(path)
    assert read.damaged == f"{path}: 3 rows left out, first: line 52 (2 cells instead of 5)"
    assert len(read.recording.time) == len(recording.time) - 3


@pytest.mark.parametrize(
    ("row", "spoilt", "place"),
    [
        (10, "1;2", "line 12 (2 cells instead of 5)"),
        (20, ";1;1;1;1", "line 22 (Zeit is no number)"),
        (30, "1;1;off;1;1", "line 32 (M_B is no number)"),
        (40, "0;1;1;1;1", "line 42 (time does not rise)"),
    ],
)
def test_a_damaged_row_is_named_as_an_editor_counts(
    tmp_path: Path, recording: Recording, strange: Write, row: int, spoilt: str, place: str
) -> None:
    """The address holds behind an empty line too."""
    path = strange(tmp_path, recording)
    lines = path.read_text("utf-8").splitlines()
    lines[row + 1] = spoilt
    path.write_text("\n".join(lines) + "\n", "utf-8")
    assert read_recording(path).damaged == f"{path}: 1 row left out, first: {place}"
    path.write_text("\n".join([lines[0], "", *lines[1:]]) + "\n", "utf-8")
    assert read_recording(path).damaged.endswith(place.replace(str(row + 2), str(row + 3)))


ABOVE = {
    # of a test rig's programme; the names and what stands below them are changed by the last two
    "a session": ("Prüfstand;LINK 3900\nBelag;A 17\n\n", ";", ""),
    "a session of another width": ("Prüfstand;LINK 3900;;;;;;;\nPrüfer;Weiß\n", ";", ""),
    "units below the names": ("Prüfstand;LINK 3900\n\n", ";", "s;psi;Nm;rpm;°F\n"),
    "units in the names": ("Prüfstand;LINK 3900\n\n", " [raw];", ""),
}


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1"])
@pytest.mark.parametrize(("above", "joint", "below"), ABOVE.values(), ids=ABOVE)
def test_lines_above_the_names_are_passed_over(
    tmp_path: Path, recording: Recording, strange: Write, above: str, joint: str, below: str, encoding: str
) -> None:
    path = strange(tmp_path, recording)
    first, rows = path.read_text("utf-8").split("\n", 1)
    names = first.replace(";", joint) + joint.removesuffix(";")
    path.write_text(f"{above}{names}\n{below}{rows}", encoding)
    read = read_recording(path)
    assert read.damaged == ""
    np.testing.assert_allclose(read.recording.time, recording.time, rtol=1e-4, atol=2e-3)


def _export(strange: Path, cells) -> Path:
    """Rewrite a stranger's file; `cells`: of the number of a row and its cells, the new ones."""
    head, *rows = strange.read_text("utf-8").splitlines()
    new = [";".join(cells(number, row.split(";"))) for number, row in enumerate(rows)]
    strange.write_text("\n".join([head, *new, ""]), "utf-8")
    return strange


def _grouped(cell: str) -> str:
    return f"{float(cell.replace(',', '.')):,.6f}".replace(",", "|").replace(".", ",").replace("|", ".")


def test_thousands_are_numbers(tmp_path: Path, recording: Recording, strange: Write) -> None:
    """1.234,5 rpm: what turns fastest was left out."""
    path = _export(strange(tmp_path, recording), lambda _, cells: list(map(_grouped, cells)))
    read = read_recording(path)
    assert read.damaged == ""
    assert read.recording.speed == pytest.approx(recording.speed, abs=1e-4)


def test_thousands_in_quotes_between_commas_are_numbers(
    tmp_path: Path, recording: Recording, strange: Write
) -> None:
    """ "1,234.5" rpm, as American rigs write it: all rows above a thousand were left out."""
    path = strange(tmp_path, recording)
    head, *rows = path.read_text("utf-8").splitlines()
    american = [",".join(f'"{float(c.replace(",", ".")):,.6f}"' for c in row.split(";")) for row in rows]
    path.write_text("\n".join([head.replace(";", ","), *american, ""]), "utf-8")
    read = read_recording(path)
    assert read.damaged == ""
    assert read.recording.speed == pytest.approx(recording.speed, abs=1e-4)


def test_whole_numbers_with_thousands_are_numbers(
    tmp_path: Path, recording: Recording, strange: Write
) -> None:
    """987 and 1.234 N m beside decimal commas: the hardest stops were left out as dead ones."""
    strange(tmp_path, recording)
    path = tmp_path / "strange.csv"
    columns = path.with_suffix(".toml")
    columns.write_text(columns.read_text("utf-8").replace('"kN m"', '"N m"'), "utf-8")
    at = path.read_text("utf-8").splitlines()[0].split(";").index("M_B")

    def whole(_: int, cells: list[str]) -> list[str]:
        torque = f"{1e3 * float(cells[at].replace(',', '.')):,.0f}".replace(",", ".")
        return [*cells[:at], torque, *cells[at + 1 :]]

    read = read_recording(_export(path, whole))
    assert recording.torque.max() > 1000.0
    assert np.abs(read.recording.torque) == pytest.approx(np.abs(recording.torque), abs=0.6)


def test_a_thermocouple_slower_than_the_rest_is_read(
    tmp_path: Path, recording: Recording, strange: Write
) -> None:
    path = strange(tmp_path, recording)
    at = path.read_text("utf-8").splitlines()[0].split(";").index("T_Scheibe")
    _export(path, lambda row, cells: cells if row % 10 == 0 else [*cells[:at], "", *cells[at + 1 :]])
    read = read_recording(path)
    assert read.damaged == ""
    assert read.recording.temperature == pytest.approx(recording.temperature, abs=3.0)


@pytest.mark.parametrize("form", ["%d.%m.%Y %H:%M:%S", "%Y-%m-%dT%H:%M:%S", "%m/%d/%Y %H:%M:%S"])
def test_dates_are_times(tmp_path: Path, recording: Recording, strange: Write, form: str) -> None:
    """From before midnight on."""
    begin = datetime.datetime(2024, 3, 28, 23, 59, 58)

    def dated(_: int, cells: list[str]) -> list[str]:
        now = begin + datetime.timedelta(milliseconds=float(cells[0].replace(",", ".")))
        return [f"{now.strftime(form)},{now.microsecond:06d}", *cells[1:]]

    path = _export(strange(tmp_path, recording), dated)
    columns = path.with_suffix(".toml")
    columns.write_text(columns.read_text("utf-8").replace('"ms"', '"s"'), "utf-8")
    read = read_recording(path)
    assert read.damaged == ""
    assert np.diff(read.recording.time) == pytest.approx(np.diff(recording.time), abs=1e-5)


def test_a_time_that_begins_anew_with_every_stop_goes_on(
    tmp_path: Path, recording: Recording, columns: Columns, strange: Write
) -> None:
    begins = np.flatnonzero(np.diff(recording.time, prepend=-100.0) > 1.0)
    stop = np.searchsorted(begins, np.arange(len(recording.time)), "right") - 1
    anew = recording.time - recording.time[begins][stop]
    read = read_recording(strange(tmp_path, recording._replace(time=anew)))
    assert read.damaged == ""
    assert len(find_stops(read.recording, columns, "x")) == len(begins) == 24


def test_a_column_of_words_in_parquet_is_named(tmp_path: Path, columns: Columns) -> None:
    path = tmp_path / "own.parquet"
    names = [name for name, _ in columns.columns.model_dump(exclude_none=True).values()]
    pq.write_table(pa.table({name: ["a", "b"] for name in names}), path)
    path.with_suffix(".toml").write_text(columns_text(columns), "utf-8")
    with pytest.raises(UserError, match="time_s: is string, not numbers"):
        read_recording(path)


def test_a_row_of_parquet_is_named(tmp_path: Path, recording: Recording, lining: Lining) -> None:
    path = tmp_path / "own.parquet"
    write_recording(path, recording, lining, 129.0)
    table = pq.read_table(path).to_pydict()
    table["torque_Nm"][7] = float("nan")
    pq.write_table(pa.table(table), path)
    assert read_recording(path).damaged.endswith("1 row left out, first: row 8 (torque_Nm is no number)")


def test_channels_of_mdf4(tmp_path: Path, recording: Recording, columns: Columns) -> None:
    asammdf = pytest.importorskip("asammdf")
    file = asammdf.MDF(version="4.10")
    units = {
        "pressure": ("pressure_bar", 1e-5),
        "torque": ("torque_Nm", 1.0),
        "temperature": ("disc_temperature_C", 1.0),
    }
    units["speed"] = ("speed_km_h", 3.6 * columns.brake.tyre_radius)
    file.append(
        [
            asammdf.Signal(getattr(recording, q) * factor, recording.time, name=name)
            for q, (name, factor) in units.items()
        ]
    )
    path = tmp_path / "own.mf4"
    file.save(path)
    path.with_suffix(".toml").write_text(columns_text(columns), "utf-8")
    for found, written in zip(read_recording(path).recording, recording, strict=True):
        np.testing.assert_allclose(found, written, rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("ending", [".csv", ".parquet", ".mf4"])
def test_a_column_of_sections_goes_with_its_rows(
    tmp_path: Path, recording: Recording, columns: Columns, ending: str
) -> None:
    """Texts in MDF4 are bytes and change now and then; a row that is left out takes its section along."""
    path = tmp_path / f"labelled{ending}"
    half = len(recording.time) // 2
    labels = np.where(np.arange(len(recording.time)) < half, "4.1 line", "9 fade")
    values = dict(
        zip(
            ("time_s", "pressure_bar", "torque_Nm", "speed_km_h", "disc_temperature_C"),
            recording,
            strict=True,
        )
    )
    values["pressure_bar"] = 1e-5 * values["pressure_bar"]
    values["speed_km_h"] = 3.6 * columns.brake.tyre_radius * values["speed_km_h"]
    if ending == ".mf4":
        asammdf = pytest.importorskip("asammdf")
        file, time = asammdf.MDF(version="4.10"), values.pop("time_s")
        file.append([asammdf.Signal(v, time, name=name) for name, v in values.items()])
        steps = np.array([b"4.1 line", b"9 fade"])
        file.append([asammdf.Signal(steps, time[[0, half]], name="step", encoding="utf-8")])
        file.save(path)
        lost = 0
    else:
        values["torque_Nm"] = values["torque_Nm"].copy()
        values["torque_Nm"][10] = np.nan
        table = pa.table({**values, "step": labels})
        pq.write_table(table, path) if ending == ".parquet" else pacsv.write_csv(table, path)
        lost = 1
    text = columns_text(columns).replace("[brake]", 'section = "step"\n\n[brake]', 1)
    path.with_suffix(".toml").write_text(text, "utf-8")
    read = read_recording(path)
    assert read.columns.columns.section == "step"
    assert columns_text(read.columns) == text.replace("\n\n\n", "\n\n").replace("]\n\nsection", "]\nsection")
    assert read.sections.tolist() == labels[lost:].tolist()


@pytest.mark.parametrize(
    ("spoil", "line"),
    [
        (lambda f: f.unlink(), "no such file"),
        (lambda f: f.with_suffix(".toml").unlink(), "no file of columns; give --columns"),
        (lambda f: f.write_text(f.read_text().replace("P_Line", "P")), "P_Line: no such column; the file"),
        (lambda f: in_columns(f, '"psi"', '"pound"'), "unit 'pound' of pressure unknown; one of bar, kPa"),
        (lambda f: in_columns(f, "piston_area", "piston"), "brake.piston: unknown key; did you mean"),
        (lambda f: f.write_text("\n".join(f.read_text().splitlines()[:40]) + "\n"), "only 39 whole rows"),
    ],
    ids=["no file", "no columns", "column", "unit", "brake", "short"],
)  # fmt: skip
def test_one_line_says_what_to_do(
    tmp_path: Path, recording: Recording, strange: Write, spoil, line: str
) -> None:
    path = strange(tmp_path, recording)
    spoil(path)
    with pytest.raises(UserError) as error:
        read_recording(path)
    assert line in str(error.value)
    assert "\n" not in str(error.value)


def in_columns(path: Path, old: str, new: str) -> None:
    beside = path.with_suffix(".toml")
    beside.write_text(beside.read_text("utf-8").replace(old, new), "utf-8")
