"""Draws of eight trips with a particle counter, the last one for tests: errors of emission models, achievable
error, and the on-board result of the ECU in a simulated car with the same linings."""

from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Array
from brakelab.identify.dust.features import Applications, Recorded, extract
from brakelab.identify.dust.fit import Judged, choose, judge_all, ranges
from brakelab.identify.dust.reader import in_gap
from brakelab.plant.emission import RUN_IN
from brakelab.plant.wear import RUN_IN as WEAR_RUN_IN
from brakelab.simulation.campaigns.dust_trips import (
    APPLICATION,
    COLUMNS,
    CORNER,
    DAY,
    Trip,
    campaign,
    drawn_brake,
)
from brakelab.simulation.closed_loop import new_loop, run_blocks
from brakelab.simulation.configured import configured, with_keys
from brakelab.simulation.vehicle_bus import TRUTH_COLUMNS
from brakelab.stretches import stretches
from brakelab.studies.wear.drives import trip_scenario
from ecu.algorithm.monitoring.wear import WEAR_STATE, restore_wear
from ecu.contract.dust import MODELS
from ecu.contract.records import RecordArray
from ecu.contract.signals import OUTPUT
from ecu.pads import GAUGE, add_measurement
from ecu.settings.config import new_params
from ecu.settings.dust import Dust

PARTICLES: Final = TRUTH_COLUMNS.index("particles_fl")
BRAKING, LAST = OUTPUT["braking"], OUTPUT["particles_last_brake"]
MEASURED_AT: Final = 10e6  # m
LATER: Final = 20  # rows, latest report of an application after it began
QUIET: Final = (0.03, 0.15)
"""Standard deviations of the logarithm, of a day and of an application, of brakes that repeat better."""


class Outcome(NamedTuple):
    """A model on the trip held out; shares."""

    sum_error: float
    without_factor: float
    beside_law: float
    """Of the sum, relative to the counted emission of the law without scatter."""
    vaf: float
    nrmse: float
    covered: float
    known: float
    size: int
    seconds: float
    chosen: bool


class Draw(NamedTuple):
    """One draw of eight trips."""

    models: dict[str, Outcome]
    floor: float
    """Error of the law that emits, which knows all but scatter and day, with a level from trips 1 to 7."""
    counted: float
    """Count on trip 8 over the true emission, minus 1."""


class OnBoard(NamedTuple):
    """A car in closed loop over a trip of real driving."""

    seed: int
    model: str
    error: float
    """Particles of both front brakes by the ECU over those emitted, minus 1."""
    counted_error: float
    """The same of the applications whose particles are counted."""
    counted: float
    """Share of the work."""
    particles_per_km: float
    mass_per_km: float
    """mg/km of all linings, by the ECU."""
    measured_mass_per_km: float
    """mg/km, once the thickness of the linings was measured."""
    true_mass_per_km: float
    """mg/km, the same share of the true wear."""


def as_recorded(trip: Trip, name: str, test: bool, push_out: float) -> Recorded:
    """Return a simulated trip in the form read from its file; `push_out` [bar]."""
    t, speed, pressure, torque, heat, counted, flow = (trip.columns[column] for column in COLUMNS)
    known = np.isfinite(counted)
    shown = np.interp(t, t[known], counted[known])
    counted_here = ~in_gap(t[known], t)
    return Recorded(name, test, t, speed, pressure - push_out, torque, heat, shown, flow, counted_here)


def _applications(made: list[Trip]) -> list[Applications]:
    config = configured("lcv")
    radius = float(new_params(config)[0]["wheel_radius"][CORNER])
    return [
        extract(as_recorded(trip, f"trip {k}", k == len(made), config.front.push_out_pressure), radius)
        for k, trip in enumerate(made, 1)
    ]


def _while_counted(trip: Trip, so_far: Array) -> float:
    """Return how many particles of a trip left the brake while the counter counted."""
    t, shown = trip.columns[COLUMNS[0]], trip.columns[COLUMNS[5]]
    return float(np.diff(so_far, prepend=0.0)[~in_gap(t[np.isfinite(shown)], t)].sum())


def draw_trips(seed: int, quiet: bool = False, vapour: bool = False) -> Draw:
    """Return the models' results for the trips of a seed; `vapour`: the second form of the law emits."""
    day, application = QUIET if quiet else (DAY, APPLICATION)
    made = campaign(seed, day, application, car=drawn_brake(seed, vapour))
    trips = _applications(made)
    trained, test = trips[:-1], trips[-1:]
    judged = judge_all(trained, test, seed)
    chosen = choose(judged)
    emitted, expected = (
        np.array([_while_counted(trip, getattr(trip, name)) for trip in made])
        for name in ("emitted", "expected")
    )
    level = emitted[:-1].sum() / expected[:-1].sum()
    counts = np.array([trip.particles.sum() for trip in trips])
    shown = counts[:-1].sum() / emitted[:-1].sum()  # particles missed by the counter
    models = {}
    for one in judged:
        assert one.test is not None
        said = (1.0 + one.test.sum_error) * counts[-1]
        models[one.name] = Outcome(
            one.test.sum_error,
            (1.0 + one.test.sum_error) / one.factor - 1.0,
            said / (shown * level * expected[-1]) - 1.0,
            one.test.vaf,
            one.test.nrmse,
            one.test.covered,
            one.test.known,
            one.model.size,
            one.seconds,
            one is chosen,
        )
    return Draw(models, level * expected[-1] / emitted[-1] - 1.0, counts[-1] / emitted[-1] - 1.0)


def pictured(seed: int = 0) -> tuple[list[Applications], list[Judged], Judged]:
    """Return trips and models of one draw for its tables and figures."""
    trips = _applications(campaign(seed))
    judged = judge_all(trips[:-1], trips[-1:], seed)
    return trips, judged, choose(judged)


def section(chosen: Judged, trained: list[Applications]) -> Dust:
    """Return the model of an axle's brakes in CONFIG's form."""
    assert chosen.model.on_board is not None
    low, high = ranges(trained)
    return Dust(
        model=MODELS[chosen.model.on_board], numbers=chosen.model.numbers.tolist(), low=low.tolist(),
        high=high.tolist(), factor=chosen.factor, below=chosen.below, above=chosen.above,
    )  # fmt: skip


def mass_after_measurement(params: RecordArray, learned: RecordArray, worn: Array, seed: int) -> float:
    """Return the ECU's mass of particles per kilometre [mg/km] after `MEASURED_AT` like the trip driven.

    The thickness of every lining is measured there, to `GAUGE`; `worn`: true wear of the trip [g], (4,).
    """
    wear = learned[0]["wear"]
    times = MEASURED_AT / float(wear["odometer"])
    for name in ("regressors", "friction_error", "temperature_error", "odometer"):
        wear[name] *= times
    wear["told"], wear["fitted_at"] = 1, 0.0
    random = np.random.default_rng([seed, 47])
    lost = times * worn / params[0]["pad_mass"] + random.normal(0.0, GAUGE, 4)
    for i in range(4):
        add_measurement(wear, i, float(lost[i]), GAUGE)
    state = np.zeros(1, WEAR_STATE)[0]
    restore_wear(params[0], state, learned[0])
    return float(1e6 * (params[0]["airborne_share"] * state["mass"]).sum() / MEASURED_AT)


def _counted_error(rows: Array) -> float:
    """Return the error of the counted applications; rows of braking, last counted, emitted so far."""
    starts, ends = stretches(rows[:, 0] > 0.0).T
    emitted = rows[np.minimum(ends, len(rows) - 1), 2] - rows[np.maximum(starts - LATER, 0), 2]
    said = rows[np.minimum(ends + 1, len(rows) - 1), 1]
    known = np.isfinite(said)
    return float(said[known].sum() / emitted[known].sum() - 1.0)


def drive_on_board(seed: int) -> OnBoard:
    """Drive a van in closed loop whose ECU runs the trips' model for its own linings."""
    trips = _applications(campaign(seed))
    judged = judge_all(trips[:-1], [], seed)
    chosen = choose(judged)
    config = with_keys(configured("lcv"), {"front.dust": section(chosen, trips[:-1])})
    scenario = trip_scenario(5000 + seed, "usual").model_copy(update={"plant": "lcv"})
    loop = new_loop(scenario, config, seed)
    brake = drawn_brake(seed)
    for car in (loop.sides.vehicle.params, loop.sides.vehicle.sound):
        car["emission_row"] = brake["emission_row"]
        car["emission_row"][:, :, RUN_IN] = 0.0  # bedded
        car["emission_scale"] = brake["emission_scale"]
        car["wear_row"][:, :, WEAR_RUN_IN] = 0.0
    rows = []
    for block in run_blocks(loop):
        last = block.outputs[-1]
        emitted = block.truth[:, PARTICLES] + block.truth[:, PARTICLES + 1]
        rows.append(np.column_stack([block.outputs[:, [BRAKING, LAST]], emitted]))
    car = loop.sides.vehicle.state[0]
    kept = loop.sides.state[0]["learned"]["dust"]
    km = 1e-3 * float(car["distance"])
    params = loop.sides.params[0]
    learned = loop.sides.state["learned"].copy()
    return OnBoard(
        seed,
        chosen.name,
        float(kept["particles"] / car["particles"][:2].sum() - 1.0),
        _counted_error(np.concatenate(rows)),
        float(kept["told_work"] / kept["work"]),
        float(last[OUTPUT["particles_per_km"]]),
        float(last[OUTPUT["particle_mass_per_km"]]),
        mass_after_measurement(loop.sides.params, learned, car["pad_wear_mass"], seed),
        float(1e3 * (params["airborne_share"] * car["pad_wear_mass"]).sum() / km),
    )
