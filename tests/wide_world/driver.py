"""A stranger's feet and gears: what he asks of brake and engine, every 10 ms.

He brakes where he is faster than he means to be, by the deceleration that the road ahead asks for, with a
pressure that he is used to; he adds what he feels missing, yields some tenths of a second after a wheel has
locked, and presses less from then on.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.jit import kernel

from .route import G, Route
from .state import ROW

LOCKED = 0.3  # slip


class Driver(NamedTuple):
    """Feet."""

    bar_per_decel: float  # bar per m/s^2 he is used to
    pressure: float  # bar, greatest
    press: float  # bar/s
    release: float  # bar/s
    stab: float  # overshoot of the first moment, share
    learning: float  # 1/s, corrects pressure by what he feels
    tremble: float  # share
    reaction: float  # s until he yields to a locked wheel
    overlap: float  # accelerator left while braking begins, share
    overlap_time: float  # s
    acceleration: float  # m/s^2, greatest he asks for


class Engine(NamedTuple):
    """What drives and drags; one of a single gear that does not drag is electric."""

    power: float  # W
    torque: float  # N m at the crank, greatest
    ratios: tuple[float, float, float, float, float, float]  # total, by gear; 0: no such gear
    fastest: float  # rad/s
    slowest: float  # rad/s, down-shift while braking
    drag: float  # N m at the crank
    drag_by_speed: float  # N m s
    inertia: float  # kg m^2 at the crank
    front: float  # share of the front axle
    blip: float  # s without drag after a down-shift
    coast: float  # m/s^2 of regeneration with both pedals free
    regeneration: float  # N m while braking, greatest, all wheels
    blend: float  # share of the braking demand for the motors


@kernel
def change_gear(engine: Engine, gear: int, wheel: float, braking: bool) -> int:
    """Return the gear that a driver takes at this speed of the driven wheels [rad/s]."""
    turning = wheel * engine.ratios[gear]
    if turning > engine.fastest and gear < 5 and engine.ratios[gear + 1] > 0.0:
        return gear + 1
    lowest = engine.slowest if braking else 0.6 * engine.slowest
    if gear > 0 and turning < lowest and wheel * engine.ratios[gear - 1] < 0.97 * engine.fastest:
        return gear - 1
    return gear


@kernel
def meant_ahead(route: Route, place: int, speed: float) -> tuple[float, float]:
    """Return the least speed [m/s] and the deceleration [m/s^2] meant within the next 0.15 s."""
    ahead = min(place + int(0.15 * speed), len(route.speed) - 2)
    least = route.speed[place]
    for k in range(place, ahead + 1):
        least = min(least, route.speed[k])
    return least, route.decel[ahead]


@kernel
def decide(state: NDArray[np.void], route: Route, too_fast: float, demand: float) -> None:
    """Begin a braking, or a stop, or drive on from one."""
    place = int(state.distance)
    if state.standing:
        state.dwell += ROW
        if state.dwell >= state.wait:
            state.standing, state.braking, state.dwell = 0, 0, 0.0
            state.distance = max(state.distance, state.resume)
    elif state.speed < 0.5 and state.braking:
        for k in range(max(place - 3, 0), min(place + 4, len(route.stop))):
            if route.stop[k] > 0.0:
                state.standing, state.wait, state.resume, state.speed = 1, route.stop[k], k + 1.0, 0.0
                state.omega[:] = 0.0
    elif not state.braking and too_fast > 0.0 and demand > 0.8:
        state.braking, state.since = 1, 0.0
        state.applications += 1
        state.trim *= 0.6


@kernel
def press(
    state: NDArray[np.void], driver: Driver, engine: Engine, route: Route, radius: float, tremor: float,
    too_fast: float, demand: float,
) -> float:  # fmt: skip
    """Move the brake pedal; return the torque [N m] that motors regenerate for it.

    Args:
        state: of the car.
        driver: the driver.
        engine: the engine.
        route: the road.
        radius: of the driven wheels [m].
        tremor: standard normal.
        too_fast: speed above the one meant [m/s].
        demand: deceleration meant [m/s^2].
    """
    wanted, recuperated = 0.0, 0.0
    place = int(state.distance)
    if state.standing:
        wanted = 12.0 if 0.3 < state.dwell < state.wait - 0.5 and state.resume > 0.0 else 0.0
    elif state.braking:
        state.since += ROW
        demand += 0.8 * too_fast
        if demand < 0.3 or (too_fast < -1.0 and route.decel[place] < 0.3):
            state.braking = 0
        else:
            fade = min(max(state.speed - 1.0, 0.0) / 3.0, 1.0)
            recuperated = min(engine.blend * demand * state.mass * radius, engine.regeneration) * fade
            rest = state.resistance + (max(state.crank, 0.0) + recuperated) / radius / state.mass
            state.trim += driver.learning * (demand + state.specific_force) / max(demand, 2.0) * ROW
            state.trim = min(max(state.trim, -0.4), 0.6)
            overshoot = 1.0 + driver.stab * np.exp(-state.since / 0.3)
            wanted = max(demand - rest, 0.0) * driver.bar_per_decel * (1.0 + state.trim) * overshoot
            wanted *= state.habit * state.relax * (1.0 + driver.tremble * tremor)
    elif route.tap[place] > 0.0:
        wanted = route.tap[place]
    wanted = min(max(wanted, 0.0), driver.pressure)
    state.line[0] += min(max(wanted - state.line[0], -driver.release * ROW), driver.press * ROW)
    return recuperated


@kernel
def yield_to_lock(state: NDArray[np.void], driver: Driver) -> None:
    """Let go some time after a wheel has locked, and press again."""
    if state.braking and state.speed > 4.0 and np.max(state.slip) > LOCKED:
        state.locked += ROW
        if state.locked > driver.reaction:
            state.relax, state.trim, state.locked = 0.5, min(state.trim, 0.0), 0.0
            state.habit = max(0.97 * state.habit, 0.7)
    state.relax += (1.0 - state.relax) * ROW / 1.0


@kernel
def accelerate(
    state: NDArray[np.void], driver: Driver, engine: Engine, grip: float, radius: float, meant: float
) -> None:
    """Move the accelerator, change gear and write what engine or motors do at the wheels (`crank`)."""
    speed = state.speed
    gear = change_gear(engine, state.gear, speed / radius, state.braking == 1)
    state.blip = engine.blip if gear < state.gear else max(state.blip - ROW, 0.0)
    state.gear = gear
    ratio = engine.ratios[gear]
    available = min(engine.power / max(speed, 3.0), engine.torque * ratio / radius)
    asked = min(2.0 * (meant - speed), driver.acceleration) + state.resistance
    pedal = min(max(min(asked, 0.35 * grip * G) * state.mass / available, 0.0), 1.0)
    if state.braking:
        pedal = driver.overlap if state.since < driver.overlap_time else 0.0
    state.throttle += min(max(pedal * (1 - state.standing) - state.throttle, -0.12), 0.08)
    closed = max(1.0 - state.throttle / 0.1, 0.0) if state.blip == 0.0 and speed > 1.5 else 0.0
    drag = closed * (engine.drag + engine.drag_by_speed * speed / radius * ratio) * ratio
    drag += closed * engine.coast * state.mass * radius * min(max(speed - 1.0, 0.0) / 3.0, 1.0)
    state.crank = (drag - state.throttle * available * radius) * (1 - state.standing)
