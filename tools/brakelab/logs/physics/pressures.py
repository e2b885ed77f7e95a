"""Calliper pressures of a drive against its deceleration.

    -a  ~  sum of the callipers of  2 A_k r_eff mu_nominal (p - p_0) / (m r)  +  motors

Friction may be half or nearly twice the nominal one, so that only a scale beyond shows, also in the brakings
that road and tyres do not limit, and contradicts where the mean is beyond as well: friction that falls with
pressure tilts the line; a wrong scale of one calliper shows against the other side of its axle
(`sides`). Front and rear are exchanged if the rear wheels would have to bear more than the front ones for
their load, and would bear what they do in other cars if they were exchanged: no car is built so. One whose
ECU takes from strong front linings and gives to weak rear ones reads like that as mapped, but not exchanged.
"""

from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Vector, median
from brakelab.logs.physics.line import BRAKING, RATE, fit
from brakelab.logs.physics.samples import Car, InputSeries, Rows
from brakelab.logs.physics.sides import Sides, judge_sides
from brakelab.logs.physics.stuck import clipped_pressures, stuck_pressures
from ecu.bus.units import CONVERSIONS

LEAST_ROWS: Final = int(2 * RATE)
FRICTION: Final = 1.9  # by which friction and mass together may be off
REST: Final = 5.0  # bar, that a released brake may read
TURNED: Final = 0.6  # correlation with the deceleration
NOISE: Final = 4.0  # standard deviations of released brakes, that braking stands out by
OVERRUN: Final = 0.3  # m/s^2, drag and engine
APPLIED: Final = 0.1  # of the greatest pressure, from which a brake is applied
HARD: Final = 2.5  # m/s^2, from which loads tell the axles apart
ALIVE: Final = 0.4  # of the other axle's pressure: below, one has failed
FREE: Final = 0.85  # of the greatest decelerations: below, tyres give most of what the linings ask for
LIKELY: Final = 1.65  # scale by these alone that explains the rest by grip
UNDERBRAKED: Final = 0.5  # of the front wheels' use of their load, that rear ones reach in cars as built
OVERBRAKED: Final = 1.1  # of the front wheels' use of their load, that rear ones never reach


class Pressures(NamedTuple):
    """Findings about pressures, as `brakelab.logs.physics.judge.Judged` has them."""

    contradictions: list[str]
    flaws: list[str]
    checked: list[str]


def judge_pressures(series: InputSeries, car: Car, change: Vector, rows: Rows) -> Pressures:
    """Return what the pressures cannot be.

    `change` [m/s^2] of speed and the `rows` in which the car moves are of shape (n,).
    """
    pressures = series.corners("calliper_pressure")
    if pressures is None:
        return Pressures([], [], [])
    frozen, rows = stuck_pressures(series, change, rows)
    found = _judged(series, car, pressures, change, rows)
    return found._replace(flaws=found.flaws + ([frozen] if frozen else []))


def _judged(series: InputSeries, car: Car, pressures: Vector, change: Vector, rows: Rows) -> Pressures:
    checked = ["calliper_pressure"]
    idle = rows & (change > 0.2)
    rest = np.median(pressures[idle], axis=0) if idle.sum() > LEAST_ROWS else np.zeros(4)
    if np.abs(rest).max() > REST:
        worst = float(rest[np.argmax(np.abs(rest))])
        message = (
            f"calliper_pressure_*: reads {worst:+.1f} bar while the car speeds up;"
            f" add {-worst:+.1f} bar to its offset"
        )
        return Pressures([], [message], checked)
    total = pressures.sum(axis=1)
    greatest = np.percentile(np.abs(total[rows]), 99)
    if idle.sum() > LEAST_ROWS:
        released = total[idle]
        if np.percentile(np.abs(total[rows] - median(released)), 99) < NOISE * released.std():
            return Pressures([], [], [])
    pressed = rows & (change < -BRAKING) & (np.abs(total) > 0.3 * greatest)
    if pressed.sum() < LEAST_ROWS:
        return Pressures([], [], [])
    line = fit(total, np.maximum(-change, 0.0), rows)
    if line.correlation < -TURNED:
        return Pressures(["calliper_pressure_*: turned: falls as the car brakes; factor = -1"], [], checked)
    if line.correlation < 0.2:
        flaw = f"calliper_pressure_*: does not follow the deceleration (correlation {line.correlation:.2f})"
        return Pressures([f"{flaw}; is it another signal?"], [], checked)
    clipped = clipped_pressures(series, change, rows)
    sides = Sides([], []) if clipped else judge_sides(series, car, pressures, pressed)
    unit = _unit(series, car, pressures - rest, change, rows)
    lines = sides.contradictions + unit.contradictions
    if not sides.differ:
        lines += _axles(pressures - rest, change, rows, car)
    return Pressures(lines, sides.flaws + unit.flaws + ([clipped] if clipped else []), checked)


def _axles(pressures: Vector, change: Vector, rows: Rows, car: Car) -> list[str]:
    """Compare what the axles would bear with their loads, as mapped and exchanged."""
    if car.brakes is None:
        return []
    hard = rows & (change < -HARD)
    if hard.sum() < LEAST_ROWS:
        return []
    mean, decel = pressures[hard].mean(axis=0), -float(change[hard].mean())
    front_load = car.brakes.front_load + car.brakes.transfer * decel

    def rear_use(each: Vector) -> float:
        front, rear = each[:2].sum() / front_load, each[2:].sum() / (1.0 - front_load)
        return float(rear / front)

    mapped = rear_use(mean * car.brakes.decel_per_bar)
    exchanged = rear_use(mean[[2, 3, 0, 1]] * car.brakes.decel_per_bar)
    alive = mean[:2].sum() > ALIVE * mean[2:].sum()
    if not (alive and mapped > OVERBRAKED and UNDERBRAKED < exchanged < 1.0 / OVERBRAKED):
        return []
    reason = f"the rear wheels would bear {mapped:.1f} times what the front ones do for their load"
    return [f"calliper_pressure_*: front and rear are exchanged: {reason}; exchange them"]


def _unit(series: InputSeries, car: Car, pressures: Vector, change: Vector, rows: Rows) -> Pressures:
    nothing = Pressures([], [], [])
    if car.brakes is None:
        return nothing
    motors = series.corners("motor_torque")
    others = OVERRUN if motors is None else OVERRUN + motors @ car.brakes.decel_per_torque
    total = pressures.sum(axis=1)
    decel = -change - others
    applied = rows & (total > APPLIED * np.percentile(total[rows], 99))
    linings = pressures @ car.brakes.decel_per_bar
    line = fit(linings, decel, applied)
    least, most = line.span
    if line.correlation < TURNED or (least <= FRICTION and most >= 1.0 / FRICTION):
        return nothing
    free = fit(linings, decel, applied & (decel < FREE * np.percentile(decel[applied], 95))).span
    if 1.0 / LIKELY <= np.sqrt(free[0] * free[1]) <= LIKELY:
        return nothing
    mean = decel[applied].mean() / linings[applied].mean()
    wanted = 1.0 / np.sqrt(least * most)
    fitting = [
        unit
        for unit, (scale, _) in CONVERSIONS["bar"].items()
        if scale != 1.0 and 1.0 / FRICTION < wanted / scale < FRICTION
    ]
    remedy = f'unit = "{fitting[0]}"' if fitting else "check unit and factor, and brakes and mass of CONFIG"
    gives = f"calliper_pressure_*: the car brakes {wanted:.2g} times what these pressures give"
    if 1.0 / FRICTION <= mean <= FRICTION:
        reason = f"{mean:.2g} times on the mean: friction changes with pressure, or {remedy}"
        return Pressures([], [f"{gives}, {reason}"], [])
    return Pressures([f"{gives}; {remedy}"], [], [])
