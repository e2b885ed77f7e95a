"""Inputs without which nothing is estimated: what is said where they are of no use."""

import math
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from ecu.contract.signals import CORNERS
from ecu.errors import RunFault
from tests.brakelab.replay.test_command import run, stop


def change(path: Path, **columns: np.ndarray | float | None) -> Path:
    """Replace columns of a signal file; None: leave it out."""
    table = pq.read_table(path)
    for name, values in columns.items():
        table = table.drop_columns([name])
        if values is not None:
            table = table.append_column(name, pa.array(np.broadcast_to(values, table.num_rows)))
    pq.write_table(table, path)
    return path


def corners(name: str, value: float | None) -> dict[str, float | None]:
    return {f"{name}_{corner}": value for corner in CORNERS}


NO_SPEED = "without vehicle_speed (the wheels alone tell the speed: wider sigma where all slip)"
WORTHLESS: dict[str, tuple[dict[str, float | None], list[str]]] = {
    "a good drive": ({}, [NO_SPEED]),
    "pressures in Pa": (
        corners("calliper_pressure", 3e6),
        [
            "calliper_pressure_*: 100 % of samples outside -10…250 bar; is the unit bar?",
            NO_SPEED,
            "degraded or failed for 87 % of the drive: pressure lost (87 %)",
        ],
    ),
    "one pressure lost": (
        {"calliper_pressure_rl": math.nan},
        [
            "calliper_pressure_rl: no sample in the whole log; fill this column",
            NO_SPEED,
            "degraded or failed for 87 % of the drive: pressure lost (87 %)",
        ],
    ),
    "a pressure of the front circuit alone": (
        {"calliper_pressure_rl": None, "calliper_pressure_rr": None},
        [
            "calliper_pressure_rl, calliper_pressure_rr: not mapped; that of another wheel stands for it",
            NO_SPEED,
        ],
    ),
    "no acceleration": (
        {"accel_x": None},
        [
            "accel_x: not mapped; the change of speed stands for it",
            NO_SPEED,
        ],
    ),
    "pedal from 0 to 1023, demand right": (
        {"pedal_position": 900.0, "decel_demand_valid": 1.0},
        [
            "pedal_position: 100 % of samples outside 0…100 %; is the unit %?",
            NO_SPEED,
            "degraded or failed for 87 % of the drive: pedal lost (87 %)",
        ],
    ),
    "pedal without a sample, demand right": (
        {"pedal_position": None, "decel_demand_valid": 1.0},
        [NO_SPEED],
    ),
}


@pytest.mark.parametrize("case", WORTHLESS)
def test_needed_inputs_of_no_use_are_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], case: str
) -> None:
    columns, lines = WORTHLESS[case]
    path = change(stop(tmp_path / "stop.parquet"), **columns)
    run([path], tmp_path / "out.parquet")
    *notes, written = capsys.readouterr().err.splitlines()
    assert notes == [f"{path}: {line}" for line in lines]
    assert written.startswith(f"written: {tmp_path / 'out.parquet'}, ")


def test_a_drive_without_any_needed_input_is_a_fault_of_the_run(tmp_path: Path) -> None:
    path = tmp_path / "drive.csv"
    path.write_text("t,yaw_rate\n" + "".join(f"{0.01 * k:.2f},0\n" for k in range(200)))
    with pytest.raises(RunFault, match="not one sample of the needed inputs was usable"):
        run([path], tmp_path / "out.parquet")
    assert (tmp_path / "out.parquet").is_file()
