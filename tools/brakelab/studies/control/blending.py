"""Brake blending in closed loop: hand-over of torque, loss of motors, effect of wrong friction on the
sum (sections 5.3, 5.7; Figure 5.8).

Torque is that of linings and motors of all wheels, true; the demand is m a r (5.1) with the radius of the
configuration and the mass that the ECU knows. Counted from the full demand down to 1 km/h. Where the ECU uses
the true friction, the remaining error is that of blending with hydraulics other than modelled.
"""

from collections.abc import Callable
from functools import partial
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector
from brakelab.plant.friction.constant import Constant
from brakelab.plant.friction.laws import LAWS
from brakelab.plant.sensor_errors import SensorErrors
from brakelab.results.text_table import Table
from brakelab.simulation.accuracy import FULL, window
from brakelab.simulation.closed_loop import Drive, Loop, new_loop, run
from brakelab.simulation.configured import configured, shipped, with_keys
from brakelab.simulation.faults import Fault
from brakelab.simulation.scenario import Phase, Scenario
from brakelab.studies.accuracy.observers import JOINT, ORDINARY, drive_car
from brakelab.studies.accuracy.observers_cases import Setup
from brakelab.studies.accuracy.table import spread
from brakelab.studies.measure import figure
from brakelab.studies.study import Asked, Measured, Study
from ecu.contract.signals import CORNERS
from ecu.settings.config import Config, new_params

CARS: Final = 5
TOLERANCE: Final = 2.0  # %
LOWEST_SPEED: Final = 1.0 / 3.6  # m/s
FADES: Final = 4.5  # m/s, from here the motors may hand over
BEFORE: Final = 4.0  # m/s above it, compared with
LOSS: Final = 3.5  # s, in the scenario motor-loss
LIMIT_SHOWS: Final = 0.015  # s after it the motors' torque is gone
WRONG: Final = 0.15  # of the friction (section 5.6)
SHARES: Final = (0.0, 0.2, 0.4, 0.6, 0.8)


class Changing(NamedTuple):
    """Torque during the hand-over in one brake application."""

    below: float
    """The demand by at most [%]."""
    above: float
    outside_ms: float
    """The longest time outside `TOLERANCE`."""
    fading: float
    """From the error before the motors fade towards standstill, by at most [%]."""
    motors: float
    """Share of the braking energy that the motors take [%]."""


class Loss(NamedTuple):
    """Torque in one brake application with a loss of its motors."""

    within_ms: float
    """After the loss; from then on the sum is within `TOLERANCE` of the demand."""
    missing: float
    """Of the linings' earlier share, at most [% of the demand]."""
    above: float
    """The demand after the loss by at most [%]."""


def blended(share: float, compensate: bool = True) -> Config:
    """Return config/suv.toml with this share of the motors on both axles, its friction compensated or not."""
    keys = {"blending.front": share, "blending.rear": share}
    return with_keys(configured(), keys if compensate else keys | {"control.compensation": "off"})


def stop(decel: float) -> Scenario:
    """Return the scenario hand-over with another deceleration [m/s^2]."""
    base = shipped("hand-over")
    return base.model_copy(
        update={"phase": [base.phase[0], Phase(kind="brake", decel=decel, until_speed=0.0)]}
    )


def torques(drive: Drive) -> tuple[Vector, Vector]:
    """Return the torques of all linings and of all motors [N m], shape (n,) each."""
    linings, motors = (
        np.sum([drive.truth[f"{stem}_{corner}"] for corner in CORNERS], axis=0)
        for stem in ("brake_torque", "motor_torque")
    )
    return linings, motors


def demanded(drive: Drive, config: Config) -> Vector:
    """Return the demanded torque (5.1) for the sum of the same row [N m], shape (n,).

    By the mass learned by the ECU so far.
    """
    radius = float(new_params(config)["wheel_radius"].mean())
    torque = drive.outputs["vehicle_mass"] * drive.outputs["decel_demand_total"] * radius
    return np.concatenate([torque[:1], torque[:-1]])  # a demand acts in the cycle after it


def counted(drive: Drive) -> NDArray[np.bool_]:
    """Return the rows from the full demand to `LOWEST_SPEED`, shape (n,)."""
    demand = drive.outputs["decel_demand_total"]
    reached = int(np.argmax(demand >= FULL * np.nanmax(demand)))
    rows: NDArray[np.bool_] = (np.arange(len(demand)) > reached) & (
        drive.truth["vehicle_speed"] > LOWEST_SPEED
    )
    return rows


def _longest(flags: NDArray[np.bool_]) -> int:
    """Return the length of the longest run of true values."""
    ends = np.flatnonzero(~np.concatenate([[False], flags, [False]]))
    return int(np.diff(ends).max()) - 1


def changing(drive: Drive, config: Config) -> Changing:
    """Return how well the sum followed the demand."""
    rows = counted(drive)
    linings, motors = (torque[rows] for torque in torques(drive))
    error = 100.0 * ((linings + motors) / demanded(drive, config)[rows] - 1.0)
    speed = drive.truth["vehicle_speed"][rows]
    taken = float(motors @ speed) / float((linings + motors) @ speed)
    outside = _longest(np.abs(error) > TOLERANCE)
    before = float(np.median(error[(speed > FADES) & (speed < FADES + BEFORE)]))
    fading = float(np.abs(error[speed <= FADES] - before).max())
    return Changing(-float(error.min()), float(error.max()), 10.0 * outside, fading, 100.0 * taken)


def loss(drive: Drive, config: Config) -> Loss:
    """Return the compensation of a loss at `LOSS`."""
    linings, motors = torques(drive)
    rows = counted(drive) & (drive.t > LOSS + LIMIT_SHOWS)
    wanted = demanded(drive, config)[rows]
    total = (linings + motors)[rows]
    error = 100.0 * (total / wanted - 1.0)
    outside = np.flatnonzero(np.abs(error) > TOLERANCE)
    first = rows[: np.argmax(rows)].size + (int(outside[-1]) + 1 if len(outside) else 0)
    before = linings[np.argmax(rows) - 3]
    missing = 100.0 * float(np.max((before - total) / wanted))
    return Loss(round(1e3 * float(drive.t[first] - LOSS)), max(missing, 0.0), float(error.max()))


def freeze_friction(loop: Loop) -> None:
    """Freeze the linings' friction at its present value, and the discs' temperature."""
    params, constant = loop.sides.vehicle.params, LAWS.index(Constant)
    params["friction_law"], params["friction_scale"] = constant, 1.0
    params["friction_row"][0, :, :2] = [(1.0, mu) for mu in loop.sides.vehicle.state["mu_b"][0]]
    for name in ("heating", "cooling", "cooling_by_speed"):
        params[name] = 0.0


def wrong_friction(share: float, ratio: float, compensate: bool, seed: int) -> float:
    """Return the error [%] of the sum to the demand, root mean square over the demand's mean (Figure 5.8).

    The configured nominal friction is `ratio` times the true one, which is constant.
    """
    config = blended(share, compensate)
    loop = new_loop(shipped("hand-over"), config, seed)
    true = loop.sides.vehicle.state["mu_b"][0]
    rear = ratio * float(true[2])
    config = with_keys(config, {"front.mu_nominal": ratio * float(true[0]), "rear.mu_nominal": rear})
    loop = new_loop(shipped("hand-over"), config, seed)
    freeze_friction(loop)
    drive = run(loop)
    rows = window(drive)
    mass = float(loop.sides.vehicle.params["mass"][0])
    force = np.sum(
        [
            (drive.truth[f"brake_torque_{c}"] + drive.truth[f"motor_torque_{c}"])
            / drive.truth[f"rolling_radius_{c}"]
            for c in CORNERS
        ],
        axis=0,
    )
    decel, wanted = (force / mass)[rows], drive.truth["decel_demand"][rows]
    return float(100.0 * np.sqrt(np.mean((decel - wanted) ** 2)) / np.mean(wanted))


def _over_cars(of: Callable[[int], NamedTuple]) -> list[str]:
    """Return each field of the results of `of` as median (least–greatest) over the cars."""
    return [spread(figure(values)) for values in zip(*map(of, range(CARS)), strict=True)]


def _drive(scenario: Scenario, config: Config, seed: int) -> Drive:
    return run(new_loop(scenario, config, seed), ideal=True)


def _drive_as_learned(scenario: Scenario, config: Config, seed: int) -> Drive:
    """Drive with the ECU's own friction, after ten minutes of ordinary driving in the same car."""
    _, learned = drive_car(Setup(shipped(ORDINARY), config), JOINT, seed)
    drive, _ = drive_car(Setup(scenario, config), JOINT, seed, learned)
    return drive


def _changing_of(
    scenario: Scenario, config: Config, drive: Callable[[Scenario, Config, int], Drive], seed: int
) -> Changing:
    return changing(drive(scenario, config, seed), config)


def _changing_table() -> Table:
    torque_unknown = {"motor_torque": SensorErrors(lost_from=LOSS)}
    cases: dict[str, tuple[Scenario, float]] = {
        **{f"to rest at 4 m/s², f = {f:g}": (shipped("hand-over"), f) for f in (*SHARES[1:], 1.0)},
        **{f"to rest at {decel:g} m/s², f = 1": (stop(decel), 1.0) for decel in (2.0, 6.0, 8.0)},
        **{f"160 kW less in 0.5 s, f = {f:g}": (shipped("charge-limit"), f) for f in (0.4, 0.8, 1.0)},
        "torque no longer reported, f = 0.8": (
            shipped("hand-over").model_copy(update={"sensor": torque_unknown}),
            0.8,
        ),
    }
    rows = []
    for name, (scenario, share) in cases.items():
        rows.append((name, *_over_cars(partial(_changing_of, scenario, blended(share), _drive))))
    for share in (0.4, 0.8, 1.0):
        own = partial(_changing_of, shipped("hand-over"), blended(share), _drive_as_learned)
        rows.append((f"to rest at 4 m/s², f = {share:g}, own friction", *_over_cars(own)))
    columns = (
        *("case", "below [%]", "above [%]", "longest outside 2 % [ms]", "while they fade [%]"),
        "motors' share [%]",
    )
    below = (
        "How far the sum of the torques is below and above the demand at most, from the full demand to "
        f"{3.6 * LOWEST_SPEED:g} km/h. While they fade: how far its error goes, below {FADES:g} m/s, from "
        "what it was before. Motors' share: of the braking energy. The true friction is given, except in "
        "the last rows: there the ECU uses what it has learned in ten minutes of ordinary driving."
    )
    return Table("Torque that changes hands", columns, rows, below)


def _faulty(*faults: Fault) -> Scenario:
    """Return the scenario hand-over with faults."""
    return shipped("hand-over").model_copy(update={"fault": list(faults)})


def _loss_table() -> Table:
    gone = Fault(kind="motor_lost", t=LOSS)
    hidden = Fault(kind="stuck", t=LOSS, signal=["motor_limit"])
    mute = Fault(kind="lost", t=LOSS, message=["MotorFront", "MotorRear"])
    cases: dict[str, tuple[Scenario, float]] = {
        **{f"limit 0 is reported, f = {f:g}": (shipped("motor-loss"), f) for f in (*SHARES[1:], 1.0)},
        "limit reported as before, f = 0.8": (_faulty(gone, hidden), 0.8),
        "limit reported as before, f = 1": (_faulty(gone, hidden), 1.0),
        "frames of the motors stop, f = 0.8": (_faulty(gone, mute), 0.8),
        "frames of the motors stop, f = 1": (_faulty(gone, mute), 1.0),
    }
    rows = []
    for name, (scenario, share) in cases.items():
        config = blended(share)

        def one(seed: int, scenario: Scenario = scenario, config: Config = config) -> Loss:
            return loss(_drive(scenario, config, seed), config)

        rows.append((name, *_over_cars(one)))
    columns = ("case", "within 2 % after [ms]", "below the linings before [% of the demand]", "above [%]")
    below = (
        f"All motors are lost at t = {LOSS:g} s; the sum is counted from then on. The greatest above is that "
        "of a car whose hydraulics overshoot: half the damping and half as much inertia again as (A.17)."
    )
    return Table("Motors lost", columns, rows, below)


def _wrong_friction_table() -> Table:
    rows = []
    for share in SHARES:
        cells = []
        for ratio in (1.0 + WRONG, 1.0 - WRONG):
            for compensate in (False, True):
                errors = [wrong_friction(share, ratio, compensate, seed) for seed in range(CARS)]
                cells.append(spread(figure(errors)))
        rows.append((f"{share:g}", *cells))
    columns = ("f", "under-braking", "compensated", "over-braking", "compensated ")
    below = (
        "Figure 5.8: root mean square of the error over the demand, as deceleration: the sum of the torques "
        "over mass and radius of the car. Friction is a constant, the configured one "
        f"{100.0 * WRONG:.0f} % too high (under-braking) or too low. Nothing was learned before. Counted "
        "from 0.5 s after the full demand to 15 km/h. Without compensation the error holds that of the "
        "configured mass too (up to 3 %)."
    )
    return Table("Friction wrong by 15 %: error of the deceleration [%]", columns, rows, below)


def blending_tables() -> list[Table]:
    """Return the tables, each figure as median (least–greatest) over the cars."""
    return [_changing_table(), _loss_table(), _wrong_friction_table()]


TEXT: Final = (
    "Brake applications from 75 km/h in closed loop with the ECU of config/suv.toml, whose motors take "
    "the share f on "
    f"both axles. {CARS} cars, drawn from config/plant/suv.toml; figures are median (least–greatest) over "
    "them. Torque is that of linings and motors, true; the demand is m a r with mass and radius of the "
    "configuration (5.1). Cars of the wide draw: their hydraulics, motors and frictions are not those that "
    "the ECU knows. Where it is given the true friction, what is left is the error of blending."
)


def _run(asked: Asked) -> Measured:
    return Measured(blending_tables())


STUDY: Final = Study("Motors and linings brake together", TEXT, _run)
