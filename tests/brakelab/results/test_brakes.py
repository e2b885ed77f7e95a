"""The book of brakings against closed forms: constant pressure, friction and deceleration."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from brakelab.replay.engine import N_ROW
from brakelab.results.brakes import LEARNED, BrakeBook
from ecu.contract.faults import E2E_REJECTIONS, PRESSURE_LOST, WHEEL_SPEED_LOST
from ecu.contract.records import RecordArray
from ecu.contract.signals import CORNERS, FAULT, HOLDING, N_OUTPUTS, NOMINAL, OBSERVING, OUTPUT
from ecu.settings.config import load_config, new_params

BAR = 1e5
SPEED, DECEL, PRESSURE, BEFORE, DURING = 30.0, 4.0, 40.0, 0.40, 0.44


@pytest.fixture
def params() -> RecordArray:
    return new_params(load_config(Path(__file__).parents[3] / "config" / "suv.toml"))


def corners(rows: np.ndarray, name: str) -> np.ndarray:
    return rows[:, OUTPUT[f"{name}_fl"] : OUTPUT[f"{name}_fl"] + 4]


def stop(params: RecordArray, seconds: float = 5.0) -> tuple[np.ndarray, np.ndarray]:
    """One second of rolling, `seconds` of braking at constant pressure, one second of rolling."""
    n = round(seconds * 100)
    t = 7.0 + np.arange(n + 200) * 0.01
    rows = np.full((len(t), N_ROW), np.nan)
    braking = slice(100, 100 + n)
    rows[:, OUTPUT["braking"]] = 0.0
    rows[braking, OUTPUT["braking"]] = 1.0
    rows[:, OUTPUT["vehicle_speed"]] = SPEED
    rows[braking, OUTPUT["vehicle_speed"]] = SPEED - DECEL * np.arange(n) * 0.01
    rows[braking.stop :, OUTPUT["vehicle_speed"]] = rows[braking.stop - 1, OUTPUT["vehicle_speed"]]
    rows[:, OUTPUT["vehicle_mass"]] = params[0]["mass"]
    rows[:, OUTPUT["accel_x_road"]] = 0.0
    rows[braking, OUTPUT["accel_x_road"]] = -DECEL
    corners(rows, "calliper_pressure")[:] = 0.0
    corners(rows, "calliper_pressure")[braking] = PRESSURE
    corners(rows, "mu_b")[:] = BEFORE
    corners(rows, "mu_b")[braking.start :] = DURING
    corners(rows, "sigma_mu_b")[:] = 0.02
    rows[:, OUTPUT["mode_fl"] : OUTPUT["mode_fl"] + 4] = NOMINAL
    rows[braking, OUTPUT["mode_fl"] : OUTPUT["mode_fl"] + 4] = OBSERVING
    torque = 2 * params[0]["piston_area"] * params[0]["effective_radius"] * DURING
    corners(rows, "brake_torque")[:] = 0.0
    corners(rows, "brake_torque")[braking] = torque * (PRESSURE * BAR - params[0]["push_out_pressure"])
    return t, rows


def book(params: RecordArray, t: np.ndarray, rows: np.ndarray, block: int = 10_000) -> BrakeBook:
    filled = BrakeBook(params)
    for first in range(0, len(t), block):
        filled.add(t[first : first + block], rows[first : first + block])
    filled.end_log()
    return filled


def test_a_constant_stop_has_its_closed_form(params: RecordArray) -> None:
    t, rows = stop(params)
    corners(rows, "slip")[:] = -0.02
    lines = book(params, t, rows).rows
    p = params[0]
    assert [line.corner for line in lines] == list(CORNERS)
    speeds = SPEED - DECEL * np.arange(500) * 0.01
    effective = p["piston_area"] * p["effective_radius"] * (PRESSURE * BAR - p["push_out_pressure"])
    force = (2 * BEFORE * effective / p["wheel_radius"]).sum() + p["rolling_resistance"] * p["mass"] * 9.81
    inert = p["mass"] + (p["wheel_inertia"] / p["wheel_radius"] ** 2).sum()
    predicted = (force + p["drag_area"] * np.mean(speeds**2)) / inert
    for i, line in enumerate(lines):
        torque = 2 * DURING * effective[i]
        assert (line.brake, line.t_start, line.duration) == (0, 8.0, pytest.approx(5.0))
        assert (line.v_in, line.v_end) == (pytest.approx(30.0), pytest.approx(10.04))
        assert line.decel_mean == pytest.approx((30.0 - 10.04) / 5.0)
        assert line.decel_predicted == pytest.approx(predicted, rel=1e-9)
        assert line.specific_force_predicted == pytest.approx(predicted, rel=1e-9)
        assert line.specific_force_mean == pytest.approx(DECEL)
        assert (line.mu_b_before, line.mu_b_end, line.observed) == (BEFORE, DURING, pytest.approx(5.0))
        assert line.mu_b_mean == pytest.approx(DURING)
        assert line.mu_b_mean_time == pytest.approx(DURING)
        assert line.brake_torque_mean == pytest.approx(torque)
        energy = torque * (np.mean(speeds) * 5.0) * 0.98 / p["wheel_radius"][i]
        assert line.brake_energy == pytest.approx(energy, rel=1e-9)
        assert np.isnan([line.disc_temperature_in, line.pad_wear_mass, line.emission_factor]).all()
        assert line.learning == LEARNED


def test_friction_means_weigh_distance_and_time(params: RecordArray) -> None:
    t, rows = stop(params)
    torque = corners(rows, "brake_torque")
    torque[350:600] *= 1.5  # the slower half
    line = book(params, t, rows).rows[0]
    distance = (30 + 20) / 2 * 2.5, (20 + 10) / 2 * 2.5
    assert line.mu_b_mean_time == pytest.approx(DURING * 1.25, rel=1e-3)
    by_distance = DURING * (distance[0] + 1.5 * distance[1]) / sum(distance)
    assert line.mu_b_mean == pytest.approx(by_distance, rel=2e-3)


def test_friction_means_leave_out_build_up_release_and_walking_pace(params: RecordArray) -> None:
    t, rows = stop(params, 7.6)  # below 5 km/h from 7.15 s on
    pressure, torque = corners(rows, "calliper_pressure"), corners(rows, "brake_torque")
    pressure[100:200] = 0.5 * PRESSURE
    torque[100:200] *= 3.0
    torque[100 + 716 :] *= 9.0
    line = book(params, t, rows).rows[0]
    assert line.mu_b_mean_time == pytest.approx(DURING)


def test_motor_torque_counts_and_a_standing_vehicle_does_not(params: RecordArray) -> None:
    t, rows = stop(params)
    base = book(params, t, rows).rows[0].decel_predicted
    motor = rows.copy()
    motor[:, N_OUTPUTS : N_OUTPUTS + 4] = 100.0
    p = params[0]
    more = (100.0 / p["wheel_radius"]).sum() / (
        p["mass"] + (p["wheel_inertia"] / p["wheel_radius"] ** 2).sum()
    )
    assert book(params, t, motor).rows[0].decel_predicted == pytest.approx(base + more)
    standing = rows.copy()
    standing[:, OUTPUT["vehicle_speed"]] = 0.0
    line = book(params, t, standing).rows[0]
    assert (line.decel_mean, line.decel_predicted) == (0.0, 0.0)


@pytest.mark.parametrize("block", [1, 3, 99, 100, 101, 600, 601])
def test_blocks_join_without_a_seam(params: RecordArray, block: int) -> None:
    t, rows = stop(params)
    rows2 = np.concatenate((rows, rows[50:]))  # 1.5 s between the two
    t2 = t[0] + np.arange(len(rows2)) * 0.01
    whole, pieces = book(params, t2, rows2), book(params, t2, rows2, block)
    assert [line.brake for line in whole.rows] == [0] * 4 + [1] * 4
    np.testing.assert_equal(pieces.rows, whole.rows)


@pytest.mark.parametrize(("last", "learning"), [(5.0, "the log ends first"), (0.0, LEARNED)])
def test_a_log_that_ends_in_a_braking_ends_the_braking(
    params: RecordArray, last: float, learning: str
) -> None:
    t, rows = stop(params)
    rows[399, OUTPUT["vehicle_speed"]] = last
    lines = book(params, t[:400], rows[:400]).rows
    assert len(lines) == 4
    assert lines[0].duration == pytest.approx(3.0)
    assert lines[0].learning == learning


def no_observation(rows: np.ndarray) -> None:
    rows[:, OUTPUT["mode_fl"] : OUTPUT["mode_fl"] + 4] = HOLDING


def slow(rows: np.ndarray) -> None:
    no_observation(rows)
    rows[:, OUTPUT["vehicle_speed"]] = 3.0


def standing(rows: np.ndarray) -> None:
    no_observation(rows)
    rows[:, OUTPUT["vehicle_speed"]] = 0.0


def brief(rows: np.ndarray) -> None:
    no_observation(rows)
    rows[150:200, OUTPUT["mode_fl"] : OUTPUT["mode_fl"] + 4] = OBSERVING


def lost(rows: np.ndarray) -> None:
    no_observation(rows)
    rows[100:380, OUTPUT["mode_fl"] : OUTPUT["mode_fl"] + 4] = FAULT


def lost_for_a_moment(rows: np.ndarray) -> None:
    no_observation(rows)
    rows[100:200, OUTPUT["mode_fl"] : OUTPUT["mode_fl"] + 4] = FAULT


def faulty(bit: int, speed: float = SPEED, until: int = 700) -> Callable[[np.ndarray], None]:
    def change(rows: np.ndarray) -> None:
        no_observation(rows)
        rows[:until, OUTPUT["active_faults"]] = bit
        rows[:, OUTPUT["vehicle_speed"]] = speed

    return change


HELD = "held: ABS, ESP, accelerator or reverse, or a wheel that slides"


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (slow, "slower than 15 km/h"),
        (standing, "stands"),
        (no_observation, HELD),
        (lost, "inputs lost"),
        (lost_for_a_moment, HELD),
        (faulty(E2E_REJECTIONS), "E2E rejections"),
        (faulty(PRESSURE_LOST), "pressure lost"),
        (faulty(WHEEL_SPEED_LOST, np.nan), "wheel speed lost"),
        (faulty(E2E_REJECTIONS, until=200), HELD),
        (brief, LEARNED),
    ],
)
def test_what_a_braking_taught_or_why_nothing(
    params: RecordArray, change: Callable[[np.ndarray], None], why: str
) -> None:
    t, rows = stop(params)
    change(rows)
    assert book(params, t, rows).rows[0].learning == why


@pytest.mark.parametrize("scale", [1.0, 0.4])
def test_the_mass_of_particles_is_of_the_wear_that_the_ecu_believes(params: RecordArray, scale) -> None:
    """Pads that a measured thickness says to wear 0.4 times as fast as the law emit so much less."""
    t, rows = stop(params)
    corners(rows, "slip")[:] = 0.0
    corners(rows, "disc_temperature")[:], corners(rows, "sigma_disc_temperature")[:] = 100.0, 5.0
    corners(rows, "pad_wear_mass")[:] = 10.0
    by_law = np.array([line.pad_wear_mass for line in book(params, t, rows).rows])
    corners(rows, "pad_wear_mass")[600:] += scale * by_law
    for line, mass in zip(book(params, t, rows).rows, by_law, strict=True):
        assert line.pad_wear_mass == pytest.approx(mass)  # the contract: regressors times coefficients
        assert line.particle_mass == pytest.approx(1e3 * 0.5 * scale * mass)
        assert line.particle_mass_low < 0.02 / 0.5 * line.particle_mass
        assert line.particle_mass_high > 0.70 / 0.5 * line.particle_mass
