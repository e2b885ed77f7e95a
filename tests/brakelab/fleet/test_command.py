"""`brake-ecu fleet` as a user meets it, beside `brake-ecu replay --state` drive by drive."""

import re
import shutil
from pathlib import Path
from urllib.parse import unquote

import fsspec
import numpy as np
import pyarrow as pa
import pyarrow.dataset as ds
import pyarrow.parquet as pq
import pytest

from brakelab.bench.fleet_drives import write_drive
from brakelab.fleet import command
from brakelab.fleet.command import disorder, fleet
from brakelab.fleet.job import Job
from brakelab.fleet.output import brakes_file
from brakelab.fleet.task import replay_job
from brakelab.replay.command import replay
from brakelab.replay.source import load_source
from ecu.contract.records import LEARNED
from ecu.settings.config import load_config
from ecu.settings.resources import resource

SUV = resource("config/suv.toml")
CARS = {"one": 0, "two": 3}  # both are of the kind of config/suv.toml
DRIVES = (2, 10, 11)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fleet")
    for name, car in CARS.items():
        for drive in DRIVES:
            write_drive(car, drive, 15.0, folder / name / f"{drive}.log")
    return folder


def replayed(logs: list[Path], folder: Path) -> list[pa.Table]:
    """Tables of brakings of drives that `replay` takes one after the other, with its state store."""
    tables = []
    for log in logs:
        out = folder / f"{log.stem}.parquet"
        replay([log], SUV, None, None, folder / "state", out)
        tables.append(pq.read_table(folder / f"{log.stem}.brakes.parquet").replace_schema_metadata(None))
    return tables


def brakings(out: Path, vehicle: str, drive: int) -> pa.Table:
    table = pq.ParquetFile(brakes_file(out, vehicle, f"{drive}.log")).read()
    return table.drop_columns(["drive"]).replace_schema_metadata(None)


def test_of_a_fleet_without_one_good_drive_each_reason_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for vehicle in CARS:
        (tmp_path / "data" / vehicle).mkdir(parents=True)
        (tmp_path / "data" / vehicle / "1.log").write_bytes(b"\x00garbage" * 1000)
    assert fleet([f"{tmp_path}/data/*/*.log"], SUV, None, None, None, 1, tmp_path / "out") == 1
    printed = capsys.readouterr()
    assert printed.err.count("failed: ") == 2
    assert "0 of 2 drives of 2 vehicles" in printed.out
    assert "; 0 replayed now, 2 failed," in printed.out
    page = (tmp_path / "out" / "report.html").read_text("utf-8")
    assert "Drives that failed" in page
    assert '<td class="text sentence">line 1: no candump log' in page
    assert "No five vehicles have the same configuration: none is compared." in page


@pytest.mark.study
def test_a_fleet_is_its_drives_in_order(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mine, out = tmp_path / "data", tmp_path / "out"
    shutil.copytree(data, mine)
    whole = (mine / "two/10.log").read_bytes()
    (mine / "two/10.log").write_bytes(b"\x00garbage" * 1000)
    assert fleet([f"{mine}/*/*.log"], SUV, None, None, None, 2, out, rows=True) == 1
    printed = capsys.readouterr()
    assert printed.err.count("failed: ") == 1
    assert "two/10.log" in printed.err
    assert "5 of 6 drives of 2 vehicles" in printed.out
    for vehicle, drives in {"one": DRIVES, "two": (2, 11)}.items():
        expected = replayed([mine / vehicle / f"{drive}.log" for drive in drives], tmp_path / vehicle)
        for drive, table in zip(drives, expected, strict=True):
            assert brakings(out, vehicle, drive).equals(table), f"{vehicle}/{drive}"
            rows = pq.read_table(out / f"rows/vehicle={vehicle}/{drive}.log.parquet", partitioning=None)
            assert rows.equals(pq.read_table(tmp_path / vehicle / f"{drive}.parquet"))
    dataset = ds.dataset(out / "brakes", partitioning="hive").to_table()
    table = pq.read_table(out / "drives.parquet")
    assert len(dataset) == 4 * sum(table.column("brakings").drop_null().to_pylist())
    assert table.column("drive").to_pylist() == [f"{drive}.log" for drive in DRIVES] * 2
    page = (out / "report.html").read_text("utf-8")
    assert "Drives that failed" in page
    assert "<script src=" not in page
    linked = re.findall(r'<a href="(pages/[^"]*)">([^<]*)</a>', page)
    assert [name for _, name in linked] == [f"{drive}.log" for drive in (*DRIVES, 2, 11)]
    for address, name in linked:
        assert f"Braking report: {name}" in (out / unquote(address)).read_text("utf-8")

    (mine / "two/10.log").write_bytes(whole)
    assert fleet([f"{mine}/*/*.log"], SUV, None, None, None, 2, out, rows=True) == 0
    assert "6 of 6 drives of 2 vehicles" in (again := capsys.readouterr().out)
    assert "2 replayed now" in again  # the mended one, and the one after it that now knows more
    expected = replayed([mine / "two" / f"{drive}.log" for drive in DRIVES], tmp_path / "mended")
    for drive, table in zip(DRIVES, expected, strict=True):
        assert brakings(out, "two", drive).equals(table)


def job(log: str, learned: bytes = b"") -> Job:
    return Job("one", "2.log", (log,), load_config(SUV), load_source(None), learned, "", "")


def test_a_log_far_away_is_the_log_here(data: Path) -> None:
    fsspec.filesystem("memory").put(str(data / "one/2.log"), "/far/2.log")
    here, far = replay_job(job(str(data / "one/2.log"))), replay_job(job("memory://far/2.log"))
    tables = [pq.read_table(pa.BufferReader(one.file)) for one in (here, far)]
    assert tables[0].equals(tables[1])
    assert here.learned == far.learned
    assert far.summary["brakings"] >= 1
    assert (
        here.summary["notes"].replace(str(data / "one/2.log"), "memory://far/2.log") == far.summary["notes"]
    )


DAMAGES = {
    "empty.log": (b"", "line 1: the file is empty"),
    "garbage.log": (b"\xff\x00" * 5000, "garbage.log"),
    "frames.dat": (b"(1.0) can0 123#00\n", "let its name end in .log"),
    "cut.parquet": (b"PAR1\x15\x04\x15", "no readable Parquet file"),
    "gone.log": (None, "no such file"),
}


@pytest.mark.parametrize("name", DAMAGES)
def test_a_damaged_log_is_one_line_and_teaches_nothing(name: str, tmp_path: Path) -> None:
    content, line = DAMAGES[name]
    if content is not None:
        (tmp_path / name).write_bytes(content)
    before = np.zeros(1, LEARNED).tobytes()
    outcome = replay_job(job(str(tmp_path / name), before))
    assert line in outcome.summary["fault"]
    assert str(tmp_path / name) in outcome.summary["fault"]
    assert "\n" not in outcome.summary["fault"]
    assert outcome.learned == before
    assert outcome.file == b""


def test_a_log_that_starts_before_the_one_before_it_is_reported() -> None:
    def starts(*times: int | None) -> list[dict[str, object]]:
        hour = 3_600 * 10**9
        return [
            {"vehicle": "a", "drive": f"{k}.log", "start_time": t and t * hour} for k, t in enumerate(times)
        ]

    assert disorder(starts(500_000, None, 500_001, 500_002)) == []
    assert "2.log (2027-01-15 07:00:00 UTC) comes after 0.log" in disorder(starts(500_000, None, 499_999))[0]


def test_ctrl_c_before_the_first_drive_is_done_is_one_line(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(command, "run_fleet", interrupted)
    assert fleet([f"{data}/*/*.log"], SUV, None, None, None, 1, tmp_path / "out") == 130
    printed = capsys.readouterr()
    assert "interrupted: the same command goes on with the rest" in printed.out + printed.err
    assert list((tmp_path / "out").iterdir()) == []
