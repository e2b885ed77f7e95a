"""What a braking is expected to do, against closed forms; which predictions count; what others would say."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from brakelab.replay.engine import N_ROW
from brakelab.results.brakes import BrakeBook, BrakeRow
from brakelab.results.prediction import errors, one_scale, running_average
from ecu.algorithm.estimation.joint.whole_filter import USUAL_SPEED
from ecu.contract.params import BAR
from ecu.contract.signals import ACCEL_X, FAULT, HOLDING, N_OUTPUTS, NOMINAL, OUTPUT
from ecu.settings.config import load_config, new_params

MU, SIGMA, PRESSURE, DECEL = 0.42, 0.021, 40.0, 3.5
BEGINS, ENDS = 250, 550
ACCELERATOR = N_OUTPUTS + 4
Change = Callable[[np.ndarray], None]
PARAMS = new_params(load_config(Path(__file__).parents[3] / "config" / "suv.toml"))
P = PARAMS[0]
INERT = float(P["mass"] + (P["wheel_inertia"] / P["wheel_radius"] ** 2).sum())
LEVER = 2.0 * P["piston_area"] * P["effective_radius"] / P["wheel_radius"]  # N of force per Pa and friction
SPEEDS = 30.0 - 0.01 * 0.3 * BEGINS - 0.01 * DECEL * np.arange(ENDS - BEGINS)


def four(rows: np.ndarray, name: str) -> np.ndarray:
    return rows[..., OUTPUT[f"{name}_fl"] : OUTPUT[f"{name}_fl"] + 4]


def column(rows: np.ndarray, name: str) -> np.ndarray:
    return rows[:, OUTPUT[name]]


def braking() -> np.ndarray:
    """2.5 s of coasting at 0.3 m/s^2, 3 s of braking at 40 bar, 1 s of rolling; the car is as configured."""
    rows = np.full((650, N_ROW), np.nan)
    decel = np.repeat([0.3, DECEL, 0.0], [BEGINS, ENDS - BEGINS, 100])
    column(rows, "vehicle_speed")[:] = 30.0 - np.concatenate(([0.0], np.cumsum(decel[:-1]) * 0.01))
    column(rows, "accel_x_road")[:] = -decel
    column(rows, "braking")[:] = 0.0
    column(rows, "braking")[BEGINS:ENDS] = 1.0
    column(rows, "vehicle_mass")[:] = P["mass"]
    column(rows, "overrun")[:] = column(rows, "accel_x_zero")[:] = 0.0
    for name, value in (("mu_b", MU), ("sigma_mu_b", SIGMA), ("mode", HOLDING), ("calliper_pressure", 0.0)):
        four(rows, name)[:] = value
    four(rows, "pressure_zero")[:] = 0.0
    four(rows, "calliper_pressure")[BEGINS:ENDS] = PRESSURE
    rows[:, N_OUTPUTS : N_OUTPUTS + 4] = 0.0
    rows[:, ACCELERATOR] = 0.0
    return rows


def judged(rows: np.ndarray) -> BrakeRow:
    book = BrakeBook(PARAMS)
    book.add(np.arange(len(rows)) * 0.01, rows)
    return book.rows[0]


def linings(mu: float = MU, pressure: float = PRESSURE, inert: float = INERT) -> float:
    """Deceleration by the four brakes alone, wheels turning with the car."""
    return float((LEVER * mu * (pressure * BAR - P["push_out_pressure"])).sum() / inert)


RESISTANCE = float(P["drag_area"] * np.mean(SPEEDS**2) / INERT)
ROLLING = float(P["rolling_resistance"] * 9.81 * P["mass"] / INERT)
HEAVIER = INERT + 0.1 * float(P["mass"])


def motors(rows: np.ndarray) -> None:
    rows[BEGINS:ENDS, N_OUTPUTS : N_OUTPUTS + 4] = 150.0


def heavier(rows: np.ndarray) -> None:
    column(rows, "vehicle_mass")[:] = 1.1 * P["mass"]


def mass_unknown(rows: np.ndarray) -> None:
    column(rows, "vehicle_mass")[:] = np.nan


def rough(rows: np.ndarray) -> None:
    four(rows, "mu_b")[:] = 1.2 * MU


def pressure_zero(rows: np.ndarray) -> None:
    four(rows, "pressure_zero")[:] = 0.6


def overrun(rows: np.ndarray) -> None:
    column(rows, "overrun")[:] = 0.25


def power(rows: np.ndarray) -> None:
    column(rows, "overrun_power")[:] = 5.0


def slide(rows: np.ndarray) -> None:
    """Let a road of ice give 5 mm/s^2 at most, and a fifth less to wheels that slide."""
    column(rows, "grip_limit")[:], column(rows, "grip_knee")[:] = 0.0045, 3.0
    column(rows, "grip_fall")[:], column(rows, "motor_torque_share")[:] = 0.2, 1.0


POWER = float(np.mean(5.0 / SPEEDS - 5.0 / USUAL_SPEED))
MOTORS = float((150.0 / P["wheel_radius"]).sum() / INERT)
REST = RESISTANCE + ROLLING


@pytest.mark.parametrize(
    ("change", "force", "rest"),
    [
        pytest.param(lambda rows: None, linings() + REST, REST, id="as configured but for the friction"),
        pytest.param(rough, linings(1.2 * MU) + REST, REST, id="friction a fifth higher"),
        pytest.param(motors, linings() + REST + MOTORS, REST + MOTORS, id="motors brake"),
        pytest.param(
            heavier,
            linings(inert=HEAVIER) + RESISTANCE * INERT / HEAVIER + 1.1 * ROLLING * INERT / HEAVIER,
            RESISTANCE * INERT / HEAVIER + 1.1 * ROLLING * INERT / HEAVIER,
            id="a tenth heavier",
        ),
        pytest.param(mass_unknown, linings() + REST, REST, id="mass not known: the configured one"),
        pytest.param(pressure_zero, linings(pressure=39.4) + REST, REST, id="pressure sensors 0.6 bar off"),
        pytest.param(overrun, linings() + REST + 0.25, REST + 0.25, id="overrun of a drive"),
        pytest.param(power, linings() + REST + POWER, REST + POWER, id="a drive of constant power"),
        pytest.param(slide, 0.004 + REST, REST, id="wheels slide"),
    ],
)
def test_what_is_expected_of_a_braking(change: Change, force: float, rest: float) -> None:
    rows = braking()
    change(rows)
    line = judged(rows)
    assert line.specific_force_predicted == pytest.approx(force, rel=1e-9)
    assert line.specific_force_rest == pytest.approx(rest, rel=1e-9)
    assert line.decel_predicted == pytest.approx(force, rel=1e-9)


@pytest.mark.parametrize("change", [rough, heavier, overrun], ids=["friction", "mass", "overrun"])
def test_without_learning_it_is_the_configured_car(change: Change) -> None:
    rows = braking()
    change(rows)
    line = judged(rows)
    assert line.specific_force_configured == pytest.approx(linings(0.45) + REST, rel=1e-9)
    assert line.specific_force_configured_rest == pytest.approx(REST, rel=1e-9)


def test_what_the_braking_itself_taught_is_hindsight() -> None:
    rows = braking()
    known = judged(rows)
    four(rows, "mu_b")[BEGINS:] *= 1.3
    column(rows, "vehicle_mass")[BEGINS:] *= 1.1
    column(rows, "accel_x_zero")[BEGINS:] = 0.3
    line = judged(rows)
    assert line.specific_force_predicted == known.specific_force_predicted
    assert line.specific_force_mean == known.specific_force_mean


@pytest.mark.parametrize("zero", [-0.1, 0.0, 0.2])
def test_measured_is_what_the_accelerometer_reads_but_its_zero(zero: float) -> None:
    """On any slope: speed falls as it likes."""
    rows = braking()
    column(rows, "accel_x_zero")[:] = zero
    column(rows, "accel_x_road")[:] += zero
    column(rows, "vehicle_speed")[BEGINS:] += 0.5 * 0.01 * np.arange(400)  # downhill
    assert judged(rows).specific_force_mean == pytest.approx(DECEL)


def test_rows_in_which_the_driver_accelerates_are_no_part_of_it() -> None:
    """The foot is on the accelerator for the first second, and the car does what it likes."""
    rows = braking()
    rows[BEGINS : BEGINS + 100, ACCELERATOR] = 30.0
    column(rows, "accel_x_road")[BEGINS : BEGINS + 100] = 1.0
    four(rows, "calliper_pressure")[BEGINS : BEGINS + 100] = 15.0
    line = judged(rows)
    assert line.specific_force_mean == pytest.approx(DECEL)
    drag = float(P["drag_area"] * np.mean(SPEEDS[100:] ** 2) / INERT)
    assert line.specific_force_predicted == pytest.approx(linings() + drag + ROLLING, rel=1e-9)


@pytest.mark.parametrize(
    ("share", "relative"),
    [pytest.param(np.nan, SIGMA / MU, id="wheel by wheel"), pytest.param(0.03, 0.03, id="of all linings")],
)
def test_sigma_is_that_of_friction_and_of_motors(share: float, relative: float) -> None:
    rows = braking()
    column(rows, "sigma_brake_force")[:] = share
    assert judged(rows).sigma_specific_force == pytest.approx(relative * linings(), rel=1e-9)
    motors(rows)
    of_motors = P["sigma_motor_torque"] * (150.0 / P["wheel_radius"]).sum() / P["mass"]
    both = np.hypot(relative * linings(), of_motors)
    assert judged(rows).sigma_specific_force == pytest.approx(both, rel=1e-9)
    column(rows, "sigma_overrun")[:] = 2.0 * both
    assert judged(rows).sigma_specific_force == pytest.approx(2.0 * both, rel=1e-9)


@pytest.mark.parametrize(("mode", "learned"), [(NOMINAL, 0), (HOLDING, 1), (FAULT, 0)])
def test_whether_friction_was_learned_before(mode: int, learned: int) -> None:
    rows = braking()
    rows[:BEGINS, OUTPUT["mode_fl"]] = mode
    assert judged(rows).learned_before == learned


def accelerator(rows: np.ndarray) -> None:
    rows[BEGINS:ENDS, ACCELERATOR] = 30.0


def change_of_pedals(rows: np.ndarray) -> None:
    """The foot is on the accelerator until the pressure is up and when it is down again."""
    rows[: BEGINS + 20, ACCELERATOR] = rows[ENDS - 60 :, ACCELERATOR] = 30.0


def all_but_a_moment(rows: np.ndarray) -> None:
    rows[BEGINS + 39 : ENDS, ACCELERATOR] = 30.0


def held_at_standstill(rows: np.ndarray) -> None:
    column(rows, "vehicle_speed")[BEGINS:ENDS] = 0.0


def launch(rows: np.ndarray) -> None:
    """Held by the brakes, then the accelerator."""
    held_at_standstill(rows)
    rows[BEGINS:ENDS, ACCELERATOR] = 80.0


def driven(share: float) -> Change:
    """Motors at the rear drive with `share` of the force of 40 bar; no accelerator is known."""

    def change(rows: np.ndarray) -> None:
        torque = share * linings() * INERT * P["wheel_radius"][2]
        rows[BEGINS:ENDS, N_OUTPUTS + 2 : N_OUTPUTS + 4] = -0.5 * torque
        rows[:, ACCELERATOR] = np.nan

    return change


def tap(rows: np.ndarray) -> None:
    column(rows, "braking")[BEGINS + 45 : ENDS] = 0.0


def not_felt(rows: np.ndarray) -> None:
    column(rows, "accel_x_road")[BEGINS:ENDS] = -0.4


def speed_lost(rows: np.ndarray) -> None:
    column(rows, "vehicle_speed")[BEGINS:ENDS] = np.nan


def accelerometer_lost(rows: np.ndarray) -> None:
    column(rows, "accel_x_road")[BEGINS:ENDS] = np.nan


def accelerometer_lost_for_a_second(rows: np.ndarray) -> None:
    column(rows, "accel_x_road")[BEGINS : BEGINS + 100] = np.nan


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda rows: None, ""),
        (accelerator, "driven against the brakes"),
        (all_but_a_moment, "driven against the brakes"),
        (change_of_pedals, ""),
        (held_at_standstill, "stands"),
        (launch, "stands"),
        (driven(0.25), "driven against the brakes"),
        (driven(0.15), ""),
        (tap, "shorter than 0.5 s"),
        (not_felt, "below 0.5 m/s²"),
        (speed_lost, "inputs lost"),
        (accelerometer_lost, "inputs lost"),
        (accelerometer_lost_for_a_second, ""),
    ],
)
def test_which_predictions_count(change: Change, reason: str) -> None:
    rows = braking()
    change(rows)
    assert judged(rows).left_out == reason


def test_errors_are_shares_of_what_was_measured() -> None:
    found = errors([2.0, 4.0, 1.0, 5.0], [2.2, 3.8, 1.4, 5.0])
    assert found.counted == 4
    assert found[1:] == pytest.approx((0.1375, 0.075, 0.4, 0.1125))
    nothing = errors([], [])
    assert nothing.counted == 0
    assert np.isnan(nothing[1:]).all()


# Linings that give 0.8 of what configured friction expects, then 0.9, then 1.2; 0.5 m/s^2 are not theirs.
CONFIGURED, REST_OF_IT = np.array([3.5, 2.5, 4.5]), np.array([0.5, 0.5, 0.5])
SCALES = np.array([0.8, 0.9, 1.2])
MEASURED = SCALES * (CONFIGURED - REST_OF_IT) + REST_OF_IT


def test_a_running_average_knows_what_came_before_and_begins_with_the_configured_friction() -> None:
    known = np.array([1.0, (1.0 + 0.8) / 2.0, (1.0 + 0.8 + 0.9) / 3.0])
    found = running_average(MEASURED, CONFIGURED, REST_OF_IT)
    assert found == pytest.approx(known * (CONFIGURED - REST_OF_IT) + REST_OF_IT)
    assert len(running_average([], [], [])) == 0


def test_one_scale_in_hindsight_is_the_best_of_a_fine_search() -> None:
    def off(scale: float) -> float:
        return float(np.abs((scale * (CONFIGURED - REST_OF_IT) + REST_OF_IT) / MEASURED - 1.0).mean())

    best = min(off(scale) for scale in np.arange(0.5, 1.5, 1e-4))
    found = one_scale(MEASURED, CONFIGURED, REST_OF_IT)
    assert errors(MEASURED, found).mean == pytest.approx(best, abs=1e-4)
    assert len(one_scale([], [], [])) == 0


@pytest.mark.parametrize(("mapped", "left_out", "measured"), [(0, "", DECEL), (1, "inputs lost", np.nan)])
def test_where_no_accelerometer_is_mapped_the_change_of_speed_is_the_measurement(
    mapped: int, left_out: str, measured: float
) -> None:
    params, rows = PARAMS.copy(), braking()
    params[0]["mapped"][ACCEL_X] = mapped
    column(rows, "accel_x_road")[:] = np.nan
    book = BrakeBook(params)
    book.add(np.arange(len(rows)) * 0.01, rows)
    assert book.rows[0].left_out == left_out
    assert book.rows[0].specific_force_mean == pytest.approx(measured, abs=0.02, nan_ok=True)
