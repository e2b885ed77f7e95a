"""Drives for the wear study: cars in closed loop over trips of several drivers and seasons, in a chain.

Each car's ECU keeps its learned values. For every part of a trip (town, country, motorway) the study stores
the increments of the ECU's regressors and the true wear of run-in pads on a mean day.
"""

from typing import Any, Final, NamedTuple

import numpy as np

from brakelab.arrays import Array
from brakelab.plant.wear import RUN_IN, RUN_IN_MASS
from brakelab.results.wear import HALF_WIDTH, PERIOD, regressors_of
from brakelab.simulation.campaigns.wear_blocks import drawn_car
from brakelab.simulation.closed_loop import Loop, new_loop, run_blocks
from brakelab.simulation.configured import configured, shipped
from brakelab.simulation.scenario import Scenario, Trace
from brakelab.simulation.trip.generate import real_driving
from brakelab.simulation.vehicle_bus import TRUTH_COLUMNS
from ecu.algorithm.step import new_state
from ecu.contract.signals import OUTPUT
from ecu.settings.config import new_params

DRIVERS: Final = {"calm": (0.95, 1.10, 5.0), "usual": (1.0, 1.0, 18.0), "lively": (1.08, 0.82, 30.0)}
"""Factors on speed and on time; ambient temperature [degC]."""
PARTS: Final = {"town": 0.335, "country": 0.715, "motorway": np.inf}
"""Share of the trip's distance at which it ends."""
EVERY: Final = 2  # thinning of the generated trip for the scenario's trace, in samples
GRADE_EVERY: Final = 50


class Part(NamedTuple):
    """A part of a trip."""

    driver: str
    road: str
    distance: float
    """m"""
    worn: Array
    """g by the plant, run in, on a mean day; shape (4,)."""
    regressors: Array
    """Added by the ECU; shape (7, 4), as are its errors."""
    friction_error: Array
    temperature_error: Array


class CarDrives(NamedTuple):
    """Results of one car's drives."""

    seed: int
    parts: list[Part]
    friction_share: Array
    """Wear by the ECU's torque over that by the true one, minus 1, of each trip and corner; shape (3, 4)."""
    run_in: Array
    """Factor's amplitude and mass [g] of the linings; shape (2, 4)."""


def trip_scenario(seed: int, driver: str) -> Scenario:
    """Return a trip driven by one of `DRIVERS`."""
    faster, slower, ambient = DRIVERS[driver]
    base = shipped("real-driving")
    trip = real_driving(seed)
    t, speed = slower * trip.t, faster * trip.speed
    keep = np.unique(np.append(np.arange(0, len(t), EVERY), len(t) - 1))
    grade = np.column_stack((t, trip.grade_by_time()))[::GRADE_EVERY]
    trace = Trace(speed=np.column_stack((t, speed))[keep].tolist())
    changed: dict[str, Any] = {"trace": trace, "grade": grade.tolist(), "ambient_temperature": ambient}
    changed["vehicle_speed"] = "none"
    return base.model_copy(update=changed)


def _true_mass(outputs: Array, truth: Array, law: Array) -> Array:
    """Return the wear [g] of a block of cycles by the law with the true torque, shape (4,)."""

    def corners(rows: Array, place: int) -> Array:
        return rows[:, place : place + 4]

    braking = (outputs[:, OUTPUT["braking"]] == 1.0)[:, None]
    torque = braking * corners(truth, TRUTH_COLUMNS.index("brake_torque_fl"))
    omega = np.abs(corners(truth, TRUTH_COLUMNS.index("wheel_speed_fl")))
    heat = corners(outputs, OUTPUT["disc_temperature_fl"])
    x = regressors_of(torque, omega, heat, PERIOD, HALF_WIDTH)
    return np.asarray((law * x).sum(axis=0))


class _Kept(NamedTuple):
    """Sums so far: distance [m], wear [g], regressors and their errors."""

    distance: float
    worn: Array
    regressors: Array
    friction_error: Array
    temperature_error: Array


def _kept(loop: Loop) -> _Kept:
    car, wear = loop.sides.vehicle.state[0], loop.sides.state[0]["learned"]["wear"]
    sums = (wear[name].copy() for name in ("regressors", "friction_error", "temperature_error"))
    return _Kept(float(car["distance"]), car["pad_wear_mass"].copy(), *sums)


def _part(driver: str, road: str, before: _Kept, after: _Kept) -> Part:
    return Part(
        driver,
        road,
        after.distance - before.distance,
        after.worn - before.worn,
        after.regressors - before.regressors,
        after.friction_error - before.friction_error,
        after.temperature_error - before.temperature_error,
    )


def drive_car(seed: int) -> CarDrives:
    """Drive the car of a seed through one trip of every driver; the ECU keeps its learned values."""
    config = configured()
    law = new_params(config)[0]["wear_law"]
    lot = drawn_car(seed)
    parts, shares, learned = [], [], None
    for number, driver in enumerate(DRIVERS):
        scenario = trip_scenario(100 * seed + number, driver)
        loop = new_loop(scenario, config, seed)
        for car in (loop.sides.vehicle.params, loop.sides.vehicle.sound):
            car["wear_row"][:, :, RUN_IN] = 0.0
            car["wear_scale"] = lot["wear_scale"]
        if learned is not None:
            loop.sides.state[:] = new_state(loop.sides.params, learned)
        trace = np.array(scenario.trace.speed if scenario.trace else [])
        length = float(np.trapezoid(trace[:, 1], trace[:, 0]))
        first = before = _kept(loop)
        true, ends = np.zeros(4), iter(PARTS.items())
        road, end = next(ends)
        for block in run_blocks(loop):
            true += _true_mass(block.outputs, block.truth, law)
            if loop.sides.vehicle.state[0]["distance"] > end * length:
                after = _kept(loop)
                parts.append(_part(driver, road, before, after))
                before = after
                road, end = next(ends)
        after = _kept(loop)
        parts.append(_part(driver, road, before, after))
        shares.append((law * (after.regressors - first.regressors)).sum(axis=0) / true - 1.0)
        learned = loop.sides.state["learned"].copy()
    row = lot["wear_row"][0]
    return CarDrives(seed, parts, np.array(shares), row[:, [RUN_IN, RUN_IN_MASS]].T.copy())
