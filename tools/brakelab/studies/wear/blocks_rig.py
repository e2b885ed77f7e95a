"""A road block and its reproduction on the dynamometer: the rule-based controller of Figure 7.5.

Road: the brake slows its part of the car with drag and rolling resistance (7.20), in the road's air, at the
road's times. Dynamometer: no resistance (7.21, T_R = 0) and less air; the next application starts

    once the disc has cooled to its reference temperature, or to `CHECK_OFF`, whichever is higher;
    the flywheel runs up to the reference speed; the deceleration is held down to the reference end speed

Both hold the same deceleration profile, friction and wear follow the plant's laws; the rig of
`brakelab.plant.wear_rig`, which keeps the road's times instead, is compared in the tests.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Array
from brakelab.identify.wear.programme import CHECK_OFF
from brakelab.plant.disc import cooling_rate, disc_step
from brakelab.plant.friction.law import START
from brakelab.plant.friction.laws import friction
from brakelab.plant.jit import Record, kernel
from brakelab.plant.records import RecordArray
from brakelab.plant.wear import running_in, wear_rate
from brakelab.plant.wear_rig import AIR, FAN, LOWEST_SPEED, RAMP

STEP: Final = 5e-3  # s
COARSE: Final = 0.5  # s, while nothing brakes
RUN_UP: Final = 2.0  # m/s^2 of the flywheel. Assumption
LONGEST_WAIT: Final = 1800.0  # s, for the disc to cool
GRAVITY: Final = 9.81


class Corner(NamedTuple):
    """A brake with its part of the car."""

    car: RecordArray
    wheel: int
    mass: float
    """kg"""
    radius: float
    """Of the tyre, m."""
    rolling: float
    """Resistance, N."""
    drag: float
    """N s^2/m^2"""


class Done(NamedTuple):
    """Applications as run, each of shape (n,)."""

    energy: Array
    """J"""
    seconds: Array
    heat_in: Array
    """degC"""
    heat: Array
    """Mean over the energy, degC."""
    worn: Array
    """g"""
    waited: Array
    """s"""


def corner_of(car: RecordArray, wheel: int) -> Corner:
    """Return a brake of the simulated car with its share of mass and resistances."""
    share = 0.325 if wheel < 2 else 0.175
    row = car[0]
    mass = share * float(row["mass"])
    rolling = mass * GRAVITY * float(row["rolling_resistance"])
    return Corner(
        car, wheel, mass, float(row["free_radius"][wheel]) - 0.01, rolling, share * float(row["drag_factor"])
    )


def energy_error(corner: Corner, v_in: float, v_end: float, decel: float) -> float:
    """Return (7.21) minus (7.20) over (7.21) in closed form, for a constant deceleration [m/s^2]."""
    mean = corner.rolling + 0.5 * corner.drag * (v_in**2 + v_end**2)
    return mean / (corner.mass * decel)


def run_stops(corner: Corner, stops: Array, worn: float, references: Array | None = None) -> Done:
    """Run applications on the road, or with `references` [degC], shape (n,), on the dynamometer.

    `stops`: speed before and after [m/s], deceleration [m/s^2], seconds before; shape (n, 4). `worn`: off
    both pads before [g].
    """
    done, heat = np.zeros((len(stops), 6)), AIR
    for k, (first, last, decel, gap) in enumerate(stops.tolist()):
        waited = gap
        if references is None:
            heat = _cool(corner, heat, gap, first)
        else:
            heat, waited = _wait(corner, heat, max(float(references[k]), CHECK_OFF), first)
        air = 1.0 if references is None else FAN
        resists = references is None
        energy, seconds, warm, lost, after = _stop(
            corner, (first, max(last, LOWEST_SPEED), decel), air, resists, worn, heat
        )
        done[k] = energy, seconds, heat, warm, lost, waited
        worn, heat = worn + lost, after
    return Done(*done.T)


@kernel
def _cool(corner: Record, heat: float, seconds: float, speed: float) -> float:
    row = corner.car[0]
    rate = cooling_rate(row.cooling[corner.wheel], row.cooling_by_speed[corner.wheel], speed, 0.0)
    return AIR + (heat - AIR) * math.exp(-rate * seconds)


@kernel
def _wait(corner: Record, heat: float, reference: float, speed: float) -> tuple[float, float]:
    """Return the disc's temperature and the time when the flywheel has run up, by Figure 7.5."""
    waited = 0.0
    while heat > reference and waited < LONGEST_WAIT:
        heat = _cool(corner, heat, COARSE, FAN * speed)
        waited += COARSE
    run_up = speed / RUN_UP
    return _cool(corner, heat, run_up, FAN * 0.5 * speed), waited + run_up


@kernel
def _stop(
    corner: Record, profile: tuple[float, float, float], air: float, resists: bool, worn: float, heat: float
) -> tuple[float, float, float, float, float]:
    """Return energy [J], seconds, mean temperature, wear [g] and the temperature after one application."""
    row, i, radius = corner.car[0], corner.wheel, corner.radius
    law, numbers, wear_row = row.friction_law[i], row.friction_row[i], row.wear_row[i]
    area, reach = row.piston_area[i], row.effective_radius[i]
    speed, last, decel = profile
    cooling = cooling_rate(row.cooling[i], row.cooling_by_speed[i], air * speed, 0.0)
    memory, mu, t = numbers[START], 0.3, 0.0
    energy = warm = lost = 0.0
    while speed > last:
        share = min(t / RAMP, 1.0)
        resistance = corner.rolling + corner.drag * speed * speed if resists else 0.0
        slowing = max(share * decel, resistance / corner.mass)
        force = max(corner.mass * slowing - resistance, 0.0)
        torque, omega = force * radius, speed / radius
        pressure = torque / (2.0 * area * reach * max(mu, 0.05))
        memory, now = friction(law, numbers, memory, pressure, reach * omega, slowing / radius, heat, STEP)
        mu = row.friction_scale[i] * now
        normal = 2.0 * pressure * area
        rate = wear_rate(wear_row, normal, reach * omega, pressure, heat)
        lost += STEP * row.wear_scale[i] * running_in(wear_row, worn + lost) * rate
        work = STEP * torque * omega
        energy, warm = energy + work, warm + work * heat
        heat = disc_step(heat, row.heating[i], cooling, torque * omega, AIR, STEP)
        speed -= STEP * max(slowing, 1e-3)
        t += STEP
    return energy, t, warm / energy if energy else heat, lost, heat
