"""A made-up drive: three stops from 100 km/h with friction that the estimate approaches, no ECU involved."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from brakelab.report import command, page
from brakelab.report.brakings import Braking, Force
from brakelab.results.car import car_of
from brakelab.results.files import brakes_path
from ecu.contract.signals import CORNERS, OUTPUT_COLUMNS
from ecu.recording.recorder import ABOUT_FILE, CYCLES_FILE, INITIAL_FILE, layout
from ecu.recording.ring import RECORDED
from ecu.settings.config import load_config

STOPS = ((5.0, 4.0), (22.0, 6.0), (40.0, 8.0))  # start [s], deceleration [m/s^2]
V_IN = 100.0 / 3.6
DT = 0.01
TRUE_FRICTION = {"fl": 0.38, "fr": 0.38, "rl": 0.49, "rr": 0.50}
INPUT_COUNTS: dict[str, Any] = {
    "name": "accel_x", "unit": "m/s^2", "samples": 1000, "expected_hz": [100.0, 100.0], "timeout_s": 0.1,
    "greatest_gap_s": 0.02, "invalid": 0, "outside": 0, "clipped": 0, "jumps": 0, "least": -4.0,
    "greatest": 1.0,
}  # fmt: skip
MESSAGE_COUNTS: dict[str, Any] = {
    "name": "Imu", "id": "072", "expected_hz": 100.0, "received": 1000, "accepted": 1000,
    "checksum_errors": 0, "sequence_errors": 0, "repeated": 0, "length_errors": 0, "lost": 0,
}  # fmt: skip


def braking_between(start: float, end: float, number: int = 1, **known: Any) -> Braking:
    """Return a stop from 30 m/s, times in s, of which nothing else is known but `known`."""
    nan, corners = float("nan"), np.full(4, np.nan)
    unknown = Braking(
        number, start, end, 30.0, 0.0, nan, nan, nan, corners, corners, corners, nan, Force(*[nan] * 5),
        corners, corners, "",
    )  # fmt: skip
    return unknown._replace(**known)


def made_up_drive(seconds: float = 60.0) -> tuple[dict[str, Any], dict[str, Any], dict[str, list[Any]]]:
    """Return the columns of a result, of its truth and of its table of brakings."""
    rng = np.random.default_rng(7)
    t = np.arange(0.0, seconds, DT)
    speed, demand = np.full_like(t, V_IN), np.zeros_like(t)
    for start, deceleration in STOPS:
        end = start + V_IN / deceleration
        speed = np.where((t >= start) & (t < end), V_IN - deceleration * (t - start), speed)
        speed = np.where((t >= end) & (t < end + 6.0), V_IN * (t - end) / 6.0, speed)
        demand[(t >= start) & (t < end)] = deceleration
    braking = (demand > 0.0).astype(float)
    noise = rng.normal(0.0, 0.1, t.shape)
    result: dict[str, Any] = {name: np.full_like(t, np.nan) for name in OUTPUT_COLUMNS}
    result |= {
        "t": t, "vehicle_speed": speed + noise * 0.3, "k_f": 1.0 + 0.05 * np.sin(t / 9.0),
        "mode": np.where(braking > 0, 2.0, 1.0), "active_faults": np.where((t > 50.0) & (t < 51.0), 8.0, 0.0),
        "decel_demand_total": demand, "accel_x_road": -demand * 0.97 + noise, "braking": braking,
    }  # fmt: skip
    truth: dict[str, Any] = {"t": t, "vehicle_speed": speed, "accel_x_road": -demand * 0.97}
    for corner, friction in TRUE_FRICTION.items():
        learned = np.cumsum(braking) * DT
        remaining = np.exp(-learned / 2.0)
        true = friction * (1.0 - 0.05 * braking)
        result[f"mu_b_{corner}"] = 0.45 * remaining + true * (1.0 - remaining)
        result[f"sigma_mu_b_{corner}"] = 0.005 + 0.05 * remaining
        true_disc = 80.0 + 20.0 * learned
        result[f"disc_temperature_{corner}"] = true_disc + 10.0 * remaining
        result[f"sigma_disc_temperature_{corner}"] = 5.0 + 30.0 * remaining
        truth[f"disc_temperature_{corner}"] = true_disc
        result[f"mode_{corner}"] = np.where(braking > 0, 1.0, np.where(learned > 0, 2.0, 0.0))
        pressure = demand * (9.0 if corner.startswith("f") else 4.0)
        result[f"pressure_demand_{corner}"] = pressure
        result[f"calliper_pressure_{corner}"] = pressure + rng.normal(0.0, 1.8, t.shape)
        truth[f"mu_b_{corner}"] = true
        result[f"brake_torque_{corner}"] = result[f"mu_b_{corner}"] * pressure * 60.0
        result[f"slip_{corner}"] = np.where(speed > 1.0, -0.01 * braking, np.nan)
    brakes: dict[str, list[Any]] = {}
    for number, (start, deceleration) in enumerate(STOPS):
        learned = number > 0
        for corner in CORNERS:
            row = {
                "brake": number, "corner": corner, "t_start": start, "duration": V_IN / deceleration,
                "v_in": V_IN, "v_end": 0.0, "decel_mean": deceleration,
                "decel_predicted": 1.04 * deceleration,
                "mu_b_mean": TRUE_FRICTION[corner], "disc_temperature_in": 80.0 + 20 * number,
                "brake_energy": 1.5e5, "mu_b_end": TRUE_FRICTION[corner], "sigma_mu_b_end": 0.005,
                "mu_b_before": TRUE_FRICTION[corner] if learned else 0.45,
                "sigma_mu_b_before": 0.01 if learned else 0.055,
                "specific_force_mean": deceleration, "specific_force_predicted": 1.04 * deceleration,
                "sigma_specific_force": 0.02 * deceleration,
                "specific_force_configured": 1.1 * deceleration, "specific_force_configured_rest": 0.1,
                "learned_before": int(learned),
                "left_out": "driven against the brakes" if number == 2 else "",
            }  # fmt: skip
            for name, value in row.items():
                brakes.setdefault(name, []).append(value)
    return result, truth, brakes


def write(path: Path, columns: dict[str, Any], metadata: dict[str, str] | None = None) -> Path:
    """Write columns as Parquet, NaN as null."""
    table = pa.table({name: pa.array(values, from_pandas=True) for name, values in columns.items()})
    pq.write_table(table.replace_schema_metadata(metadata or {}), path)
    return path


def made_up_cycles(count: int = 6000) -> np.ndarray[Any, Any]:
    """Return the records of a loop that was late a few times."""
    rng = np.random.default_rng(3)
    cycles = np.zeros(count, RECORDED)
    cycles["cycle"]["t_mono_ns"] = np.arange(count) * 10_000_000
    cycles["cycle"]["lateness_ns"] = rng.lognormal(np.log(22e3), 0.4, count)
    cycles["cycle"]["stage_ns"] = rng.lognormal(np.log([8e3, 12e3, 9e3, 4e3, 20e3]), 0.2, (count, 5))
    cycles["cycle"]["missed"][1000] = 2
    return cycles


def write_recording(folder: Path) -> Path:
    """Write what `run --record` leaves, without frames and with an empty state."""
    state = np.zeros(1, [("k_f", "f8")])
    folder.mkdir()
    about = {"record": layout(RECORDED), "state": layout(state.dtype)}
    (folder / ABOUT_FILE).write_text(json.dumps(about), "utf-8")
    (folder / CYCLES_FILE).write_bytes(made_up_cycles().tobytes())
    (folder / INITIAL_FILE).write_bytes(state.tobytes())
    return folder


def write_drive(folder: Path) -> dict[str, Path]:
    """Write the made-up drive: result, truth, brakes, timing."""
    result, truth, brakes = made_up_drive()
    metadata = {
        "start_time_ns": "1717240000000000000", "vehicle": "SUV", "config_hash": "0123456789abcdef",
        "version": "0.1.0", "car": json.dumps(car_of(load_config(Path("config/suv.toml")))),
        "inputs": json.dumps([{"name": "stops.log", "sha256": ""}]),
        "quality": json.dumps([{
            "rows": 6000, "frames": 90000, "samples": 0, "seconds": 0.2, "dropped": 3,
            "inputs": [INPUT_COUNTS | {"samples": 6000}, INPUT_COUNTS | {"name": "yaw_rate", "samples": 0}],
            "messages": [MESSAGE_COUNTS | {"received": 6000, "lost": 7}],
        }]),
    }  # fmt: skip
    path = write(folder / "stops.parquet", result, metadata)
    return {
        "result": path,
        "truth": write(folder / "stops.truth.parquet", truth),
        "brakes": write(brakes_path(path), brakes),
        "timing": write_recording(folder / "recording"),
    }


@pytest.fixture
def drive_files(tmp_path: Path) -> dict[str, Path]:
    """The made-up drive on disk."""
    return write_drive(tmp_path)


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the plots, which are most of the work, out of a page whose text is read."""
    monkeypatch.setattr(page, "embed", lambda figures: ("", dict.fromkeys(figures, "")))
    for name in ("over_time", "of_friction", "of_prediction", "per_braking", "of_loop"):
        monkeypatch.setattr(command, f"plots_{name}", lambda *arguments: {})
