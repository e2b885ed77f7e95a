import re
from collections.abc import Callable
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from brakelab.report.command import report
from brakelab.report.drive import DriveResult
from brakelab.report.look import DARK
from brakelab.report.summary import facts
from brakelab.simulation.closed_loop import START_NS
from ecu.contract.signals import CORNERS
from ecu.errors import UserError

from .conftest import write_drive

Files = dict[str, Path]


def change(path: Path, edit: Callable[[pa.Table], pa.Table]) -> None:
    pq.write_table(edit(pq.read_table(path)), path)


def column(name: str, values: object) -> Callable[[pa.Table], pa.Table]:
    def edit(table: pa.Table) -> pa.Table:
        return table.set_column(table.column_names.index(name), name, pa.array(values))

    return edit


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


def spoil(path: Path) -> None:
    """Write zeros over the pages, before what says where they are."""
    size = path.stat().st_size
    with path.open("r+b") as file:
        file.seek(4)
        file.write(bytes(size // 2))


def written(files: Files, truth: bool = True, timing: bool = True) -> str:
    out = files["result"].with_name("new") / "report.html"
    report(files["result"], files["truth"] if truth else None, out, files["timing"] if timing else None)
    return out.read_text("utf-8")


def visible(page: str) -> str:
    body = re.sub(r"<(script|style).*?</\1>", "", page, flags=re.DOTALL)
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", body))


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The page on the whole drive, as written."""
    return written(write_drive(tmp_path_factory.mktemp("drive")))


@pytest.fixture(scope="module")
def page(source: str) -> str:
    return visible(source)


@pytest.mark.parametrize(
    "text",
    [
        "Vehicle SUV",
        "Configuration 0123456789ab",
        "1 June 2024, 11:06:40 UTC",
        "4.00 4.16 0.380 ± 0.005 0.495 ± 0.005 80 80 600",
        "Missed periods 2 of 6000",
        "Achieved over demanded \N{MINUS SIGN}3.0 %",
        "Prediction error 4.0 % mean of 2; worst 4.0 %, bias +4.0 %",
        "2 brake applications: off by 4.0 % in the median, 4.0 % at worst, bias +4.0 %.",
        "On the mean 4.0 %; beside it the configured friction, never learning 10.0 %",
        "1 4.00 4.16 0.08 4.40 +4.0 0.450 ± 0.055 0.450 ± 0.055",
        "2 6.00 6.24 0.12 6.60 +4.0 0.380 ± 0.010 0.495 ± 0.010",
        "3 8.00 8.32 0.16 8.80 – 0.380 ± 0.010 0.495 ± 0.010 driven against the brakes",
        "request lost 50.01",
        "Data marked 1 3 frames dropped by the kernel; Imu",
        "stops.log 6000 90000 0.20 30000 300 3 frames dropped by the kernel",
        "accel_x 100.0 100 0.02 0 0 0 0 \N{MINUS SIGN}4 1 m/s²",
        "Imu 072 6000 100.0 100 0 0 0 0 7",
        "Never received: yaw_rate.",
        "lateness",
    ],
)
def test_page_says(page: str, text: str) -> None:
    assert text in page


def test_page_is_small_and_names_no_address(source: str) -> None:
    assert len(source.encode()) < 3_000_000
    assert not re.search(r"<(script|link|img|iframe)[^>]+(src|href)=", source)
    assert "default-src 'none'" in source


@pytest.mark.study
def test_a_quarter_of_an_hour_with_45_brakings_stays_small(drive_files: Files) -> None:
    def longer(table: pa.Table) -> pa.Table:
        many = pa.concat_tables([table] * 15)
        return column("t", np.arange(many.num_rows) * 0.01)(many)

    change(drive_files["result"], longer)
    change(drive_files["truth"], longer)
    drive_files["brakes"].unlink()
    page = written(drive_files)
    assert page.count('class="spark"') == 45
    assert len(page.encode()) < 3_000_000
    assert "the smallest and the largest value" in page


@pytest.mark.usefixtures("undrawn")
def test_without_truth_and_timing_their_tables_are_absent(drive_files: Files) -> None:
    text = visible(written(drive_files, truth=False, timing=False))
    assert "nRMSE" not in text
    assert "Loop timing" not in text


@pytest.mark.usefixtures("undrawn")
def test_a_result_without_metadata_has_no_data_quality(drive_files: Files) -> None:
    change(drive_files["result"], lambda table: table.replace_schema_metadata({}))
    assert "Data quality" not in visible(written(drive_files))


@pytest.mark.usefixtures("undrawn")
def test_columns_of_the_contract_alone_are_enough(drive_files: Files) -> None:
    names = ["t", "vehicle_speed", *(f"mu_b_{corner}" for corner in ("fl", "fr", "rl", "rr"))]
    change(drive_files["result"], lambda table: table.select(names))
    drive_files["brakes"].unlink()
    assert "No brake application was found" in visible(written(drive_files))


@pytest.mark.parametrize("rows", [400, 6000])
def test_a_drive_without_brakings_draws_nothing_empty(
    drive_files: Files, caplog: pytest.LogCaptureFixture, rows: int
) -> None:
    def still(table: pa.Table) -> pa.Table:
        names = [name for name in table.column_names if name.split("_")[0] in {"braking", "decel", "k"}]
        return table.drop_columns(names).slice(0, rows)

    change(drive_files["result"], still)
    drive_files["brakes"].unlink()
    page = written(drive_files, truth=False, timing=False)
    assert "No brake application was found" in visible(page)
    assert "brakings.csv" not in page
    assert caplog.records == []


def test_brakings_as_csv_are_in_the_page(source: str) -> None:
    address = re.search(r'<a download="stops\.brakings\.csv" href="data:text/csv[^,]*,([^"]*)"', source)
    assert address
    assert len(unquote(address[1]).splitlines()) == 1 + 3


@pytest.mark.usefixtures("undrawn")
def test_names_from_outside_are_text(drive_files: Files) -> None:
    change(
        drive_files["result"], lambda table: table.replace_schema_metadata({"vehicle": "<script>alert(1)"})
    )
    assert "&lt;script&gt;alert(1)" in written(drive_files)


@pytest.mark.usefixtures("undrawn")
def test_truth_is_shifted_by_the_dates_of_the_first_rows(drive_files: Files, page: str) -> None:
    date = {"start_time_ns": "1717240000000000000"}

    def start_earlier(table: pa.Table) -> pa.Table:
        moved = pa.array(table.column("t").to_numpy() + 1.0)
        return table.set_column(0, "t", moved).replace_schema_metadata(date)

    change(drive_files["truth"], start_earlier)
    row = re.compile(r"front (\S+) (\S+) \d+ \S+ rear")
    assert row.search(visible(written(drive_files))).groups() == row.search(page).groups()  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("file", "damage", "line"),
    [
        ("result", lambda path: path.unlink(), r"stops\.parquet: no such file: give a RESULT"),
        ("result", cut, r"stops\.parquet: not a readable Parquet file"),
        ("result", lambda path: path.write_bytes(b""), r"stops\.parquet: not a readable Parquet file"),
        ("result", lambda path: change(path, lambda t: t.drop_columns("mu_b_rl")), r"mu_b_rl: missing"),
        ("result", lambda path: change(path, lambda t: t.slice(0, 0)), r"0 rows"),
        ("result", lambda path: change(path, column("t", np.zeros(6000))), r"column t, row 1: time must"),
        ("result", lambda path: change(path, column("mu_b_fl", ["x"] * 6000)), r"mu_b_fl: holds string"),
        ("result", spoil, r"stops\.parquet: not a readable Parquet file"),
        ("truth", lambda path: path.unlink(), r"stops\.truth\.parquet: no such file: give the NAME"),
        ("truth", lambda path: change(path, lambda t: t.drop_columns("mu_b_fr")), r"column mu_b_fr: missing"),
        ("truth", lambda path: change(path, column("t", 1e4 + np.arange(6000.0))), r"the truth of the same"),
        ("brakes", cut, r"stops\.brakes\.parquet: not a readable Parquet file"),
        ("brakes", lambda path: change(path, lambda t: t.drop_columns("v_in")), r"column v_in: missing"),
        ("brakes", lambda path: change(path, lambda t: t.slice(0, 3)), r"brake 0: needs one row each for fl"),
        ("timing", lambda path: (path / "recording.json").unlink(), r"no recording here"),
        ("timing", lambda path: (path / "cycles.bin").write_bytes(b"torn"), r"no cycle in it"),
    ],
)  # fmt: skip
def test_damage_gives_one_line(
    drive_files: Files, file: str, damage: Callable[[Path], None], line: str
) -> None:
    damage(drive_files[file])
    with pytest.raises(UserError, match=line) as caught:
        written(drive_files)
    assert "\n" not in str(caught.value)


@pytest.mark.usefixtures("undrawn")
def test_place_that_cannot_be_written(drive_files: Files) -> None:
    with pytest.raises(UserError, match="choose another --out"):
        report(drive_files["result"], None, drive_files["result"] / "report.html")


@pytest.mark.parametrize(
    ("start_ns", "says"),
    [(START_NS + 8_000_000, "simulated"), (START_NS - 1, "14 November 2023, 22:13:19 UTC"), (None, None)],
)
def test_a_simulated_drive_has_no_date(start_ns: int | None, says: str | None) -> None:
    metadata = {} if start_ns is None else {"start_time_ns": str(start_ns)}
    assert dict(facts(DriveResult(np.arange(2.0), {}, metadata))).get("Start") == says


def test_a_page_has_the_name_of_one(drive_files: Files, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"^--out: .*r\.pdf: the report is a web page; .* end in \.html"):
        report(drive_files["result"], None, tmp_path / "r.pdf")


def test_dark_colours_can_be_taken_back() -> None:
    assert len(set(DARK.values())) == len(DARK)
    assert not set(DARK) & set(DARK.values())


@pytest.mark.parametrize("name", ["result", "truth"])
def test_an_input_is_never_overwritten(drive_files: Files, name: str) -> None:
    before = drive_files[name].read_bytes()
    with pytest.raises(UserError, match=f"^--out: .*would overwrite {drive_files[name]}"):
        report(drive_files["result"], drive_files["truth"], drive_files[name])
    assert drive_files[name].read_bytes() == before


@pytest.mark.usefixtures("undrawn")
def test_friction_that_nobody_knows_is_one_dash(drive_files: Files) -> None:
    for corner in ("fl", "fr"):
        unknown = np.full(pq.read_table(drive_files["result"]).num_rows, np.nan)
        change(drive_files["result"], column(f"mu_b_{corner}", unknown))
    shown = visible(written(drive_files, truth=False, timing=False))
    assert "Friction front, ±2σ – nothing is known" in shown
    assert "Friction rear, ±2σ 0." in shown


@pytest.mark.study
def test_wheel_torque_in_the_log_stands_for_the_truth(drive_files: Files) -> None:
    def measured(table: pa.Table) -> pa.Table:
        for corner in CORNERS:
            values = -60.0 * 0.4 * table[f"calliper_pressure_{corner}"].to_numpy()
            table = table.append_column(f"wheel_torque_y_{corner}", pa.array(values))
        return table

    change(drive_files["result"], measured)
    text = visible(written(drive_files, truth=False, timing=False))
    assert "Friction against measured wheel torque" in text
    assert "Hold-off pressure" in text
