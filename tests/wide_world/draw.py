"""Thirty strangers by seed and number: cars, drivers, roads, loggers, and what engineers believe of them.

Sets, one letter each, five cars of every one in thirty:

    A  racing car: four wheel speeds at 100 Hz, two line pressures, accelerometer, no speed reference
    B  car of a racing series: one lagging speed stands for the wheels and for the car, two pressures
    C  formula student or track-day car: no wheel speeds, GPS speed with a delay
    D  touring car: four wheel speeds and two pressures at 20 Hz, two disc temperatures
    E  track-day or road car: as A, pressures in a scale that is wrong by up to 5 %
    F  electric road car by wire: motors report their torque, four calliper pressures
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from .car import NO_ABS, Car, Start, drive
from .config import Nominal, believe
from .kinds import (
    ELECTRIC,
    RACER,
    ROAD,
    SERIES,
    STUDENT,
    TOURING,
    TRACK_DAY,
    draw_abs,
    draw_body,
    draw_brake,
    draw_driver,
    draw_engine,
    draw_tyre,
)  # fmt: skip
from .logger import Logger, draw_logger
from .roads import draw_route
from .route import Route
from .state import ROW, STATE

SETS = {
    "A": (RACER,),
    "B": (SERIES,),
    "C": (STUDENT, TRACK_DAY),
    "D": (TOURING,),
    "E": (TRACK_DAY, ROAD),
    "F": (ELECTRIC,),
}
CARS = 30
RAIN = 0.15, (0.4, 0.7)  # share of sessions, grip
LONGEST_DRIVE = 3600.0  # s


class Stranger(NamedTuple):
    """A car, its drive and its logger."""

    seed: int
    number: int
    letter: str  # of its set
    rain: bool
    car: Car
    route: Route
    start: Start
    nominal: Nominal
    logger: Logger

    @property
    def traits(self) -> tuple[str, ...]:
        """What may lead an observer astray, in words."""
        reported, silent = self.logger.motor.rate > 0.0, self.car.abs_.kind != NO_ABS
        of = {
            "accelerator rests at 2.5 %": self.logger.rest > 0.0,
            "engine's torque at 2.5 times": reported and not self.nominal.electric,
            "hidden slip control": silent and not self.logger.abs_reported,
            "left foot": self.car.driver.overlap > 0.0,
            "taps": bool(np.any(self.route.tap)),
            "rain": self.rain,
        }
        return tuple(name for name, true in of.items() if true)

    def drive(self) -> NDArray[np.void]:
        """Return its drive: a record of STATE every 10 ms."""
        rng = np.random.default_rng([self.seed, self.number, 1])
        slow = np.exp(-ROW / 0.4)
        tremor = lfilter([np.sqrt(1.0 - slow**2)], [1.0, -slow], rng.normal(size=round(LONGEST_DRIVE / ROW)))
        rows = np.zeros(len(tremor), STATE)
        return rows[
            : drive(self.car, self.route, self.start, tremor, 1.0 + 0.02 * rng.normal(size=400), rows)
        ]


def draw(seed: int, numbers: range = range(CARS)) -> list[Stranger]:
    """Return strangers by number; the same seed and number give the same one."""
    return [_stranger(seed, number) for number in numbers]


def _stranger(seed: int, number: int) -> Stranger:
    rng = np.random.default_rng([seed, number])
    letter = list(SETS)[number % len(SETS)]
    kind = SETS[letter][int(rng.integers(len(SETS[letter])))]
    electric = kind is ELECTRIC
    rain = bool(rng.random() < RAIN[0])
    grip = rng.uniform(*(RAIN[1] if rain else kind.grip))
    body = draw_body(kind, rng)
    brake = draw_brake(kind, body, grip, electric, rng)
    control = draw_abs(kind, rng)
    engine = draw_engine(kind, body, electric, rng)
    route = draw_route(kind, body, grip, control.kind != NO_ABS, engine.blend > 0.0, rng)
    logger = draw_logger(letter, electric, rng)
    ambient = rng.uniform(8.0, 30.0)
    if rng.random() < 0.5:
        start = Start(
            idle=rng.uniform(4.0, 20.0), speed=0.0, front=ambient + 10.0, rear=ambient, ambient=ambient
        )
    else:
        warm = rng.uniform(90.0, 300.0) if kind.track == "race" else rng.uniform(30.0, 90.0)
        start = Start(
            idle=0.0, speed=0.8 * float(route.speed[0]), front=warm, rear=0.8 * warm, ambient=ambient
        )
    return Stranger(
        seed=seed,
        number=number,
        letter=letter,
        rain=rain,
        car=Car(
            body=body,
            tyre=draw_tyre(body, rng),
            brake=brake,
            engine=engine,
            driver=draw_driver(kind, body, brake, grip, rng),
            abs_=control,
        ),
        route=route,
        start=start,
        nominal=believe(body, brake, kind.scale, logger, electric, rng),
        logger=logger,
    )
