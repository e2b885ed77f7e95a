"""Thirty thousand kilometres of wear (Figure 7.16): routes drawn from the parts driven by cars, with true and
estimated wear and a thickness measured every 2,500 km."""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.random import Generator

from brakelab.arrays import Array
from brakelab.identify.wear.command import law_error
from brakelab.identify.wear.fit import QUASI_STATIC, Fit, fit_law
from brakelab.identify.wear.fusion import POINTS
from brakelab.identify.wear.reader import stop_regressors
from brakelab.identify.wear.running_in import measured
from brakelab.simulation.campaigns.instruments import measure_points, weigh, workshop_gauge
from brakelab.simulation.campaigns.wear_blocks import (
    COLUMNS,
    PAD_MASS,
    THICKNESS,
    WornBlock,
    drawn_car,
    programme,
)
from brakelab.simulation.configured import configured
from brakelab.studies.wear.drives import CarDrives
from ecu.algorithm.monitoring.wear import WEAR_STATE, restore_wear
from ecu.contract.records import LEARNED, RecordArray, new_record
from ecu.pads import GAUGE, add_measurement
from ecu.settings.config import new_params

LIFE_KM: Final = 30_000.0
EVERY_KM: Final = 2_500.0
CLIMATE: Final = 0.10  # standard deviation of the logarithm
CLIMATE_KM: Final = 1_000.0  # over which it changes
EVENNESS: Final = 0.7  # of the mix of drivers and roads between two measurements; small: one dominates
DYNAMOMETER_CAR: Final = 1000  # its linings are of another lot
MEASURED: Final = {
    "law alone": (),
    "one measurement": (4,),
    "two measurements": (4, 8),
    "every measurement": range(1, 1 + round(LIFE_KM / EVERY_KM)),
}
"""Points after which the linings are measured, the fourth at 10,000 km."""
MODES: Final = tuple(MEASURED)
LAWS: Final = ("extended", "quasi-static")


class Law(NamedTuple):
    """Laws of front and rear linings from the dynamometer."""

    coefficients: Array
    """Shape (7, 4)."""
    sigma: Array
    """Relative, shape (4,)."""
    fits: tuple[Fit, Fit]


class Life(NamedTuple):
    """One car under one law: points every 2,500 km, corners in columns; NaN beyond worn pads."""

    seed: int
    law: str
    km: Array
    true: Array
    """mm, shape (n, 4)."""
    predicted: dict[str, Array]
    """By `MODES`, mm, before the point's own measurement; shape (n, 4)."""
    sigma: dict[str, Array]


def measured_block(block: WornBlock, pad_mass: float, random: Generator) -> tuple[Array, float, float]:
    """Return a block's regressors, the mass by the balance [g] and the linear wear by six points [mm]."""
    named = dict(zip(COLUMNS, block.trace.T, strict=True))
    edges = np.flatnonzero(named["calliper_pressure"] == 0.0)
    starts = np.concatenate([[0], edges[:-1] + 1])
    stops = [
        {name: column[a:b] for name, column in named.items()}
        for a, b in zip(starts, edges, strict=True)
        if b - a > 5
    ]
    x = np.sum([stop_regressors(stop) for stop in stops], axis=0)
    lost = np.array([0.0, block.worn])
    mass = weigh(PAD_MASS - lost, random)
    points = measure_points(np.repeat(THICKNESS - lost[:, None] / pad_mass, POINTS, 1), random)
    return x, float(mass[0] - mass[1]), float(points[0].mean() - points[1].mean())


def dynamometer_laws() -> dict[str, Law]:
    """Return the laws identified from blocks of another lot of linings, by `LAWS`."""
    config = configured()
    params = new_params(config)[0]
    car = drawn_car(DYNAMOMETER_CAR)
    fits: dict[str, list[Fit]] = {law: [] for law in LAWS}
    sigma: dict[str, list[float]] = {law: [] for law in LAWS}
    for wheel in (0, 2):
        random = np.random.default_rng([DYNAMOMETER_CAR, wheel])
        rows = [
            measured_block(block, float(params["pad_mass"][wheel]), random)
            for block in programme(car, wheel, DYNAMOMETER_CAR)
        ]
        x, mass, wear = (np.array(values) for values in zip(*rows, strict=True))
        run = measured(x, wear, mass, np.cumsum(mass) - mass)
        for law, allowed in zip(LAWS, (tuple(range(7)), QUASI_STATIC), strict=True):
            fits[law].append(fit_law(x, run.mass, run.variance, allowed))
            sigma[law].append(law_error(fits[law][-1], run.mass, run.run_in.sigma))
    return {
        law: Law(
            np.repeat(np.column_stack([fit.coefficients for fit in fits[law]]), 2, axis=1),
            np.repeat(sigma[law], 2),
            (fits[law][0], fits[law][1]),
        )
        for law in LAWS
    }


def _route(car: CarDrives, random: Generator) -> list[int]:
    """Return the parts driven, at least over `LIFE_KM`; one mix of them between two measurements."""
    chosen: list[int] = []
    driven = 0.0
    for period in range(1, round(LIFE_KM / EVERY_KM) + 1):
        mix = random.dirichlet(np.full(len(car.parts), EVENNESS))
        while driven < period * EVERY_KM:
            chosen.append(int(random.choice(len(car.parts), p=mix)))
            driven += 1e-3 * car.parts[chosen[-1]].distance
    return chosen


def _appraise(params: RecordArray, learned: RecordArray) -> tuple[Array, Array]:
    state = np.zeros(1, WEAR_STATE)[0]
    restore_wear(params[0], state, learned[0])
    return state["wear"].copy(), state["sigma"].copy()


def live(car: CarDrives, law_name: str, law: Law) -> Life:
    """Return thirty thousand kilometres of one car under a law of the dynamometer."""
    random = np.random.default_rng([car.seed, 31])
    params = new_params(configured())
    params[0]["wear_law"], params[0]["wear_sigma"] = law.coefficients, law.sigma
    records = {mode: new_record(LEARNED) for mode in MODES}
    for record in records.values():
        record[0]["wear"]["told"] = 1
    pad_mass, pad_life = params[0]["pad_mass"], params[0]["pad_life"]
    worn, climate, driven, points = np.zeros(4), random.normal(), 0.0, 0
    gauge = workshop_gauge(np.random.default_rng([car.seed, 32]))
    km: list[float] = []
    true: list[Array] = []
    predicted: dict[str, list[Array]] = {mode: [] for mode in MODES}
    sigma: dict[str, list[Array]] = {mode: [] for mode in MODES}
    for k in _route(car, random):
        part = car.parts[k]
        stays = np.exp(-1e-3 * part.distance / CLIMATE_KM)
        climate = stays * climate + np.sqrt(1.0 - stays**2) * random.normal()
        running_in = 1.0 + car.run_in[0] * np.exp(-worn / car.run_in[1])
        worn = worn + np.exp(CLIMATE * climate) * running_in * part.worn
        driven += 1e-3 * part.distance
        for record in records.values():
            _drive(record[0]["wear"], part)
        if driven < (points + 1) * EVERY_KM:
            continue
        points += 1
        km.append(driven)
        true.append(np.where(worn / pad_mass <= pad_life, worn / pad_mass, np.nan))
        seen = gauge(worn / pad_mass)
        for mode, record in records.items():
            wear, deviation = _appraise(params, record)
            predicted[mode].append(wear)
            sigma[mode].append(deviation)
            if points in MEASURED[mode]:
                for i in range(4):
                    add_measurement(record[0]["wear"], i, float(seen[i]), GAUGE)
    return Life(
        car.seed,
        law_name,
        np.array(km),
        np.array(true),
        {mode: np.array(values) for mode, values in predicted.items()},
        {mode: np.array(values) for mode, values in sigma.items()},
    )


def _drive(wear: Any, part: Any) -> None:
    for name in ("regressors", "friction_error", "temperature_error"):
        wear[name] += getattr(part, name)
    wear["odometer"] += part.distance
