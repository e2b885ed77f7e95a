"""What a braking is expected to do, against closed forms, and which predictions count."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from brakelab.replay.brakes import BrakeBook, BrakeRow
from brakelab.replay.engine import N_ROW
from brakelab.replay.prediction import errors
from ecu.config import load_config, new_params
from ecu.params import BAR
from ecu.records import RecordArray
from ecu.signals import FAULT, HOLDING, N_OUTPUTS, NOMINAL, OUTPUT

MU, SIGMA, PRESSURE, DECEL = 0.42, 0.021, 40.0, 3.5
BEGINS, ENDS = 250, 550
ACCELERATOR = N_OUTPUTS + 4


@pytest.fixture(scope="module")
def params() -> RecordArray:
    return new_params(load_config(Path(__file__).parents[3] / "config" / "suv.toml"))


def braking(slope: float = 0.0) -> np.ndarray:
    """2.5 s of coasting at 0.3 m/s^2, 3 s of braking, 1 s of rolling; gravity along the road in m/s^2."""
    rows = np.full((650, N_ROW), np.nan)
    decel = np.repeat([0.3, DECEL, 0.0], [BEGINS, ENDS - BEGINS, 100])
    rows[:, OUTPUT["vehicle_speed"]] = 30.0 - np.concatenate(([0.0], np.cumsum(decel[:-1]) * 0.01))
    rows[:, OUTPUT["accel_x_road"]] = slope - decel
    rows[:, OUTPUT["braking"]] = 0.0
    rows[BEGINS:ENDS, OUTPUT["braking"]] = 1.0
    for name, value in (("mu_b", MU), ("sigma_mu_b", SIGMA), ("mode", HOLDING), ("calliper_pressure", 0.0)):
        rows[:, OUTPUT[f"{name}_fl"] : OUTPUT[f"{name}_fl"] + 4] = value
    rows[BEGINS:ENDS, OUTPUT["calliper_pressure_fl"] : OUTPUT["calliper_pressure_fl"] + 4] = PRESSURE
    rows[:, N_OUTPUTS : N_OUTPUTS + 4] = 0.0
    rows[:, ACCELERATOR] = 0.0
    return rows


def judged(params: RecordArray, rows: np.ndarray) -> BrakeRow:
    book = BrakeBook(params)
    book.add(np.arange(len(rows)) * 0.01, rows)
    return book.rows[0]


def brake_decel(params: RecordArray) -> float:
    """Deceleration by the four brakes alone, wheels turning with the car."""
    p = params[0]
    torque = 2.0 * p["piston_area"] * p["effective_radius"] * MU * (PRESSURE * BAR - p["push_out_pressure"])
    inert = p["mass"] + (p["wheel_inertia"] / p["wheel_radius"] ** 2).sum()
    return float((torque / p["wheel_radius"]).sum() / inert)


@pytest.mark.parametrize("slope", [-0.6, -0.1, 0.3])
def test_gravity_felt_before_the_braking_counts(params: RecordArray, slope: float) -> None:
    """A braking measured by its speed feels the hill, its brakes do not; wheels share in the inertia."""
    p = params[0]
    level, hill = judged(params, braking()), judged(params, braking(slope))
    inert = p["mass"] + (p["wheel_inertia"] / p["wheel_radius"] ** 2).sum()
    assert hill.decel_predicted - level.decel_predicted == pytest.approx(slope * p["mass"] / inert, rel=1e-6)


def test_gravity_of_the_braking_itself_is_hindsight(params: RecordArray) -> None:
    rows = braking()
    known = judged(params, rows).decel_predicted
    rows[BEGINS:, OUTPUT["accel_x_road"]] += 0.5
    rows[BEGINS:, OUTPUT["mu_b_fl"] : OUTPUT["mu_b_fl"] + 4] *= 1.3
    assert judged(params, rows).decel_predicted == known


@pytest.mark.parametrize("known", [0, 49])
def test_without_half_a_second_before_it_the_road_is_level(params: RecordArray, known: int) -> None:
    """As where a log begins so, or the speed was not known yet."""
    hill, level = braking(0.4), braking()
    for rows in (hill, level):
        rows[: BEGINS - known, OUTPUT["vehicle_speed"]] = np.nan
    assert judged(params, hill).decel_predicted == judged(params, level).decel_predicted


def test_sigma_is_that_of_friction_and_of_motors(params: RecordArray) -> None:
    rows = braking()
    of_friction = brake_decel(params) * SIGMA / MU
    assert judged(params, rows).sigma_decel_predicted == pytest.approx(of_friction, rel=1e-9)
    without = judged(params, rows).decel_predicted
    rows[BEGINS:ENDS, N_OUTPUTS : N_OUTPUTS + 4] = 300.0
    line = judged(params, rows)
    of_motors = params[0]["sigma_motor_torque"] * (line.decel_predicted - without)
    assert line.sigma_decel_predicted == pytest.approx(np.hypot(of_friction, of_motors), rel=1e-9)


@pytest.mark.parametrize(("mode", "learned"), [(NOMINAL, 0), (HOLDING, 1), (FAULT, 0)])
def test_whether_friction_was_learned_before(params: RecordArray, mode: int, learned: int) -> None:
    rows = braking()
    rows[:BEGINS, OUTPUT["mode_fl"]] = mode
    assert judged(params, rows).learned_before == learned


def accelerator(rows: np.ndarray) -> None:
    rows[BEGINS:ENDS, ACCELERATOR] = 30.0


def late_change_of_pedals(rows: np.ndarray) -> None:
    rows[BEGINS : BEGINS + 40, ACCELERATOR] = 30.0


def change_of_pedals(rows: np.ndarray) -> None:
    """The foot is on the accelerator until the pressure is up and when it is down again."""
    rows[: BEGINS + 20, ACCELERATOR] = rows[ENDS - 60 :, ACCELERATOR] = 30.0
    rows[ENDS - 60 : ENDS, OUTPUT["calliper_pressure_fl"] : OUTPUT["calliper_pressure_fl"] + 4] = 2.0


def launch(rows: np.ndarray) -> None:
    """Held by the brakes, then the accelerator."""
    rows[BEGINS:ENDS, OUTPUT["vehicle_speed"]] = 0.0
    rows[BEGINS:ENDS, ACCELERATOR] = 80.0


def driven(share: float) -> Callable[[np.ndarray], None]:
    """Motors at the rear drive with `share` of the force of 40 bar; no accelerator is known."""

    def change(rows: np.ndarray) -> None:
        params = new_params(load_config(Path(__file__).parents[3] / "config" / "suv.toml"))
        p = params[0]
        inert = p["mass"] + (p["wheel_inertia"] / p["wheel_radius"] ** 2).sum()
        torque = share * brake_decel(params) * inert * p["wheel_radius"][2]
        rows[BEGINS:ENDS, N_OUTPUTS + 2 : N_OUTPUTS + 4] = -0.5 * torque
        rows[:, ACCELERATOR] = np.nan

    return change


def tap(rows: np.ndarray) -> None:
    rows[BEGINS + 45 : ENDS, OUTPUT["braking"]] = 0.0


def hold_downhill(rows: np.ndarray) -> None:
    rows[BEGINS:ENDS, OUTPUT["vehicle_speed"]] = 20.0


def speed_lost(rows: np.ndarray) -> None:
    rows[BEGINS:ENDS, OUTPUT["vehicle_speed"]] = np.nan


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda rows: None, ""),
        (accelerator, "accelerator pressed"),
        (late_change_of_pedals, "accelerator pressed"),
        (change_of_pedals, ""),
        (launch, "below 0.5 m/s²"),
        (driven(0.25), "driving torque"),
        (driven(0.15), ""),
        (tap, "shorter than 0.5 s"),
        (hold_downhill, "below 0.5 m/s²"),
        (speed_lost, "inputs lost"),
    ],
)
def test_which_predictions_count(
    params: RecordArray, change: Callable[[np.ndarray], None], reason: str
) -> None:
    rows = braking()
    change(rows)
    assert judged(params, rows).left_out == reason


def test_errors_are_shares_of_what_was_measured() -> None:
    found = errors([2.0, 4.0, 1.0, 5.0], [2.2, 3.8, 1.4, 5.0], [False, True, True, True])
    assert (found.counted, found.nominal) == (4, 1)
    assert found[2:] == pytest.approx((0.075, 0.4, 0.1125))
    nothing = errors([], [], [])
    assert (nothing.counted, nothing.nominal) == (0, 0)
    assert np.isnan(nothing[2:]).all()
