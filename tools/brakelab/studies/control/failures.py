"""Failure of a brake, a circuit or half of the pedal during a brake application: remaining deceleration.

Deceleration is the fall of the true speed, relative to the same car and application without the fault in the
same time; from 300 ms after the fault on, down to `LOWEST_SPEED`. The driver keeps to a straight line.
"""

from typing import Final, NamedTuple

import numpy as np

from brakelab.results.text_table import Table
from brakelab.simulation.closed_loop import Drive, new_loop, run
from brakelab.simulation.configured import configured, shipped, with_keys
from brakelab.simulation.faults import Fault
from brakelab.simulation.scenario import Phase, Scenario
from brakelab.studies.accuracy.table import spread
from brakelab.studies.measure import figure
from brakelab.studies.study import Asked, Measured, Study
from ecu.contract.faults import BRAKE_FAILED
from ecu.contract.signals import CORNERS
from ecu.settings.config import Config

CARS: Final = 5
FAILS: Final = 9.0  # s, in the second application
AFTER: Final = 0.3  # s
LONG: Final = 1.0  # s
LOWEST_SPEED: Final = 5.0  # m/s
DECELS: Final = (2.0, 4.0, 6.0)
HALF: Final = {"blending.front": 0.5, "blending.rear": 0.5}


class Left(NamedTuple):
    """Remaining deceleration after a failure, in one brake application."""

    deceleration: float
    """In the second from `AFTER` on, against the sound car [%]."""
    reported_ms: float
    """After the fault; NaN: never."""
    yaw: float
    """Largest yaw rate [deg/s]."""
    beside: float
    """Farthest from the line [m]."""
    slip: float
    """Largest [%], of any wheel that is not let go."""


def braking(decel: float, motors: bool, fault: list[Fault]) -> Scenario:
    """Return the drive of the shipped faults with another deceleration of its second application [m/s^2]."""
    base = shipped("faults/circuit-dead")
    phases = [*base.phase[:-2], Phase(kind="brake", decel=decel, until_speed=LOWEST_SPEED)]
    return base.model_copy(update={"phase": phases, "fault": fault, "blending": motors})


def left_of(drive: Drive, sound: Drive) -> Left:
    """Return the remaining deceleration, by drives of the same car and seed."""
    begin = FAILS + AFTER

    def decel(one: Drive) -> float:
        rows = (one.t >= begin) & (one.t < begin + LONG) & (one.truth["vehicle_speed"] > LOWEST_SPEED)
        return -float(np.polyfit(one.t[rows], one.truth["vehicle_speed"][rows], 1)[0])

    failed = (drive.t >= FAILS) & (drive.truth["vehicle_speed"] > LOWEST_SPEED)
    masks = np.nan_to_num(drive.outputs["active_faults"][failed]).astype(int)
    reports = np.flatnonzero(masks & BRAKE_FAILED)
    slips = [drive.truth[f"slip_{corner}"][failed] for corner in CORNERS]
    return Left(
        100.0 * (decel(drive) / decel(sound) - 1.0),
        1e3 * (float(drive.t[failed][reports[0]]) - FAILS) if len(reports) else np.nan,
        float(np.degrees(np.abs(drive.truth["yaw_rate"][failed]).max())),
        float(np.abs(drive.truth["position_y"][failed]).max()),
        -100.0 * float(np.min(slips)),
    )


def _dead(*corners: str) -> Fault:
    return Fault.model_validate({"kind": "calliper_dead", "t": FAILS, "corner": corners})


FAILURES: Final[dict[str, Fault]] = {
    "calliper front left": _dead("fl"),
    "calliper rear left": _dead("rl"),
    "circuit of the rear axle": _dead("rl", "rr"),
    "diagonal circuit": _dead("fl", "rr"),
    "circuit of the front axle": _dead("fl", "fr"),
    "pedal position, its switch goes on": Fault(kind="invalid", t=FAILS, signal=["pedal_position"]),
    "pedal switch": Fault(kind="invalid", t=FAILS, signal=["pedal_pressed"]),
    "sensor keeps its value, front left": Fault(kind="stuck", t=FAILS, signal=["calliper_pressure_fl"]),
}


def failure_tables() -> list[Table]:
    """Return the tables, each figure as median (least–greatest) over the cars."""
    config, blended = configured(), with_keys(configured("suv-blended"), HALF)
    return [
        *(_table(f"{decel:g} m/s², linings alone", decel, config, False) for decel in DECELS),
        _table("4 m/s², motors at 50 %", 4.0, blended, True),
    ]


def _table(title: str, decel: float, config: Config, motors: bool) -> Table:
    sound = [run(new_loop(braking(decel, motors, []), config, seed)) for seed in range(CARS)]
    rows = []
    for name, fault in FAILURES.items():
        scenario = braking(decel, motors, [fault])
        left = [left_of(run(new_loop(scenario, config, seed)), sound[seed]) for seed in range(CARS)]
        cells = [figure(list(values)) for values in zip(*left, strict=True)]
        reported = "–" if np.isnan(cells[1].median) else spread(cells[1])
        rows.append((name, spread(cells[0]), reported, *map(spread, cells[2:])))
    columns = (
        *("failure", "deceleration against the sound car [%]", "reported after [ms]", "yaw rate [deg/s]"),
        *("beside the line [m]", "largest slip [%]"),
    )
    return Table(title, columns, rows, "")


TEXT: Final = (
    "In the second of two brake applications from 28 m/s, by a driver who keeps the lane, a brake gives "
    "nothing "
    f"any more from t = {FAILS:g} s on. Deceleration is that of the second that begins "
    f"{1e3 * AFTER:g} ms after it, against the same car without the fault. "
    f"{CARS} cars of the wide draw, median (least–greatest). "
    "[control.md](../control.md#brakes-that-fail) says how."
)


def _run(asked: Asked) -> Measured:
    return Measured(failure_tables())


STUDY: Final = Study("Brakes that fail", TEXT, _run)
