"""Kinds of strangers' cars, and a draw of body, tyres, brakes, engine and driver of each.

Ranges are those of data sheets and of what was seen on recorded cars: 0.9 to 1.5 g of grip on race tyres,
0.7 to 1.1 on road tyres, 0.4 to 0.7 in rain; linings that grip 0.9 to 1.6 times as well as their data sheet
says.
"""

from typing import NamedTuple

import numpy as np

from .car import Abs, Body
from .driver import Driver, Engine
from .lining import CONSTANT, FADING, GREEN, LOAD_AND_SPEED, RISING, Brake, warm_level
from .route import G
from .tyre import BRUSH, DUGOFF, EXPONENTIAL, Tyre, greatest

Range = tuple[float, float]
SHIFT = 1.25  # ratio of neighbouring gears
STRENGTH = {CONSTANT: 0.0, RISING: 0.5, FADING: 0.4, LOAD_AND_SPEED: 0.25, GREEN: 0.3}
FREQUENCY = {CONSTANT: 0.2, RISING: 0.3, FADING: 0.2, LOAD_AND_SPEED: 0.2, GREEN: 0.1}


class Kind(NamedTuple):
    """What is particular to a kind of car; pairs are ranges of uniform draws."""

    track: str  # race, student or road
    mass: Range  # kg
    grip: Range  # dry
    drag: Range  # coefficient times area, m^2
    lift: Range  # likewise of the downforce
    power: Range  # W/kg
    radius: Range  # m, rolling
    wheelbase: Range  # m
    width: Range  # m, track
    cog_height: Range  # m
    front: Range  # share of the load at rest
    inertia: Range  # kg m^2, of a wheel
    stiffness: Range  # N/m, vertical, of a tyre
    pressure: Range  # bar for 1 g
    heat: Range  # K/J, of a front disc
    fastest: float  # m/s
    scale: Range  # true over believed friction: median and spread of its logarithm
    control: float  # share of cars with a slip control


RACER = Kind(
    track="race", mass=(900, 1450), grip=(1.0, 1.5), drag=(0.6, 1.1), lift=(0.0, 2.5), power=(180, 330),
    radius=(0.3, 0.34), wheelbase=(2.4, 2.8), width=(1.55, 1.7), cog_height=(0.36, 0.48), front=(0.46, 0.58),
    inertia=(0.8, 1.5), stiffness=(2.0e5, 3.0e5), pressure=(35, 65), heat=(1.3e-4, 2.3e-4), fastest=72.0,
    scale=(1.2, 0.17), control=0.4,
)  # fmt: skip
SERIES = RACER._replace(mass=(1265, 1275), grip=(0.95, 1.4), lift=(0.0, 0.8), power=(150, 230))
TOURING = RACER._replace(mass=(1320, 1420), grip=(1.0, 1.4), lift=(0.0, 1.2), power=(250, 330), control=0.3)
STUDENT = Kind(
    track="student", mass=(265, 320), grip=(1.1, 1.5), drag=(0.7, 1.3), lift=(0.0, 3.5), power=(150, 230),
    radius=(0.2, 0.25), wheelbase=(1.53, 1.65), width=(1.15, 1.25), cog_height=(0.26, 0.3), front=(0.45, 0.5),
    inertia=(0.2, 0.35), stiffness=(0.9e5, 1.1e5), pressure=(25, 50), heat=(0.7e-3, 1.1e-3), fastest=33.0,
    scale=(1.1, 0.17), control=0.0,
)  # fmt: skip
TRACK_DAY = RACER._replace(
    mass=(1100, 1700), grip=(0.75, 1.15), drag=(0.6, 0.8), lift=(-0.1, 0.3), power=(100, 220),
    radius=(0.31, 0.34), cog_height=(0.45, 0.56), pressure=(50, 90), fastest=66.0, scale=(1.1, 0.15),
    control=0.75,
)  # fmt: skip
ROAD = TRACK_DAY._replace(
    track="road", grip=(0.7, 1.1), power=(60, 120), cog_height=(0.5, 0.6), fastest=58.0, scale=(1.0, 0.12)
)
ELECTRIC = ROAD._replace(
    mass=(1550, 2350), power=(70, 150), radius=(0.32, 0.36), wheelbase=(2.6, 2.95), control=0.95
)


def draw_body(kind: Kind, rng: np.random.Generator) -> Body:
    """Return masses, lengths and resistances."""
    wheelbase, radius, inertia = (
        rng.uniform(*kind.wheelbase),
        rng.uniform(*kind.radius),
        rng.uniform(*kind.inertia),
    )
    return Body(
        mass=rng.uniform(*kind.mass),
        fuel=rng.uniform(0.005, 0.02) if kind is not ELECTRIC else 0.0,
        wheelbase=wheelbase,
        front_axle=(1.0 - rng.uniform(*kind.front)) * wheelbase,
        cog_height=rng.uniform(*kind.cog_height),
        track=rng.uniform(*kind.width),
        drag=0.6 * rng.uniform(*kind.drag),
        lift=0.6 * rng.uniform(*kind.lift),
        lift_front=rng.uniform(0.35, 0.5),
        rolling=rng.uniform(0.009, 0.02),
        cornering=rng.uniform(14.0, 28.0),
        roll_front=rng.uniform(0.45, 0.6),
        inertia_front=inertia,
        inertia_rear=inertia * rng.uniform(0.95, 1.2),
        radius_front=radius,
        radius_rear=radius * rng.uniform(1.0, 1.03),
        vertical_stiffness=rng.uniform(*kind.stiffness),
        transfer_lag=rng.uniform(0.04, 0.12),
    )


def draw_tyre(body: Body, rng: np.random.Generator) -> Tyre:
    """Return tyres of any kind of curve."""
    kind, shape, fall = (
        int(rng.choice([BRUSH, DUGOFF, EXPONENTIAL])),
        rng.uniform(0.6, 1.5),
        rng.uniform(0.08, 0.3),
    )
    return Tyre(
        kind=kind,
        stiffness=rng.uniform(16.0, 34.0),
        shape=shape,
        fall=fall,
        top=greatest(kind, shape, fall),
        exponent=rng.uniform(0.03, 0.12),
        load=body.mass * G / 4.0,
    )


def draw_brake(kind: Kind, body: Body, grip: float, by_wire: bool, rng: np.random.Generator) -> Brake:
    """Return brakes that suit car and grip but for the balance, which is some per cent too much in front."""
    lining = int(rng.choice(list(FREQUENCY), p=list(FREQUENCY.values())))
    mu_front, mu_rear = rng.uniform(0.38, 0.55), rng.uniform(0.36, 0.55)
    front = 1.0 + (min(grip, 1.2) * body.cog_height - body.front_axle) / body.wheelbase
    front = min(front + rng.normal(0.03, 0.03), 0.9)
    rear_share = 1.0 if by_wire else rng.uniform(0.65, 1.0)
    force = body.mass * G * body.radius_front / (2.0 * rng.uniform(*kind.pressure))  # N m/bar of a side
    heat = rng.uniform(*kind.heat)
    valve = kind.track == "road" and not by_wire and rng.random() < 0.7
    return Brake(
        gain_front=front * force / mu_front,
        gain_rear=(1.0 - front) * force / mu_rear / rear_share,
        push_out=rng.uniform(0.2, 1.2),
        kind=lining,
        level_front=mu_front / warm_level(lining, STRENGTH[lining]),
        level_rear=mu_rear / warm_level(lining, STRENGTH[lining]),
        strength=STRENGTH[lining],
        bedding=rng.uniform(400.0, 2300.0) * body.mass,
        heat_front=heat,
        heat_rear=heat * rng.uniform(1.0, 1.6),
        cooling=rng.uniform(1e-3, 2e-3),
        cooling_by_speed=rng.uniform(1.5e-4, 4e-4),
        rear_share=rear_share,
        valve_knee=rng.uniform(25.0, 40.0) if valve else 1e3,
        valve_slope=0.35,
        lag=rng.uniform(0.02, 0.06),
    )


def draw_engine(kind: Kind, body: Body, electric: bool, rng: np.random.Generator) -> Engine:
    """Return an engine with six gears, or motors of one gear that regenerate."""
    weight = body.mass * body.radius_rear  # N m of 1 m/s^2
    power, front = rng.uniform(*kind.power) * body.mass, float(rng.choice([0.0, 0.0, 1.0, 0.5]))
    if electric:
        return Engine(
            power=power, torque=2.5 * weight / 9.0, ratios=(9.0, 0.0, 0.0, 0.0, 0.0, 0.0), fastest=1e4,
            slowest=0.0, drag=0.0, drag_by_speed=0.0, inertia=0.04, front=front, blip=0.0,
            coast=rng.uniform(0.1, 1.4), regeneration=rng.uniform(0.8, 2.2) * weight,
            blend=float(rng.choice([0.0, 0.4, 0.8])),
        )  # fmt: skip
    student = kind.track == "student"
    fastest = rng.uniform(900.0, 1150.0) if student else rng.uniform(620.0, 850.0)
    sixth = fastest * body.radius_rear / kind.fastest
    first, second, third, fourth, fifth = (sixth * SHIFT**n for n in (5, 4, 3, 2, 1))
    drag = rng.uniform(0.4, 1.4) * weight / third  # in third gear at four fifths of its speed
    return Engine(
        power=power, torque=6.0 * weight / first, ratios=(first, second, third, fourth, fifth, sixth),
        fastest=fastest, slowest=rng.uniform(0.5, 0.72) * fastest, drag=0.3 * drag,
        drag_by_speed=0.7 * drag / (0.8 * fastest), inertia=0.03 if student else rng.uniform(0.08, 0.18),
        front=0.0 if student else front, blip=rng.uniform(0.08, 0.3), coast=0.0, regeneration=0.0, blend=0.0,
    )  # fmt: skip


def draw_driver(kind: Kind, body: Body, brake: Brake, grip: float, rng: np.random.Generator) -> Driver:
    """Return feet that know their brakes within some per cent."""
    torque = 2.0 * (
        brake.gain_front * brake.level_front + brake.gain_rear * brake.level_rear * brake.rear_share
    )
    bar_per_decel = body.mass * body.radius_front / torque * rng.uniform(0.85, 1.1)
    race = kind.track != "road"
    left_foot = rng.random() < (0.35 if race else 0.1)
    return Driver(
        bar_per_decel=bar_per_decel,
        pressure=rng.uniform(1.5, 2.1) * bar_per_decel * G * max(grip, 0.8),
        press=rng.uniform(400, 1500) if race else rng.uniform(60, 200),
        release=rng.uniform(150, 500) if race else rng.uniform(40, 150),
        stab=rng.uniform(0.0, 0.35) if race else 0.05,
        learning=rng.uniform(0.4, 1.8),
        tremble=rng.uniform(0.03, 0.1),
        reaction=rng.uniform(0.15, 0.35),
        overlap=rng.uniform(0.05, 0.35) if left_foot else 0.0,
        overlap_time=rng.uniform(0.15, 0.6),
        acceleration=20.0 if race else rng.uniform(1.2, 3.0),
    )


def draw_abs(kind: Kind, rng: np.random.Generator) -> Abs:
    """Return a slip control that cycles, one that holds, or none."""
    slip = rng.uniform(0.13, 0.2)
    control = int(rng.integers(1, 3)) if rng.random() < kind.control else 0
    return Abs(kind=control, high=slip, low=0.4 * slip, rate=rng.uniform(5.0, 12.0))
