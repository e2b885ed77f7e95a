"""Result files: columns, units, nulls, provenance; complete or not there at all; Parquet and MDF4 alike."""

import json
import sys
from datetime import timedelta
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from brakelab.replay.engine import N_ROW
from brakelab.report.drive import read_drive
from brakelab.results.files import ROW_COLUMNS, ResultWriter, brakes_path, read_result
from ecu.contract.records import RecordArray
from ecu.contract.signals import OUTPUT
from ecu.errors import UserError
from ecu.settings.config import load_config, new_params

# The contract's list, written out: it must not follow a change of the table of signals.
FOUR = (
    "slip wheel_force_x wheel_force_z mu_b sigma_mu_b mode brake_torque pressure_demand motor_demand"
    " disc_temperature pad_wear pad_wear_mass"
)
CONTRACT = ["t", "vehicle_speed", "k_f", "mode"] + [
    f"{name}_{corner}" for name in FOUR.split() for corner in ("fl", "fr", "rl", "rr")
]
BRAKES = (
    "brake corner t_start duration v_in v_end decel_mean decel_predicted mu_b_mean mu_b_mean_time"
    " brake_torque_mean brake_energy disc_temperature_in disc_temperature_mean pad_wear_mass emission_factor"
)


@pytest.fixture
def params() -> RecordArray:
    return new_params(load_config(Path(__file__).parents[3] / "config" / "suv.toml"))


def rows(n: int) -> np.ndarray:
    values = np.full((n, N_ROW), np.nan)
    values[:, OUTPUT["braking"]] = 0.0
    values[:, OUTPUT["mode"]] = 2.0
    values[:, OUTPUT["active_faults"]] = 2.0**31 + 1
    values[:, OUTPUT["vehicle_speed"]] = np.linspace(1 / 3, 7, n)
    return values


def test_columns_units_nulls_and_provenance(tmp_path: Path, params: RecordArray) -> None:
    path = tmp_path / "drive.parquet"
    with ResultWriter(path, params) as writer:
        writer.provenance = {"version": "0.1.0", "start_time_ns": "7", "inputs": [{"name": "a.log"}]}
        writer.write(np.arange(5) * 0.01, rows(5))
        writer.write(np.arange(5, 8) * 0.01, rows(3))
        writer.quality = [{"frames": 3}]
    table = pq.read_table(path)
    assert set(CONTRACT) <= set(table.column_names)
    assert table.column_names == ["t", *ROW_COLUMNS]
    assert table.column("motor_demand_fl").null_count == 8
    assert table.schema.field("mode_fl").type == pa.int8()
    assert table.column("active_faults").to_pylist()[0] == 2**31 + 1
    units = {name: table.schema.field(name).metadata[b"unit"].decode() for name in table.column_names}
    expected = {
        "t": "s",
        "vehicle_speed": "m/s",
        "pressure_demand_fl": "bar",
        "pad_wear_mass_rr": "g",
        "mode": "-",
    }
    assert {name: units[name] for name in expected} == expected
    assert table.schema.metadata[b"start_time_ns"] == b"7"
    assert pq.ParquetFile(path).metadata.row_group(0).column(0).compression == "ZSTD"

    result = read_result(path)
    np.testing.assert_array_equal(result.columns["vehicle_speed"], [*rows(5)[:, 0], *rows(3)[:, 0]])
    assert np.isnan(result.columns["mu_b_fl"]).all()
    assert result.units["brake_torque_fl"] == "N m"
    assert result.metadata["quality"] == '[{"frames": 3}]'


def test_brakes_stand_beside_the_result(tmp_path: Path, params: RecordArray) -> None:
    path = tmp_path / "drive.parquet"
    values = rows(100)
    values[20:70, OUTPUT["braking"]] = 1.0
    with ResultWriter(path, params) as writer:
        writer.provenance = {"vehicle": "suv"}
        writer.write(np.arange(100) * 0.01, values)
    brakes = read_result(tmp_path / "drive.brakes.parquet")
    assert brakes_path(path).name == "drive.brakes.parquet"
    assert list(brakes.columns)[: len(BRAKES.split())] == BRAKES.split()
    assert list(brakes.columns["corner"]) == ["fl", "fr", "rl", "rr"]
    np.testing.assert_allclose(brakes.columns["t_start"], 0.2)
    assert brakes.units["brake_energy"] == "J"
    assert brakes.metadata["vehicle"] == "suv"


def test_a_run_that_fails_leaves_the_old_result_alone(tmp_path: Path, params: RecordArray) -> None:
    path = tmp_path / "drive.parquet"
    path.write_text("the result of yesterday")

    def fail() -> None:
        with ResultWriter(path, params) as writer:
            writer.write(np.arange(5) * 0.01, rows(5))
            raise UserError("drive.log", "line 7", "damaged")

    with pytest.raises(UserError):
        fail()
    assert [file.name for file in tmp_path.iterdir()] == ["drive.parquet"]
    assert path.read_text() == "the result of yesterday"


@pytest.mark.parametrize("blocks", [1, 2])
def test_rows_that_cannot_be_written_leave_the_old_result_alone(
    tmp_path: Path, params: RecordArray, monkeypatch: pytest.MonkeyPatch, blocks: int
) -> None:
    """Rows are encoded beside the run: it hears of a full disk with the next ones, or at its end."""
    path = tmp_path / "drive.parquet"
    path.write_text("the result of yesterday")

    def full(*_: object) -> None:
        raise OSError(27, "Error writing bytes to file. Detail: [errno 27] File too large")

    monkeypatch.setattr(pq.ParquetWriter, "write_table", full)

    def fail() -> None:
        with ResultWriter(path, params) as writer:
            for _ in range(blocks):
                writer.write(np.arange(5) * 0.01, rows(5))

    with pytest.raises(
        UserError, match=r"drive\.parquet: cannot be written \(File too large\); choose another"
    ):
        fail()
    assert [file.name for file in tmp_path.iterdir()] == ["drive.parquet"]
    assert path.read_text() == "the result of yesterday"


@pytest.mark.parametrize("content", [None, "no Parquet"])
def test_a_result_that_cannot_be_read_gives_one_line(tmp_path: Path, content: str | None) -> None:
    path = tmp_path / "drive.parquet"
    if content:
        path.write_text(content)
    with pytest.raises(UserError) as error:
        read_result(path)
    assert str(error.value).startswith(str(path))


def test_a_folder_is_no_result(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="is a folder: give a result"):
        read_result(tmp_path)


def test_mdf4_holds_the_same_numbers_units_and_provenance(tmp_path: Path, params: RecordArray) -> None:
    asammdf = pytest.importorskip("asammdf")
    values = rows(100)
    values[20:70, OUTPUT["braking"]] = 1.0
    values[5, OUTPUT["mode"]] = np.nan
    provenance = {"version": "0.1.0", "start_time_ns": "1600000000123456789", "inputs": [{"name": "<&.log"}]}
    for name in ("drive.parquet", "drive.mf4"):
        with ResultWriter(tmp_path / name, params) as writer:
            writer.provenance = dict(provenance)
            writer.write(2.0 + np.arange(60) * 0.01, values[:60])
            writer.write(2.6 + np.arange(40) * 0.01, values[60:])
            writer.quality = [{"frames": 3}]
    names = {"drive.brakes.parquet", "drive.mf4", "drive.parquet"}
    assert {file.name for file in tmp_path.iterdir()} == names
    with asammdf.MDF(tmp_path / "drive.mf4") as mdf:
        for group, name in enumerate(("drive.parquet", "drive.brakes.parquet")):
            result = read_result(tmp_path / name)
            channels = mdf.groups[group].channels
            assert {channel.name for channel in channels} == set(result.columns)
            for index, channel in enumerate(channels):
                signal = mdf.get(group=group, index=index, ignore_invalidation_bits=True)
                assert channel.unit == result.units[channel.name]
                if signal.samples.dtype.kind == "S":
                    found = [text.decode() for text in signal.samples]
                    assert found == list(result.columns[channel.name])
                    continue
                found = signal.samples.astype(float)
                if signal.invalidation_bits is not None:
                    found[np.asarray(signal.invalidation_bits)] = np.nan
                np.testing.assert_array_equal(found, result.columns[channel.name], channel.name)
        stated = mdf.header._common_properties
        assert json.loads(stated["inputs"]) == provenance["inputs"]
        assert stated["quality"] == '[{"frames": 3}]'
        assert mdf.header.abs_time == 1600000000123456789 - 2 * 10**9  # where t = 0
        assert mdf.start_time.utcoffset() == timedelta(0)


def test_mdf4_without_asammdf_names_the_remedy_before_the_run(
    tmp_path: Path, params: RecordArray, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "asammdf", None)
    with pytest.raises(UserError, match=r"drive\.mf4: MDF4 needs asammdf: pip install asammdf"):
        ResultWriter(tmp_path / "drive.mf4", params)


def test_our_own_commands_read_parquet(tmp_path: Path) -> None:
    for read in (read_result, lambda path: read_drive(path, (), "")):
        with pytest.raises(UserError, match="`replay` with --out RESULT"):
            read(tmp_path / "drive.mf4")
