"""A simulated drive in which the left foot brakes while the right one accelerates, replayed.

The simulated driver has one foot; here the second one is given to the car: in the middle of three brakings
the accelerator stands at 30 % and all four motors drive.
"""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from brakelab.plant.driver import drive
from brakelab.plant.records import BRAKE
from brakelab.replay.command import replay
from brakelab.results.files import read_result
from brakelab.simulation.scenario import load_scenario
from brakelab.simulation.vehicle_bus import advance, new_noise, new_values, new_vehicle, sense
from ecu.contract.signals import CORNERS, INPUT_SIGNALS
from ecu.settings.resources import resource

SCENARIO = """
plant = "suv"
initial_speed = 30.0
phase = [
    { kind = "cruise", speed = 30.0, seconds = 2.0 },
    { kind = "brake", decel = 3.0, seconds = 3.0 },
    { kind = "cruise", speed = 22.0, seconds = 2.0 },
    { kind = "brake", decel = 4.0, seconds = 3.0 },
    { kind = "cruise", speed = 20.0, seconds = 2.0 },
    { kind = "brake", decel = 3.0, until_speed = 6.0 },
    { kind = "coast", seconds = 1.0 },
]
"""
DRIVING = 400.0  # N m at each wheel, 2 m/s^2 of the car
SECOND = 3  # phase


@pytest.fixture(scope="module")
def drive_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Inputs of the ECU, one row per cycle, with both feet on their pedals in the second braking."""
    folder = tmp_path_factory.mktemp("drive")
    (folder / "both-feet.toml").write_text(SCENARIO)
    vehicle = new_vehicle(load_scenario(folder / "both-feet.toml"), 0)
    noise, values, rows = new_noise(0), new_values(), []
    driver = vehicle.driver[0]
    while drive(vehicle.script, vehicle.params[0], vehicle.state[0], driver, 0.01):
        if driver["phase"] == SECOND:
            assert vehicle.script.phases[SECOND]["kind"] == BRAKE
            driver["motor_demand"], driver["accelerator_position"] = -DRIVING, 30.0
        sense(vehicle, noise, values)
        rows.append(values.copy())
        advance(vehicle)
    names = [signal.name for signal in INPUT_SIGNALS]
    columns = dict(zip(names, np.array(rows).T, strict=True))
    table = {"t": np.arange(len(rows)) * 0.01} | {
        name: pa.array(column, from_pandas=True) for name, column in columns.items()
    }
    pq.write_table(pa.table(table), folder / "both-feet.parquet")
    return folder / "both-feet.parquet"


def run(log: Path, observer: str, out: Path) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    replay([log], resource("config/suv.toml"), None, observer, None, out)
    return read_result(out).columns, read_result(out.with_suffix(".brakes.parquet")).columns


def changes_in_the_second(columns: dict[str, np.ndarray], brakes: dict[str, np.ndarray]) -> dict[str, float]:
    """Return by how much friction changed from before to the end of the second braking, where it did."""
    start, end = brakes["t_start"][4], brakes["t_start"][4] + brakes["duration"][4]
    inside = (columns["t"] >= start - 0.01) & (columns["t"] < end)
    changes = {corner: float(np.ptp(columns[f"mu_b_{corner}"][inside])) for corner in CORNERS}
    return {corner: change for corner, change in changes.items() if change > 0.0}


def without(log: Path, name: str, out: Path) -> Path:
    pq.write_table(pq.read_table(log).drop_columns([name]), out)
    return out


@pytest.mark.parametrize("observer", ["joint", "observer2"])
def test_braking_against_the_accelerator_teaches_nothing_and_is_marked(
    drive_log: Path, tmp_path: Path, observer: str, capsys: pytest.CaptureFixture[str]
) -> None:
    columns, brakes = run(drive_log, observer, tmp_path / "out.parquet")
    assert list(brakes["left_out"][::4]) == ["", "driven against the brakes", ""]
    (why,) = set(brakes["learning"][4:8])
    assert why.startswith("held: ABS, ESP, accelerator")
    assert set(brakes["learning"][8:]) == {"learned"}
    assert not changes_in_the_second(columns, brakes)
    assert "left out of the prediction: 1 driven against the brakes" in capsys.readouterr().out


@pytest.mark.parametrize("observer", ["joint", "observer2"])
def test_where_no_accelerator_is_known_driving_torque_marks_it_and_teaches_nothing(
    drive_log: Path, tmp_path: Path, observer: str
) -> None:
    log = without(drive_log, "accelerator_position", tmp_path / "one-foot.parquet")
    columns, brakes = run(log, observer, tmp_path / "out.parquet")
    assert list(brakes["left_out"][::4]) == ["", "driven against the brakes", ""]
    assert not changes_in_the_second(columns, brakes)
