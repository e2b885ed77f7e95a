"""Eight trips of a light commercial vehicle with a particle counter at its front right brake (Table 8.1), as
recorded by a laboratory: columns at 10 Hz with sensors' errors, the counter once a second, the last held out.

The brake follows generated trips of real driving by drivers that differ (`driving_cycle.py`); it is not the
whole car in closed loop. Torque is that of an ECU's estimate, with a relative error constant over a trip.
"""

import csv
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.random import Generator

from brakelab.arrays import Array
from brakelab.plant.description import load_plant
from brakelab.plant.draw import draw, load_widths
from brakelab.plant.emission_rig import (
    CONCENTRATION,
    EMITTED,
    HEAT,
    PRESSURE,
    SPEED,
    STEP,
    TORQUE,
    TRIP,
    T,
    run_trip,
)
from brakelab.plant.records import RecordArray
from brakelab.simulation.trip.generate import real_driving
from brakelab.simulation.trip.table import distance_driven
from ecu.settings.resources import resource

TRIPS: Final = 8
CORNER: Final = 1  # front right
COLUMNS: Final = (
    "t",
    "vehicle_speed",
    "calliper_pressure_fr",
    "brake_torque_fr",
    "disc_temperature_fr",
    "particle_concentration",
    "tunnel_flow",
)
# Assumptions, all of them. Two values: bounds of a uniform distribution.
FASTER: Final = (0.88, 1.05)  # of the trip's speed
SLOWER: Final = (0.85, 1.30)  # of its time
CREW: Final = 1.15  # of the mass: two people and the counter
AMBIENT: Final = (2.0, 30.0)  # degC
OVERRUN: Final = (0.10, 0.22)  # m/s^2
DAY: Final = 0.10  # standard deviation of the logarithm of a day's emission
APPLICATION: Final = 0.45  # likewise of an application's
WANDER: Final = 0.30  # likewise of the background
WANDER_S: Final = 120.0
PRESSURE_NOISE: Final = 0.6  # bar, at 10 Hz
TORQUE_ERROR: Final = 0.03  # share, of a trip
TORQUE_NOISE: Final = 0.02  # share, of a sample
HEAT_ERROR: Final = 3.0  # K, of a trip
HEAT_NOISE: Final = 0.5  # K
SPEED_NOISE: Final = 0.03  # m/s
COUNT_NOISE: Final = 0.04  # share, of a sample
COUNT_GAIN: Final = 0.04  # share, of a trip
COUNT_DRIFT: Final = 0.03  # share, from the first to the last minute of a trip
COUNT_ZERO: Final = 5.0  # 1/cm^3, of a trip
DROP_OUT: Final = (0.0, 40.0)  # s of a trip without a count
FLOW: Final = 0.07  # m^3/s
FLOW_NOISE: Final = 0.01  # share
ACTIVATION: Final = (8e3, 16e3)  # K, of vapours: 65 to 130 kJ/mol
DRIVEN: Final = (20e6, 60e6)  # J, of the brake before the first trip: bedded, as UN GTR 24 has it done


class Trip(NamedTuple):
    """A trip as recorded, and its true values."""

    columns: dict[str, Array]
    """By `COLUMNS`."""
    emitted: Array
    """Particles so far, true; shape (n,)."""
    expected: Array
    """The same by the law without scatter and day."""


def _trace(random: Generator, seed: int) -> tuple[Array, float]:
    """Return speed, acceleration and grade every `STEP`, shape (n, 3), and the distance [m]."""
    trip = real_driving(seed)
    faster, slower = random.uniform(*FASTER), random.uniform(*SLOWER)
    t, speed = slower * trip.t, faster * trip.speed
    fine = np.arange(0.0, t[-1], STEP)
    v = np.interp(fine, t, speed)
    drive = np.column_stack((v, np.gradient(v, STEP), np.interp(fine, t, trip.grade_by_time())))
    return drive, float(distance_driven(fine, v)[-1])


def _wander(random: Generator, count: int) -> Array:
    every = int(1.0 / STEP)
    stays = np.exp(-1.0 / WANDER_S)
    value, values = random.normal(), []
    for _ in range(count // every + 2):
        values.append(value)
        value = stays * value + np.sqrt(1.0 - stays**2) * random.normal()
    return np.exp(WANDER * np.interp(np.arange(count) / every, np.arange(len(values)), values))


def _conditions(random: Generator, day: float) -> RecordArray:
    record = np.zeros(1, TRIP)
    trip = record[0]
    trip["overrun"], trip["ambient"], trip["flow"] = random.uniform(*OVERRUN), random.uniform(*AMBIENT), FLOW
    trip["delay"], trip["mixing"], trip["response"] = random.uniform(0.8, 1.4), random.uniform(0.6, 1.2), 0.8
    trip["settles"], trip["settled_for"] = 0.05, 90.0
    trip["background"] = random.uniform(150.0, 450.0)
    trip["background_by_speed"] = random.uniform(8.0, 25.0)
    trip["day"] = np.exp(day * random.normal() - 0.5 * day**2)
    return record


def _sensed(out: Array, random: Generator) -> dict[str, Array]:
    n = len(out)
    applied = out[:, TORQUE] > 1.0
    torque = out[:, TORQUE] * (1.0 + TORQUE_ERROR * random.normal() + TORQUE_NOISE * random.normal(size=n))
    counted = np.full(n, np.nan)
    read = slice(0, n, round(1.0 / (10 * STEP)))
    seen = out[read, CONCENTRATION]
    drift = COUNT_DRIFT * random.normal() * np.linspace(0.0, 1.0, len(seen))
    shown = seen * (1.0 + COUNT_GAIN * random.normal() + drift + COUNT_NOISE * random.normal(size=len(seen)))
    shown = np.maximum(shown + COUNT_ZERO * random.normal(), 0.0)
    lost, begins = int(random.uniform(*DROP_OUT)), int(random.uniform(0.0, len(seen)))
    shown[begins : begins + lost] = np.nan
    counted[read] = shown
    values = (
        out[:, T],
        np.maximum(out[:, SPEED] + SPEED_NOISE * random.normal(size=n) * (out[:, SPEED] > 0.0), 0.0),
        1e-5 * out[:, PRESSURE] + 0.5 + PRESSURE_NOISE * random.normal(size=n),
        np.where(applied, torque, 0.0),
        out[:, HEAT] + HEAT_ERROR * random.normal() + HEAT_NOISE * random.normal(size=n),
        counted,
        FLOW * (1.0 + FLOW_NOISE * random.normal(size=n)),
    )
    return dict(zip(COLUMNS, values, strict=True))


def drawn_brake(seed: int, vapour: bool = False) -> RecordArray:
    """Return the drawn van of a seed with its crew, shape (1,), with drawn emission of its linings.

    `vapour`: by the second form of the law.
    """
    plant = load_plant(resource("config/plant/lcv.toml"))
    width = load_widths(resource("config/plant/draw.toml"), "wide").model_copy(update={"emission_day": 0.0})
    car = draw(plant, seed, width)
    car["mass"] *= CREW
    random = np.random.default_rng([seed, 81])
    law = plant.lining(CORNER).emission.model_copy(
        update={
            "hot_from": random.uniform(170.0, 200.0),
            "by_speed": random.uniform(0.3, 0.6),
            "by_power": random.uniform(0.1, 0.4),
            "hot": np.exp(random.uniform(*np.log((12.0, 50.0)))),
            "activation": random.uniform(*ACTIVATION) if vapour else 0.0,
        }
    )
    car["emission_row"] = law.row()
    return car


def campaign(
    seed: int,
    day: float = DAY,
    application: float = APPLICATION,
    trips: int = TRIPS,
    car: RecordArray | None = None,
    corner: int = CORNER,
) -> list[Trip]:
    """Return the trips of one vehicle; `day` as `DAY`, `application` as `APPLICATION`.

    `car`: parameters of the plant, shape (1,), the drawn van without; `corner`: whose brake is enclosed.
    """
    car = drawn_brake(seed) if car is None else car
    random = np.random.default_rng([seed, 82])
    work, found = random.uniform(*DRIVEN), []
    radius = float(car[0]["free_radius"][corner])
    for number in range(trips):
        drive, _ = _trace(random, 1000 * seed + number)
        conditions = _conditions(random, day)
        conditions["work"] = work
        scatter = np.exp(application * random.normal(size=600) - 0.5 * application**2)
        wander = _wander(random, len(drive))
        out, mean = (np.zeros((len(drive) // 10 + 1, EMITTED + 1)) for _ in range(2))
        rows, _ = run_trip(car[0], corner, conditions[0], drive, wander, scatter, out)
        work += float(np.trapezoid(out[:rows, TORQUE] * out[:rows, SPEED], out[:rows, T])) / radius
        plain = conditions.copy()
        plain["day"] = 1.0
        run_trip(car[0], corner, plain[0], drive, wander, np.ones(1), mean)
        columns = _sensed(out[:rows], random)
        found.append(Trip(columns, out[:rows, EMITTED].copy(), mean[:rows, EMITTED].copy()))
    return found


def write_campaign(trips: list[Trip], folder: Path) -> Path:
    """Write the trips' files and their manifest, the last held out; return the manifest."""
    folder.mkdir(parents=True, exist_ok=True)
    manifest = folder / "manifest.csv"
    with manifest.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["trip", "file", "test"])
        for number, trip in enumerate(trips, 1):
            writer.writerow([f"trip {number}", f"trip-{number}.csv", int(number == len(trips))])
            table = np.column_stack([trip.columns[name] for name in COLUMNS])
            np.savetxt(
                folder / f"trip-{number}.csv", table, "%.4f", ",", header=",".join(COLUMNS), comments=""
            )
    return manifest
