"""Type-0 test of ECE R13-H, Annex 3, engine disconnected: stopping distances and decelerations."""

from pathlib import Path

import numpy as np
import pytest

from brakelab.simulation.closed_loop import Drive, new_loop, run
from brakelab.simulation.scenario import Payload, load_scenario
from brakelab.simulation.scenario_car import scenario_plant
from ecu.contract.signals import CORNERS
from ecu.settings.config import load_config

CONFIG = Path(__file__).parents[2] / "config"
DECEL = 6.43  # m/s^2


def stopping(drive: Drive) -> tuple[float, float, float]:
    """Return v [km/h], stopping distance s [m] from the pedal's first touch, d_m [m/s^2] (Annex 3)."""
    start = int(np.argmax(drive.inputs["pedal_position"] > 0.1)) - 1
    speed, distance = drive.truth["vehicle_speed"][start:] * 3.6, drive.truth["position_x"][start:]
    distance = distance - distance[0]
    assert speed[-1] < 1.0, "at rest but for a millimetre"
    before, after = (int(np.argmax(speed <= share * speed[0])) for share in (0.8, 0.1))
    mean = (speed[before] ** 2 - speed[after] ** 2) / (25.92 * (distance[after] - distance[before]))
    return float(speed[0]), float(distance[-1]), float(mean)


@pytest.mark.parametrize("name", ["type-0", "type-0-laden"])
def test_the_prescribed_performance_is_reached(name: str) -> None:
    config = load_config(CONFIG / "suv.toml")
    for seed in (1, 2, 3, 4, 5):
        drive = run(new_loop(load_scenario(CONFIG / "scenarios" / f"{name}.toml"), config, seed))
        v, distance, mean = stopping(drive)
        prescribed = 0.1 * v + 0.0060 * v * v
        disc = max(drive.truth[f"disc_temperature_{corner}"][0] for corner in CORNERS)
        slip = min(drive.truth[f"slip_{c}"][drive.truth["vehicle_speed"] > 15 / 3.6].min() for c in CORNERS)
        print(
            f"{name} {seed}: {v:.1f} km/h, {distance:.1f} ({prescribed:.1f}) m, {mean:.2f} m/s^2, {slip:.3f}"
        )
        assert v == pytest.approx(100.0, rel=0.02), "at least 98 % of the prescribed speed"
        assert 65.0 <= disc <= 100.0
        assert distance <= prescribed
        assert mean >= DECEL
        assert slip > -0.9, "above 15 km/h no wheel may lock"
        assert np.abs(drive.truth["motor_torque_fl"][drive.t > 2.2]).max() < 1.0, "disconnected"


def test_the_measure_is_that_of_a_constant_deceleration() -> None:
    t = np.arange(0.0, 5.0, 0.001)
    speed = np.maximum(27.78 - 8.0 * np.maximum(t - 0.3, 0.0), 0.0)  # 0.3 s until the brakes bite
    distance = np.cumsum(speed) * 0.001
    pedal = np.where(t > 0.0, 90.0, 0.0)
    truth = {"vehicle_speed": speed, "position_x": distance}
    drive = Drive(t, {"pedal_position": pedal}, {}, truth, np.zeros(1))
    v, length, mean = stopping(drive)
    assert v == pytest.approx(100.0, abs=0.1)
    assert length == pytest.approx(27.78 * 0.3 + 27.78**2 / 16, rel=1e-3)
    assert mean == pytest.approx(8.0, rel=1e-3)


def test_the_payload_makes_the_laden_car_of_the_configuration() -> None:
    plant = scenario_plant(load_scenario(CONFIG / "scenarios" / "type-0-laden.toml"))
    empty = scenario_plant(load_scenario(CONFIG / "scenarios" / "type-0.toml"))
    laden, before = plant.vehicle.body, empty.vehicle.body
    assert laden.mass == load_config(CONFIG / "suv.toml").vehicle.laden_mass
    assert laden.front_length + laden.rear_length == pytest.approx(2.665)
    # Moments about the front axle, and of inertia about it: the payload is a point.
    assert laden.mass * laden.front_length == pytest.approx(2105 * 1.29 + 495 * (1.29 + 0.65))
    about_axle = laden.yaw_inertia + laden.mass * laden.front_length**2
    assert about_axle == pytest.approx(before.yaw_inertia + 2105 * 1.29**2 + 495 * (1.29 + 0.65) ** 2)
    assert Payload(mass=1e-9, behind=0.5, height=0.8).body(before).cog_height == pytest.approx(
        before.cog_height
    )
