"""`brake-ecu replay` as a user meets it: drives of several logs, carried state, one line for each damage."""

import math
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from brakelab.replay.command import replay
from brakelab.replay.quality import Findings
from brakelab.replay.source import load_source
from brakelab.results.files import read_result
from brakelab.rig.play.play_log import contract_frames
from ecu.contract.signals import CORNERS
from ecu.errors import UserError
from ecu.recording.recorder import candump_lines
from ecu.recording.store import open_store, restore
from ecu.settings.config import load_config, new_params, store_key
from ecu.settings.resources import resource

AT_REST = (
    *("accel_y", "yaw_rate", "steering_angle", "abs_active", "esp_active", "reverse", "accelerator_position"),
    *("pedal_position", "pedal_pressed", "decel_demand", "decel_demand_valid"),
    *(f"motor_torque_{corner}" for corner in CORNERS),
)
SUV = resource("config/suv.toml")
START_NS = 1_600_000_000_000_000_000


def stop(path: Path, t0: float = 0.0, brakes: float = 4.0) -> Path:
    """2 s of rolling, 4 s of braking, 2 s of rolling, as a 10 ms signal file."""
    t = t0 + np.arange(800) * 0.01
    since = t - t0 - 2.0
    on = (since > 0) & (since < 4.0)
    speed = 30.0 - brakes * np.clip(since, 0.0, 4.0)
    columns = {"t": t, "accel_x": -brakes * on} | dict.fromkeys(AT_REST, np.zeros(len(t)))
    for corner in CORNERS:
        columns[f"wheel_speed_{corner}"] = speed / 0.365 * (1 - 0.015 * on)
        columns[f"calliper_pressure_{corner}"] = 9.0 * brakes * on
    pq.write_table(pa.table(columns), path)
    return path


@pytest.mark.parametrize(
    ("stood", "excess", "sigma"),
    [(None, 100.0, 58.0), (0.0, 100.0, 58.0), (1.0, 35.0, 20.0), (12.0, 0.0, 0.5)],
)
def test_discs_have_cooled_while_the_car_stood(tmp_path: Path, stood, excess, sigma) -> None:
    """Unknown: 0 to 200 K above the air; by half of δ0 less in an hour, nothing after a night."""
    out = tmp_path / "result.parquet"
    replay([stop(tmp_path / "drive.parquet")], SUV, None, None, None, out, stood=stood)
    params, drive = new_params(load_config(SUV))[0], read_result(out).columns
    if stood == 1.0:
        left = np.exp(-0.5 * 3600.0 * params["disc_cooling"][0])
        excess, sigma = 100.0 * left, 58.0 * left
    air = 15.0  # K, σ of an air that no sensor measures
    assert drive["disc_temperature_fl"][5] - params["ambient_temperature"] == pytest.approx(excess, abs=2.0)
    assert drive["sigma_disc_temperature_fl"][5] == pytest.approx(np.hypot(sigma, air), abs=1.0)


def frames_of(path: Path, log: Path) -> Path:
    """The signal file as candump text of contract frames."""
    text = b""
    for frames in contract_frames(path, load_source(None), Findings(path)):
        frames["stamp_ns"] += START_NS
        text += candump_lines(frames, "can0")
    log.write_bytes(text)
    return log


def run(
    logs: list[Path], out: Path, state: Path | None = None, map: Path | None = None
) -> dict[str, np.ndarray]:
    replay(logs, SUV, map, None, state, out)
    return read_result(out).columns


def test_a_10_ms_input_gives_its_own_stamps_back(tmp_path: Path) -> None:
    path = stop(tmp_path / "stop.parquet", t0=0.07)
    columns = run([path], tmp_path / "out.parquet")
    np.testing.assert_array_equal(columns["t"], pq.read_table(path).column("t").to_numpy())


def test_frames_and_signals_of_one_drive_tell_the_same(tmp_path: Path) -> None:
    signals = stop(tmp_path / "stop.parquet")
    log = frames_of(signals, tmp_path / "stop.log")
    a, b = run([signals], tmp_path / "a.parquet"), run([log], tmp_path / "b.parquet")
    np.testing.assert_allclose(b["t"], a["t"], atol=1e-12)
    np.testing.assert_allclose(b["vehicle_speed"], a["vehicle_speed"], atol=0.02)
    result = read_result(tmp_path / "b.parquet")
    assert result.metadata["start_time_ns"] == str(START_NS)
    assert '"checksum_errors": 0' in result.metadata["quality"]


@pytest.mark.parametrize("t0", [-5.0, -3.0, -1e6, -1e8], ids=str)
def test_time_before_zero_is_time_like_any_other(tmp_path: Path, t0: float) -> None:
    """CANape and others count from the trigger; the last row is the last sample, not t = 0."""
    path = tmp_path / "stop.csv"
    table = pq.read_table(stop(tmp_path / "stop.parquet", t0)).slice(0, 200)
    columns = {name: table.column(name).to_pylist() for name in table.column_names}
    rows = [",".join(f"{value:.2f}" for value in row) for row in zip(*columns.values(), strict=True)]
    path.write_text("\n".join([",".join(columns), *rows]) + "\n")
    t = run([path], tmp_path / "out.parquet")["t"]
    assert len(t) == 200
    assert (t[0], t[-1]) == pytest.approx((t0, t0 + 1.99), abs=1e-6)


@pytest.mark.parametrize(
    ("first", "stated"), [(0.0, "1700000000000000000"), (7.0, "1700000000000000000"), (0.0, "")]
)
def test_the_date_of_a_signal_file_is_kept(tmp_path: Path, first: float, stated: str) -> None:
    """`start_time_ns` is the date of the first row; a file without a date gives none."""
    path = stop(tmp_path / "stop.parquet", first)
    if stated:
        table = pq.read_table(path).replace_schema_metadata({"start_time_ns": stated})
        pq.write_table(table, path)
    run([path], tmp_path / "out.parquet")
    metadata = read_result(tmp_path / "out.parquet").metadata
    assert metadata.get("start_time_ns", "") == stated


def test_unix_time_in_t_is_a_date(tmp_path: Path) -> None:
    run([stop(tmp_path / "stop.parquet", 1.7e9)], tmp_path / "out.parquet")
    assert read_result(tmp_path / "out.parquet").metadata["start_time_ns"] == "1700000000000000000"


def test_several_logs_are_one_drive(tmp_path: Path) -> None:
    first, second = stop(tmp_path / "1.parquet", 3.0), stop(tmp_path / "2.parquet", 50.0)
    log = frames_of(second, tmp_path / "3.log")
    columns = run([first, second, log], tmp_path / "out.parquet")
    np.testing.assert_allclose(columns["t"], 3.0 + np.arange(2400) * 0.01, atol=1e-9)
    assert columns["mu_b_fl"][790] != columns["mu_b_fl"][0]
    for seam in (800, 1600):
        assert columns["mu_b_fl"][seam] == columns["mu_b_fl"][seam - 1]
    brakes = read_result(tmp_path / "out.brakes.parquet").columns
    assert list(brakes["brake"][::4]) == [0, 1, 2]
    assert brakes["decel_predicted"][4] != brakes["decel_predicted"][0]


def test_state_is_taken_and_left_behind(tmp_path: Path) -> None:
    path, state = stop(tmp_path / "stop.parquet"), tmp_path / "state"
    first = run([path], tmp_path / "out.parquet", state)
    config = load_config(SUV)
    with closing(open_store(state)) as store:
        found = restore(store, store_key(config), new_params(config)[0]["mu_nominal"])
    assert found is not None
    assert found[1]["mu_b"][0][0] == first["mu_b_fl"][-1]
    assert run([path], tmp_path / "out.parquet", state)["mu_b_fl"][0] == first["mu_b_fl"][-1]
    assert run([path], tmp_path / "out.parquet")["mu_b_fl"][0] == first["mu_b_fl"][0]


def damage(text: bytes, change: Callable[[int, bytes], bytes]) -> bytes:
    return b"".join(change(i, line) for i, line in enumerate(text.splitlines(keepends=True), 1))


def flip(i: int, line: bytes) -> bytes:
    if i % 20:
        return line
    place = line.index(b"#") + 5
    return line[:place] + (b"1" if line[place : place + 1] != b"1" else b"2") + line[place + 1 :]


def test_crc_errors_are_counted_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = frames_of(stop(tmp_path / "stop.parquet"), tmp_path / "stop.log")
    log.write_bytes(damage(log.read_bytes(), flip))
    run([log], tmp_path / "out.parquet")
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "CRC errors" in line]
    assert line.startswith(f"{log}: ")
    assert " % of " in line


def test_a_damaged_and_a_cut_line_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = frames_of(stop(tmp_path / "stop.parquet"), tmp_path / "stop.log")
    lines = log.read_bytes().splitlines(keepends=True)
    lines[30] = b"(16000000"
    log.write_bytes(b"".join(lines)[:-6])
    run([log], tmp_path / "out.parquet")
    printed = capsys.readouterr().err
    assert f"{log}: line 31: 1 damaged lines skipped" in printed
    assert f"{log}: line {len(lines) - 1}: the last line is cut off" in printed


def test_unknown_columns_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "stop.csv"
    path.write_text("t,accel_x,speed,gear\n0,1,2,3\n0.01,1,2,3\n")
    run([path], tmp_path / "out.parquet")
    assert f"{path}: columns not used: speed, gear\n" in capsys.readouterr().err


FOREIGN = "".join(f"(1600000000.000{i}00) can0 7A1#0102030405060708\n" for i in range(3))
REFUSED: dict[str, tuple[str, str | None, str]] = {
    "log of a foreign bus": ("drive.log", FOREIGN, "3 frames on can0: no identifier that is expected ("),
    "frames of ours without a right CRC": (
        "drive.log",
        "(1600000000.000100) can0 070#0000000000000000\n",
        "1 frames on can0: no intact frame (1 rejected) that is expected (",
    ),
    "empty log": ("drive.log", "", "line 1: the file is empty"),
    "another format by content": ("drive.log", "date Mon\nbase hex\n", "line 1: this is a Vector ASC log"),
    "another format by name": ("drive.dat", "hello", "unknown kind of log .dat; replay reads candump .log"),
    "no suffix": ("drive", "hello", "unknown kind of log (no suffix)"),
    "NaN as time": ("drive.csv", "t,accel_x\nnan,1\n", "line 2, t: time is missing"),
    "infinite sample": ("drive.csv", "t,accel_x\n0,1\n0.01,inf\n", "line 3, accel_x: infinite value"),
    "folder without a recording": ("folder", None, "no recording here"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_log_that_cannot_be_replayed_gives_one_line_and_no_result(tmp_path: Path, case: str) -> None:
    name, content, line = REFUSED[case]
    path = tmp_path / "logs" / name
    path.parent.mkdir(exist_ok=True)
    if content is None:
        path.mkdir()
    else:
        path.write_text(content)
    with pytest.raises(UserError) as error:
        run([path], tmp_path / "out.parquet")
    assert str(error.value).startswith(f"{path}: {line}")
    assert not list(tmp_path.glob("*.parquet"))


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"observer": "best"}, "--observer: best: not known; take joint"),
        ({"out": Path("result.csv")}, "--out: result.csv: results are Parquet, MDF4 or MCAP"),
        ({"logs": [Path("no.log")]}, "no.log: no such file"),
        ({"logs": [Path(__file__).parent], "stood": 8.0}, "--stood: 8: a recording has the temperatures"),
        ({"cycles": Path("kept"), "stood": 0.0}, "--stood: 0: a recording has the temperatures"),
    ],
)
def test_an_argument_that_is_wrong_gives_one_line(
    tmp_path: Path, change: dict[str, object], line: str
) -> None:
    arguments = {
        "logs": [stop(tmp_path / "stop.parquet")],
        "config": SUV,
        "map": None,
        "observer": "observer2",
        "state": None,
        "out": tmp_path / "out.parquet",
    }
    with pytest.raises(UserError) as error:
        replay(**(arguments | change))  # type: ignore[arg-type]
    assert str(error.value).startswith(line)


def test_null_and_nan_are_no_sample(tmp_path: Path) -> None:
    path = stop(tmp_path / "stop.parquet")
    table = pq.read_table(path)
    gaps = [None if k % 2 else math.nan for k in range(50)]
    accel = table.column("accel_x").to_pylist()[:750] + gaps
    pq.write_table(table.set_column(1, "accel_x", pa.array(accel, pa.float64())), path)
    columns = run([path], tmp_path / "out.parquet")
    lost = columns["active_faults"].astype(int) & 2
    assert not lost[700:755].any()
    assert lost[770:].all()


def test_a_log_is_never_overwritten(tmp_path: Path) -> None:
    (tmp_path / "more").mkdir()
    log = stop(tmp_path / "drive.parquet")
    brakes = stop(tmp_path / "r.brakes.parquet")
    link = tmp_path / "link.parquet"
    link.symlink_to(log)
    before = log.read_bytes()
    for source, out in (
        (log, log),
        (log, tmp_path / "more" / ".." / "drive.parquet"),
        (log, link),
        (link, log),
        (brakes, tmp_path / "r.parquet"),
    ):
        with pytest.raises(UserError) as error:
            run([source], out)
        assert str(error.value).startswith(f"--out: {out}: would overwrite {source}")
    assert log.read_bytes() == brakes.read_bytes() == before


def test_an_out_that_is_a_folder_is_named_as_it_was_given(tmp_path: Path) -> None:
    out = tmp_path / "d.parquet"
    out.mkdir()
    with pytest.raises(UserError) as error:
        run([stop(tmp_path / "stop.parquet")], out)
    assert str(error.value) == f"--out: {out}: is a folder; give the name of a file, or remove the folder"


def test_the_folder_of_the_result_is_made(tmp_path: Path) -> None:
    out = tmp_path / "a" / "b" / "r.parquet"
    run([stop(tmp_path / "stop.parquet")], out)
    assert out.is_file()


def test_a_map_beside_decoded_signals_is_reported_as_of_no_use(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, map = stop(tmp_path / "stop.parquet"), resource("config/maps/mustang.toml")
    run([path], tmp_path / "out.parquet", map=map)
    assert f"{map}: not used for {path}, whose signals are decoded already;" in capsys.readouterr().err
