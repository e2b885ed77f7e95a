"""Trips: brake applications of a drive on the simulated dynamometer, as section 2.4.2 takes them from a car.

Speeds and decelerations are drawn; most of them are gentle (Chapter 1: more than 80 % below 2 m/s^2), the
demand of some falls. Between them the disc cools at the speed of the drive. Beside the measured temperature
stands that of a lumped model as a car has it: heated by pressure times nominal friction, its constants
wrong by 5 %.
"""

from typing import Final, NamedTuple

import numpy as np

from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.dynamometer import Bench
from brakelab.identify.friction.recording import RATE, THRESHOLD, joined
from brakelab.identify.friction.stops import Stops, find_stops
from brakelab.plant.disc import cooling_rate, disc_step
from brakelab.plant.dynamometer import DECELERATION, new_stop
from brakelab.plant.dynamometer_programme import KMH
from brakelab.plant.jit import Record, kernel

BRAKINGS: Final = 200
NOMINAL: Final = 0.45
HEATING_OFF: Final = 1.05
COOLING_OFF: Final = 0.95
GENTLE: Final = 1.0  # m/s^2, up to here
MILD: Final = 1.5  # m/s^2, from here
LOW: Final = 60.0 * KMH
HIGH: Final = 80.0 * KMH


class Trip(NamedTuple):
    """A drive: its stops, and the same with the lumped model's temperature."""

    stops: Stops
    lumped: Stops


def drive(bench: Bench, columns: Columns, seed: int, brakings: int = BRAKINGS) -> Trip:
    """Return a trip of so many brake applications on `bench`, drawn by `seed`."""
    random = np.random.default_rng(seed)
    rig = bench.rig[0]
    ambient, still, by_speed = rig["ambient"], rig["cooling"], rig["cooling_by_speed"]
    lever = 2.0 * rig["piston_area"] * rig["effective_radius"]
    lumped = bench.temperature
    parts, estimated = [], []
    for _ in range(brakings):
        speed = float(random.uniform(30.0, 130.0)) * KMH
        end = speed * float(random.uniform(0.1, 0.7))
        wanted = float(np.clip(1.1 * np.exp(0.55 * random.standard_normal()), 0.4, 3.5))
        fall = float(random.choice([0.0, 0.15]))
        pause = 15.0 + float(random.exponential(40.0))
        bench.wait(pause, speed)
        rate = COOLING_OFF * cooling_rate(still, by_speed, speed, 0.0)
        lumped = ambient + (lumped - ambient) * np.exp(-rate * pause)
        stop = new_stop(DECELERATION, speed, end, bench.temperature, deceleration=wanted)
        seen = bench.measure(stop, fall)
        parts.append(seen)
        powers = NOMINAL * lever * np.maximum(seen.pressure - THRESHOLD, 0.0) * seen.speed
        cooling = COOLING_OFF * cooling_rate(still, by_speed, 0.5 * (speed + end), 0.0)
        along = np.empty(len(powers))
        lumped = lump(lumped, HEATING_OFF * rig["heating"], cooling, powers, ambient, 1.0 / RATE, along)
        estimated.append(along)
    recording = joined(parts)
    second = recording._replace(temperature=np.concatenate(estimated))
    return Trip(find_stops(recording, columns, "trip"), find_stops(second, columns, "trip"))


@kernel
def lump(
    temperature: float, heating: float, cooling: float, power: Record, ambient: float, dt: float, out: Record
) -> float:
    """Write the temperature of 3.7 before every sample of `power` [W]; return the one after the last."""
    for k in range(len(power)):
        out[k] = temperature
        temperature = disc_step(temperature, heating, cooling, power[k], ambient, dt)
    return temperature


def manoeuvres(stops: Stops, radius: float) -> dict[str, np.ndarray]:
    """Return the numbers of the applications of each kind of Table 2.1; `radius` [m]: tyre over effective.

    A mild from low speed, B mild from high speed, C gentle from low speed, D gentle from high speed.
    """
    speed = radius * stops.start_speed
    ends = stops.first[1:] - 1
    duration = (ends - stops.first[:-1]) * stops.dt
    slowed = (speed - radius * stops.speed[ends]) / duration
    mild, gentle = slowed >= MILD, slowed <= GENTLE
    low, high = speed <= LOW, speed >= HIGH
    kinds = {"A": mild & low, "B": mild & high, "C": gentle & low, "D": gentle & high}
    return {name: np.flatnonzero(kind) for name, kind in kinds.items()}
