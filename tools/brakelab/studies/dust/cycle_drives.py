"""A car over a whole cycle in closed loop: dust, wear, work, heat, grip and faults, true and by its ECU.

The WLTP-Brake cycle is driven trip by trip, each from the disc temperature at which it begins; what linings,
surfaces and ECU have become is handed on. The ECU has no speed reference.
"""

from typing import Any, Final, NamedTuple

import numpy as np

from brakelab.arrays import Array
from brakelab.plant.cycle import CYCLE
from brakelab.simulation.closed_loop import Loop, new_loop, run_blocks
from brakelab.simulation.configured import shipped
from brakelab.simulation.scenario import Scenario, Trace
from brakelab.simulation.trip.wltp_brake import DISC_AT_START, TRIPS
from brakelab.simulation.vehicle_bus import TRUTH_COLUMNS
from brakelab.studies.dust.cycle_cars import Shipped, bedded, with_models
from ecu.algorithm.step import new_state
from ecu.contract.faults import WHEEL_SLIPS
from ecu.contract.signals import OUTPUT
from ecu.settings.annex5 import Z_ORDERED
from ecu.settings.dust import Dust

REAL_DRIVING, WLTP_BRAKE = "real-driving", "wltp-brake"
CYCLES: Final = (REAL_DRIVING, WLTP_BRAKE)
KEPT: Final = ("pad_wear_mass", "brake_heat", "treatment")
MOVING: Final = 3.0  # m/s


class CycleDrive(NamedTuple):
    """Sums of a car over a cycle. Four wheels: shape (4,)."""

    distance: float
    """m"""
    particles: Array
    worn: Array
    """g"""
    work: Array
    """J of the friction brakes."""
    regenerated: float
    charged: float
    """J"""
    hottest: Array
    """degC"""
    rear_ahead: float
    """Grip used by the rear axle less that of the front, the most where Annex 5 orders them."""
    greatest_slip: tuple[float, float]
    """Of front and rear wheels while the linings brake, 0.999 quantile; 0 where they never do."""
    guarded: float
    """s with the slip guard at work."""
    speed_error: float
    """m/s rms beside the trace."""
    particles_per_km: float
    """By the ECU."""
    mass_per_km: float
    """mg/km, by the ECU."""
    true_mass_per_km: float
    """mg/km: the airborne share of the linings' lost mass."""


class _Sums:
    """Sums collected block by block."""

    def __init__(self) -> None:
        self.hottest, self.rear_ahead = np.zeros(4), -1.0
        self.slips: list[Array] = []
        self.guarded, self.squares, self.rows = 0.0, 0.0, 0

    def add(self, truth: Array, outputs: Array, asked: Array) -> None:
        def corners(name: str) -> Array:
            place = TRUTH_COLUMNS.index(f"{name}_fl")
            return truth[:, place : place + 4]

        speed = truth[:, TRUTH_COLUMNS.index("vehicle_speed")]
        self.hottest = np.maximum(self.hottest, corners("disc_temperature").max(axis=0))
        force, load = corners("wheel_force_x"), corners("wheel_force_z")
        rate = -force.sum(axis=1) / load.sum(axis=1)
        front = -force[:, :2].sum(axis=1) / load[:, :2].sum(axis=1)
        rear = -force[:, 2:].sum(axis=1) / load[:, 2:].sum(axis=1)
        moving = speed > MOVING
        ordered = moving & (rate >= Z_ORDERED[0]) & (rate <= Z_ORDERED[1])
        if ordered.any():
            self.rear_ahead = max(self.rear_ahead, float((rear - front)[ordered].max()))
        braking = moving & (corners("brake_torque").sum(axis=1) > 50.0)
        self.slips.append(np.abs(corners("slip")[braking]))
        self.guarded += CYCLE * float(
            (outputs[:, OUTPUT["active_faults"]].astype(np.int64) & WHEEL_SLIPS > 0).sum()
        )
        self.squares += float(((speed - asked) ** 2).sum())
        self.rows += len(speed)


def _high(slips: Array) -> float:
    return float(np.quantile(slips, 0.999)) if slips.size else 0.0


def _scenarios(plant: str, cycle: str, blending: bool) -> list[Scenario]:
    base = shipped(cycle)
    changed: dict[str, Any] = {"plant": plant, "vehicle_speed": "none", "blending": blending}
    base = base.model_copy(update=changed)
    if cycle == REAL_DRIVING:
        return [base]
    return [
        base.model_copy(
            update={
                "trace": Trace(generate="wltp-brake", trip=trip),
                "initial_disc_temperature": (heat, heat),
            }
        )
        for trip, heat in zip(range(1, len(TRIPS) + 1), DISC_AT_START, strict=True)
    ]


def _hand_on(before: Loop, after: Loop) -> None:
    """Let the next trip begin with the linings, surfaces and the ECU's memory of the last."""
    old, new = before.sides.vehicle.state[0], after.sides.vehicle.state[0]
    for name in KEPT:
        new[name] = old[name]
    learned = before.sides.state["learned"].copy()
    after.sides.state[:] = new_state(after.sides.params, learned)


def drive_cycle(car: Shipped, models: tuple[Dust, Dust], cycle: str, minimise: str, seed: int) -> CycleDrive:
    """Drive the drawn car of a seed over one of `CYCLES`."""
    config = with_models(car.config, models, minimise)
    blending = config.blending.front + config.blending.rear > 0.0
    sums, last = _Sums(), None
    distance, regenerated, charged = 0.0, 0.0, 0.0
    particles, worn, work = np.zeros(4), np.zeros(4), np.zeros(4)
    for scenario in _scenarios(car.plant, cycle, blending):
        loop = new_loop(scenario, config, seed)
        for params in (loop.sides.vehicle.params, loop.sides.vehicle.sound):
            bedded(params)
        if last is not None:
            _hand_on(last, loop)
        state = loop.sides.vehicle.state[0]
        worn_before, work_before = state["pad_wear_mass"].copy(), state["brake_heat"].copy()
        trace, begin = loop.sides.vehicle.script.trace, 0
        for block in run_blocks(loop):
            if len(block.truth) == 0:  # the script ended with the block before
                break
            end = begin + len(block.truth)
            sums.add(block.truth, block.outputs, np.interp(CYCLE * np.arange(begin, end), *trace.T))
            outputs, begin = block.outputs[-1], end
        distance += float(state["distance"])
        regenerated += float(state["regenerated"])
        charged += float(state["charged"])
        particles += state["particles"]
        worn += state["pad_wear_mass"] - worn_before
        work += state["brake_heat"] - work_before
        last = loop
    assert last is not None
    slips = np.concatenate(sums.slips)
    share = last.sides.params[0]["airborne_share"]
    return CycleDrive(
        distance,
        particles,
        worn,
        work,
        regenerated,
        charged,
        sums.hottest,
        sums.rear_ahead,
        (_high(slips[:, :2]), _high(slips[:, 2:])),
        sums.guarded,
        float(np.sqrt(sums.squares / sums.rows)),
        float(outputs[OUTPUT["particles_per_km"]]),
        float(outputs[OUTPUT["particle_mass_per_km"]]),
        float(1e6 * (share * worn).sum() / distance),
    )
