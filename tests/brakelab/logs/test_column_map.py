"""Maps of columns: exports of five programs, of one drive, give the same inputs; mistakes are one line.

The drive of tests/data/exports: 20 m/s, from 0.2 s on 4 m/s² by 40 bar, to the left with 0.1 rad/s.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from brakelab.logs.column_map import maps_columns, read_column_map
from brakelab.logs.log_quality import SignalQuality
from brakelab.logs.sample_block import SampleBlock
from brakelab.logs.signal_file import freshness_at_any_rate, read_signals
from ecu.contract.signals import ACCEL_X, INPUT
from ecu.errors import UserError

EXPORTS = Path(__file__).parents[2] / "data" / "exports"
RADIUS = 0.33


def wheels(pattern: str, corners: str = "FL FR RL RR") -> str:
    names = ("fl", "fr", "rl", "rr")
    return "".join(
        f'wheel_speed_{name} = {{ column = "{pattern.format(corner)}" }}\n'
        for name, corner in zip(names, corners.split(), strict=True)
    )


def pressures(front: str, rear: str) -> str:
    columns = (front, front, rear, rear)
    names = ("fl", "fr", "rl", "rr")
    return "".join(
        f'calliper_pressure_{name} = {{ column = "{column}" }}\n'
        for name, column in zip(names, columns, strict=True)
    )


HEAD = f"rolling_radius = {RADIUS}\n[inputs]\n"
MAPS = {
    "aim": HEAD + wheels("WheelSpd_{}") + pressures("BrakePress_F", "BrakePress_R")
    # AiM's axes point backwards and to the right, its gyro turns clockwise
    + 'accel_x = { column = "InlineAcc", factor = -1 }\n'
    'accel_y = { column = "LateralAcc", factor = -1 }\nyaw_rate = { column = "YawRate", factor = -1 }\n',
    "motec": HEAD + wheels("Wheel Speed {}") + pressures("Brake Pressure Front", "Brake Pressure Rear")
    + 'accel_x = { column = "G Force Long" }\naccel_y = { column = "G Force Lat" }\n'
    'yaw_rate = { column = "Gyro Yaw Velocity" }\nvehicle_speed = { column = "Ground Speed" }\n',
    "racecapture": HEAD + wheels("Whl{}") + pressures("BrakeF", "BrakeR")
    + 'accel_x = { column = "AccelX" }\naccel_y = { column = "AccelY" }\nyaw_rate = { column = "Yaw" }\n'
    'vehicle_speed = { column = "Speed", timeout = 0.4 }\n',
    "canape": HEAD + wheels("v_Rad_{}", "VL VR HL HR") + pressures("p_HZ", "p_HZ")
    + 'accel_x = { column = "a_laengs" }\naccel_y = { column = "a_quer" }\n'
    'yaw_rate = { column = "Gierrate" }\n',
    "inca": HEAD + wheels("nwheel_{}") + pressures("pbrk", "pbrk\\\\ESP:1")
    + 'accel_x = { column = "axs" }\naccel_y = { column = "ays" }\nyaw_rate = { column = "psip" }\n',
}  # fmt: skip


@pytest.fixture
def read(tmp_path: Path) -> Callable[..., SampleBlock]:
    def read_one(log: Path, text: str) -> SampleBlock:
        path = tmp_path / "map.toml"
        path.write_text(text, "utf-8")
        (block,) = read_signals(log, SignalQuality(), read_column_map(path))
        return block

    return read_one


@pytest.mark.parametrize("name", MAPS)
def test_exports_of_one_drive_give_the_same_inputs(name: str, read: Callable[..., SampleBlock]) -> None:
    block = read(EXPORTS / f"{name}.csv", MAPS[name])
    values = {place: block.values[:, column] for column, place in enumerate(block.places.tolist())}
    assert len(block.t) == 40
    np.testing.assert_array_equal(np.diff(block.t_ns), 20_000_000)
    k = np.arange(40)
    speed = 20.0 - 4.0 * np.maximum(0.0, 0.02 * k - 0.2)
    for corner, side in (("fl", -1), ("fr", 1), ("rl", -1), ("rr", 1)):
        wheel = (speed + side * 0.1 * 1.55 / 2) / RADIUS
        np.testing.assert_allclose(values[INPUT[f"wheel_speed_{corner}"]], wheel, atol=0.005)
        pressure = values[INPUT[f"calliper_pressure_{corner}"]]
        np.testing.assert_allclose(pressure, np.where(k >= 10, 40.0, 0.0), atol=0.01)
    np.testing.assert_allclose(values[ACCEL_X], np.where(k >= 10, -4.0, 0.0), atol=0.001)
    np.testing.assert_allclose(values[INPUT["accel_y"]], 0.1 * speed, atol=0.001)
    np.testing.assert_allclose(values[INPUT["yaw_rate"]], 0.1, atol=1e-4)


@pytest.mark.parametrize(
    ("name", "start"), [("aim", 0.0), ("motec", 12.5), ("racecapture", 48.21), ("canape", -0.2)]
)
def test_time_is_that_of_the_file_in_seconds(
    name: str, start: float, read: Callable[..., SampleBlock]
) -> None:
    assert read(EXPORTS / f"{name}.csv", MAPS[name]).t[0] == pytest.approx(start)


def test_a_slow_column_has_no_sample_between(read: Callable[..., SampleBlock]) -> None:
    block = read(EXPORTS / "racecapture.csv", MAPS["racecapture"])
    speed = block.values[:, block.places.tolist().index(INPUT["vehicle_speed"])]
    assert np.flatnonzero(np.isfinite(speed)).tolist() == list(range(0, 40, 5))


def test_parquet_gives_its_units_by_its_metadata(tmp_path: Path, read: Callable[..., SampleBlock]) -> None:
    fields = [pa.field("Time", pa.float64(), metadata={"unit": "ms"}), pa.field("ax", pa.float64())]
    table = pa.table([[0.0, 10.0, 20.0], [0.1, None, 0.3]], schema=pa.schema(fields))
    path = tmp_path / "drive.parquet"
    pq.write_table(table, path)
    block = read(path, '[inputs]\naccel_x = { column = "ax", unit = "g", factor = -1, offset = 0.1 }\n')
    assert block.t_ns.tolist() == [0, 10_000_000, 20_000_000]
    np.testing.assert_allclose(block.values[:, 0], [0.0, np.nan, -0.2 * 9.80665], atol=1e-12)


def test_parquet_has_its_units_behind_the_names(tmp_path: Path, read: Callable[..., SampleBlock]) -> None:
    """As a CSV file becomes one in pandas; a map names a column with its unit or without."""
    path = tmp_path / "drive.parquet"
    titles = ["v (mph)", "Time [ms]", "ax [g]"]
    pq.write_table(pa.table(dict(zip(titles, ([1.0, 2.0], [0.0, 10.0], [0.1, 0.3]), strict=True))), path)
    text = '[inputs]\naccel_x = { column = "ax [g]" }\nvehicle_speed = { column = "v" }\n'
    block = read(path, text)
    assert block.t_ns.tolist() == [0, 10_000_000]
    values = dict(zip(block.places.tolist(), block.values.T, strict=True))
    np.testing.assert_allclose(values[ACCEL_X], [0.980665, 2.941995])
    np.testing.assert_allclose(values[INPUT["vehicle_speed"]], [0.44704, 0.89408])


def test_channels_of_mdf4_are_mapped(tmp_path: Path, read: Callable[..., SampleBlock]) -> None:
    asammdf = pytest.importorskip("asammdf")
    t = np.arange(30) * 0.01
    mdf = asammdf.MDF(version="4.10")
    mdf.append([asammdf.Signal(np.full(30, 0.5), t, unit="g", name="ax\\XCP:1")])
    mdf.append([asammdf.Signal(np.full(30, 36.0), t, unit="km/h", name="v")])
    mdf.save(tmp_path / "drive.mf4")
    block = read(
        tmp_path / "drive.mf4", '[inputs]\naccel_x = { column = "ax" }\nvehicle_speed = { column = "v" }\n'
    )
    values = dict(zip(block.places.tolist(), block.values.T, strict=True))
    np.testing.assert_allclose(values[ACCEL_X], 0.5 * 9.80665)
    np.testing.assert_allclose(values[INPUT["vehicle_speed"]], 10.0)


WRONG = [
    ("[inputs]\naccel = { column = 'InlineAcc' }", "inputs.accel: no such input; did you mean accel_"),
    (
        "[inputs]\naccel_x = { column = 'InlineAc' }",
        "inputs.accel_x.column: no column 'InlineAc' in LOG; did you mean InlineAcc?",
    ),
    (
        "[inputs]\naccel_x = { column = 'BrakePress_F' }",
        'inputs.accel_x.unit: "bar" does not turn into m/s^2',
    ),
    ("[inputs]\nwheel_speed_fl = { column = 'WheelSpd_FL' }", "rolling_radius: missing"),
    ("time = 'Clock'\n[inputs]\naccel_x = { column = 'InlineAcc' }", "time: no column 'Clock' in LOG"),
    ("[inputs]\naccel_x = { column = 'InlineAcc', faktor = -1 }", "unknown key; did you mean factor?"),
    (
        "rolling_radius = 33\n[inputs]\naccel_x = { column = 'InlineAcc' }",
        "give a value below 2 m (found 33)",
    ),
    ("[inputs]\naccel_x = { column = 'InlineAcc', factor = nan }", "give a finite number"),
    (
        "[inputs]\naccel_x = { column = 'InlineAcc', timeout = 1e18 }",
        "inputs.accel_x.timeout: give a value of at most 60 s (found 1e+18)",
    ),
    (
        "time_unit = 'min'\n[inputs]\naccel_x = { column = 'InlineAcc' }",
        "t is in seconds, but the rows are 1.2 s apart",
    ),
]


@pytest.mark.parametrize(("text", "says"), WRONG, ids=[says[:30] for _, says in WRONG])
def test_a_mistake_is_one_line(text: str, says: str, read: Callable[..., SampleBlock]) -> None:
    log = EXPORTS / "aim.csv"
    with pytest.raises(UserError) as error:
        read(log, text)
    assert says.replace("LOG", str(log)) in str(error.value)


def test_a_column_without_a_unit_wants_one(tmp_path: Path, read: Callable[..., SampleBlock]) -> None:
    log = tmp_path / "drive.csv"
    log.write_text("time,ax\n0,1\n0.01,2\n0.02,3\n")
    with pytest.raises(UserError, match=r"inputs\.accel_x\.unit: missing; .* does not say the unit of ax"):
        read(log, '[inputs]\naccel_x = { column = "ax" }\n')
    assert read(log, '[inputs]\naccel_x = { column = "ax", unit = "m/s^2" }\n').values[:, 0].tolist() == [
        1,
        2,
        3,
    ]


def test_the_two_kinds_of_map_are_distinguished(tmp_path: Path) -> None:
    path = tmp_path / "map.toml"
    path.write_text(MAPS["aim"])
    assert maps_columns(path)
    assert not maps_columns(Path(__file__).parents[3] / "config/maps/mustang.toml")


def test_a_stated_time_out_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "map.toml"
    path.write_text(MAPS["racecapture"])
    freshness = freshness_at_any_rate(read_column_map(path).timeouts)
    assert freshness[INPUT["vehicle_speed"]]["patience_ns"] == 400_000_000
    assert freshness[ACCEL_X]["patience_ns"] == 300_000_000
