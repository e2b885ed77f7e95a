"""What the logger makes of a drive: lag, rates, scales, steps, gaps, and a clock of its own."""

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from .draw import draw
from .logger import Channel, record, truth, write
from .state import ROW, STATE

RADIUS = np.array([0.3, 0.3, 0.31, 0.31])
CLEAN = Channel(100.0, 0.0, 0.0)


def rows(seconds: float = 60.0) -> Any:
    t = np.arange(0.0, seconds, ROW)
    made = np.zeros(len(t), STATE)
    made["speed"] = 30.0 + 10.0 * np.sin(t) + 3.0 * np.sin(2.7 * t)
    made["omega"] = made["speed"][:, None] / RADIUS
    made["line"][:, 0] = np.maximum(40.0 * np.sin(t), 0.0)
    made["line"][:, 1] = 0.7 * made["line"][:, 0]
    made["specific_force"] = 10.0 * np.cos(t)
    return made


def logger(letter: str, **changes: Any) -> Any:
    plain = draw(1, range("ABCDEF".index(letter), "ABCDEF".index(letter) + 1))[0].logger
    return plain._replace(
        **(
            {"drop": 0.0, "gaps": (), "clock": 0.0, "start": 0.0, "pressure": CLEAN, "floored": False}
            | changes
        )
    )


def sampled(columns: dict[str, Any], name: str) -> tuple[Any, Any]:
    there = ~np.isnan(columns[name])
    return columns["t"][there], columns[name][there]


@pytest.mark.parametrize(("delay", "lag"), [(0.08, 0.08), (0.2, 0.0), (0.2, 0.2)])
@pytest.mark.parametrize("rate", [4.6, 10.0])
def test_the_one_speed_lags_by_what_it_says(delay: float, lag: float, rate: float) -> None:
    """The shift at which it fits the true speed best; a first-order lag counts by its time constant."""
    made = rows()
    columns = record(made, logger("B", speed=Channel(rate, 0.02, 0.01, delay, lag), speed_scale=1.0), RADIUS)
    stamps, speed = sampled(columns, "vehicle_speed")
    assert 1.0 / np.median(np.diff(stamps)) == pytest.approx(rate, rel=0.01)
    shifts = np.arange(0.0, 0.6, 0.005)
    t = ROW * np.arange(len(made))
    inner = (stamps > 1.0) & (stamps < 59.0)
    errors = [np.std(np.interp(stamps[inner] - s, t, made["speed"]) - speed[inner]) for s in shifts]
    assert shifts[np.argmin(errors)] == pytest.approx(delay + lag, abs=0.03)


def test_one_speed_feeds_wheels_and_car() -> None:
    columns = record(rows(), logger("B"), RADIUS)
    for i, corner in enumerate(("fl", "fr", "rl", "rr")):
        np.testing.assert_allclose(columns[f"wheel_speed_{corner}"] * RADIUS[i], columns["vehicle_speed"])


@pytest.mark.parametrize(
    ("letter", "has", "lacks"),
    [
        ("A", {"wheel_speed_fl", "calliper_pressure_rr", "accel_x"}, {"vehicle_speed"}),
        ("B", {"wheel_speed_fl", "vehicle_speed"}, {"disc_temperature_measured_fl", "motor_torque_fl"}),
        ("C", {"vehicle_speed", "accel_x"}, {"wheel_speed_fl"}),
        ("D", {"disc_temperature_measured_fl", "disc_temperature_measured_rl"}, {"vehicle_speed"}),
        ("E", {"wheel_speed_fl", "calliper_pressure_rr"}, {"vehicle_speed"}),
        ("F", {"wheel_speed_fl", "vehicle_speed"}, {"disc_temperature_measured_fl"}),
    ],
)  # fmt: skip
def test_each_set_has_its_signals(letter: str, has: set[str], lacks: set[str]) -> None:
    names = set(record(rows(5.0), logger(letter), RADIUS))
    assert has <= names
    assert not lacks & names


def test_pressures_are_scaled_shifted_and_of_one_line() -> None:
    made = rows()
    columns = record(made, logger("E", pressure_scale=(1.05, 0.96), pressure_zero=(0.5, -0.3)), RADIUS)
    t, front = sampled(columns, "calliper_pressure_fl")
    np.testing.assert_array_equal(front, sampled(columns, "calliper_pressure_fr")[1])
    true = np.interp(t, ROW * np.arange(len(made)), made["line"][:, 0])
    assert np.polyfit(true, front, 1) == pytest.approx([1.05, 0.5], abs=0.01)
    assert sampled(columns, "calliper_pressure_rl")[1].min() == pytest.approx(-0.3, abs=0.01)
    floored = record(made, logger("E", pressure_zero=(-0.5, -0.5), floored=True), RADIUS)
    assert sampled(floored, "calliper_pressure_fl")[1].min() == 0.0


def test_the_accelerometer_is_pitched_and_turned() -> None:
    made = rows()
    exact = {"accel": CLEAN, "accel_scale": 1.0, "accel_zero": 0.2}
    columns = record(made, logger("A", pitch_gradient=0.003, mounting=0.0, **exact), RADIUS)
    t, accel = sampled(columns, "accel_x")
    true = np.interp(t, ROW * np.arange(len(made)), made["specific_force"])
    assert np.polyfit(true, accel, 1) == pytest.approx([1.0 + 9.81 * 0.003, 0.2], abs=0.002)
    made["lateral"] = 8.0
    turned = record(made, logger("A", pitch_gradient=0.0, mounting=0.02, **exact), RADIUS)
    assert np.mean(sampled(turned, "accel_x")[1] - true) == pytest.approx(0.2 + 8.0 * 0.02, abs=0.005)


def test_steps_gaps_and_lost_samples() -> None:
    pressure = Channel(100.0, 0.2, 0.5)
    columns = record(rows(), logger("A", pressure=pressure, gaps=(0.5,), drop=0.02, start=100.0), RADIUS)
    stamps, values = sampled(columns, "calliper_pressure_fl")
    assert np.all(values % 0.5 == 0.0)
    assert stamps[0] == pytest.approx(100.0, abs=0.02)
    assert np.max(np.diff(stamps)) >= 1.0
    assert len(stamps) / (100.0 * (60.0 - np.max(np.diff(stamps)))) == pytest.approx(0.98, abs=0.01)
    assert np.all(np.diff(columns["t"]) > 0.0)


def test_files_hold_null_where_there_is_no_new_sample(tmp_path: Path) -> None:
    made, one = rows(5.0), logger("D")
    columns = record(made, one, RADIUS)
    write(columns, tmp_path / "drive.parquet")
    read = pq.read_table(tmp_path / "drive.parquet")
    assert read.column_names == list(columns)
    assert read["t"].null_count == 0
    assert read["accel_x"].null_count == np.count_nonzero(np.isnan(columns["accel_x"])) > 0
    true = truth(made, one)
    assert {"t", "vehicle_speed", "mu_b_fl", "wheel_force_x_rr", "disc_temperature_rl"} <= set(true)
    assert len(true["t"]) == len(made)
