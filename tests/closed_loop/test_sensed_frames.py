"""Sensors at the bus: what is slow or dead is no frame, what is missing beside others is "not available"."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from brakelab.plant.sensor_errors import SensorErrors
from brakelab.simulation.closed_loop import Drive, new_loop, run
from brakelab.simulation.scenario import load_scenario
from ecu.contract.signals import CORNERS
from ecu.settings.config import Config, load_config

CONFIG = Path(__file__).parents[2] / "config"
IDS = {
    "WheelSpeedFront": 112,
    "WheelSpeedRear": 113,
    "Imu": 114,
    "CalliperPressureFront": 116,
    "VehicleSpeed": 144,
}
LOST_AT = 3.0


@pytest.fixture(scope="module")
def config() -> Config:
    return load_config(CONFIG / "suv.toml")


@pytest.fixture
def drive(config: Config) -> Callable[..., Drive]:
    """Return a driver of stop-2 (120 km/h, 6 s of cruising, 7 m/s^2) with other sensors."""

    def driven(seed: int = 1, vehicle_speed: str = "ideal", **sensor: dict[str, Any]) -> Drive:
        errors = {name: SensorErrors(**given) for name, given in sensor.items()}
        scenario = load_scenario(CONFIG / "scenarios" / "stop-2.toml")
        scenario = scenario.model_copy(
            update={"vehicle_speed": vehicle_speed, "sensor": errors, "draw": "nominal"}
        )
        loop = new_loop(scenario, config, seed)
        found = run(loop)
        totals = loop.sides.ecu_reception.totals[0]
        assert totals["rejected"] == 0
        assert np.all(loop.sides.ecu_reception.messages["lost"] == 0)  # counters follow what is sent
        return found

    return driven


def seconds(drive: Drive, message: str) -> NDArray[np.float64]:
    """Return when frames of a message came [s]."""
    stamps = drive.frames["stamp_ns"][drive.frames["can_id"] == IDS[message]]
    return np.ceil((stamps - drive.frames["stamp_ns"][0]) / 1e7) / 100.0


@pytest.mark.parametrize(
    ("sensor", "message", "interval"),
    [
        ({"wheel_speed": {"period": 0.03}}, "WheelSpeedFront", 0.03),
        ({"calliper_pressure": {"period": 0.1}}, "CalliperPressureFront", 0.1),
        ({name: {"period": 0.04} for name in ("accel_x", "accel_y", "yaw_rate")}, "Imu", 0.04),
        ({}, "WheelSpeedFront", 0.01),
    ],
)
def test_a_slow_sensor_is_a_slow_frame(
    drive: Callable[..., Drive], sensor: dict[str, Any], message: str, interval: float
) -> None:
    assert np.allclose(np.diff(seconds(drive(**sensor), message)), interval)


def test_both_wheels_of_an_axle_lost_is_no_frame(drive: Callable[..., Drive]) -> None:
    found = drive(wheel_speed_fl={"lost_from": LOST_AT}, wheel_speed_fr={"lost_from": LOST_AT})
    assert seconds(found, "WheelSpeedFront")[-1] == pytest.approx(LOST_AT - 0.01)
    assert seconds(found, "WheelSpeedRear")[-1] == pytest.approx(found.t[-1])


def test_one_wheel_lost_is_not_available_beside_the_other(drive: Callable[..., Drive]) -> None:
    found = drive(wheel_speed_fl={"lost_from": LOST_AT})
    assert seconds(found, "WheelSpeedFront")[-1] == pytest.approx(found.t[-1])
    there = {c: ~np.isnan(found.inputs[f"wheel_speed_{c}"]) for c in CORNERS}
    assert np.array_equal(there["fl"], found.t < LOST_AT - 0.001)
    assert there["fr"].all()


@pytest.mark.parametrize("seed", range(4))
def test_a_satellite_speed_comes_late_ten_times_a_second(drive: Callable[..., Drive], seed: int) -> None:
    found = drive(seed, vehicle_speed="gnss")
    assert np.allclose(np.diff(seconds(found, "VehicleSpeed")), 0.1)
    said, true = found.inputs["vehicle_speed"], found.truth["vehicle_speed"]
    braked = ~np.isnan(said) & (true > 8.0) & (true < 26.0)
    falling = -np.gradient(true, found.t)[braked]
    ages = (said - true)[braked] / falling
    print(f"age {1e3 * ages.mean():.0f} ms")
    assert 0.095 < ages.mean() < 0.205
    assert np.array_equal(~np.isnan(said), found.inputs["vehicle_speed_valid"] == 1.0)


def test_an_optical_speed_is_quieter_than_that_of_table_4_1(drive: Callable[..., Drive]) -> None:
    noise = {}
    for source in ("ideal", "optical"):
        found = drive(vehicle_speed=source)
        cruising = found.t < 5.5
        noise[source] = np.std((found.inputs["vehicle_speed"] - found.truth["vehicle_speed"])[cruising])
    assert noise["ideal"] == pytest.approx(0.027, rel=0.1)
    assert noise["optical"] == pytest.approx(0.01, rel=0.1)


def test_errors_reach_the_ecu_in_the_signals_own_unit(drive: Callable[..., Drive]) -> None:
    found = drive(calliper_pressure_rl={"bias": 4.0}, yaw_rate={"bias": 0.01})
    pressure = found.inputs["calliper_pressure_rl"] - found.truth["calliper_pressure_rl"]
    yaw_rate = found.inputs["yaw_rate"] - found.truth["yaw_rate"]
    assert pressure.mean() == pytest.approx(4.0, abs=0.2)  # bar, noise 1.8
    assert yaw_rate.mean() == pytest.approx(0.01, abs=3e-4)
