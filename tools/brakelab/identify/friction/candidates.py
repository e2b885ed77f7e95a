"""The laws that are identified: free parameters of each, their bounds, the law that given numbers make.

A free number is searched on its own scale: `log` between its bounds, or even. What is fixed follows from
the recording: knots of the tables span its temperatures and pressures, the debris term has the flywheel's
inertia.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Final, Literal

import numpy as np

from brakelab.arrays import Vector
from brakelab.identify.friction.candidate import Candidate, Free
from brakelab.identify.friction.static_candidates import quadratic, static_lugre, trained_network
from brakelab.identify.friction.stops import Stops
from brakelab.plant.friction.constant import Constant
from brakelab.plant.friction.ilvo import Ilvo
from brakelab.plant.friction.ilvo_bounded import KNOTS, IlvoBounded
from brakelab.plant.friction.law import Law, RigBrake
from brakelab.plant.friction.ostermeyer import Ostermeyer
from brakelab.plant.friction.ostermeyer_revised import OstermeyerRevised
from brakelab.plant.friction.own import Own, read_code
from brakelab.plant.friction.surface import Surface
from brakelab.plant.friction.table import Table

EVEN_STEP: Final = 40.0  # K, least distance of knots over temperature
TEMPERATURES: Final = 6  # knots of a table
PRESSURES: Final = 3


def candidates(stops: Stops, brake: RigBrake, own: Sequence[str] = ()) -> list[Candidate]:
    """Return all laws for a recording, the simplest first; at last those of one's `own`: files, entry points.

    Raises:
        ValueError: a law of one's own cannot be read, or has the name of another; one line.
    """
    mass = stops.inertia / brake.tyre_radius**2
    shipped = [
        _constant(mass),
        static_lugre(stops, mass),
        quadratic(stops, mass),
        _table(stops, mass),
        _surface(mass),
        _ostermeyer(mass),
        _revised(mass),
        ilvo(mass),
        _bounded(stops, mass),
        trained_network(mass),
    ]
    laws = [*shipped, *(own_candidate(code, mass) for code in own)]
    names = [law.name for law in laws]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"{name}: two laws of this name; give the file another")
    return laws


def own_candidate(code: str, mass: float) -> Candidate:
    """Return the law of the file or entry point `code` for a rig of `mass` [kg]. Raises `ValueError`."""
    given = read_code(code).numbers
    free = tuple(Free(name, unit, low, high) for name, (unit, low, high) in given.items())

    def law(values: Sequence[float]) -> Law:
        return Own(law="own", rig_mass=mass, code=code, numbers=dict(zip(given, values, strict=True)))

    return Candidate(
        Path(code).stem, free, law, extrapolates="as its author says; found terms hold where they were found"
    )


def _constant(mass: float) -> Candidate:
    def law(values: Sequence[float]) -> Law:
        return Constant(law="constant", rig_mass=mass, mu=values[0])

    return Candidate(
        "constant", (Free("mu", "–", 0.05, 1.0, friction=True),), law, False, "knows no fade", True
    )


def _spread(values: Vector, count: int, least: float) -> list[float]:
    """Return `count` rising knots over the middle 98 % of `values`, at least `least` apart."""
    low, high = np.percentile(values, [1.0, 99.0])
    high = max(high, low + least * (count - 1))
    return [float(round(knot, 1)) for knot in np.linspace(low, high, count)]


def _table(stops: Stops, mass: float) -> Candidate:
    temperatures = tuple(_spread(stops.temperature, TEMPERATURES, 5.0))
    pressures = tuple(_spread(1e-5 * stops.held_pressure, PRESSURES, 5.0))
    free = tuple(
        Free(f"mu({temperature:.0f} °C, {pressure:.0f} bar)", "–", 0.05, 1.0, friction=True)
        for pressure in pressures
        for temperature in temperatures
    )

    def law(values: Sequence[float]) -> Law:
        rows = tuple(map(tuple, np.reshape(values, (PRESSURES, TEMPERATURES)).tolist()))
        return Table(law="table", rig_mass=mass, temperature=temperatures, pressure=pressures, mu=rows)

    limit = "constant beyond its knots, the mean of all stops where it saw none; knows no speed"
    return Candidate("table", free, law, extrapolates=limit, bounded=True)


def _surface(mass: float) -> Candidate:
    free = (
        Free("mu", "–", 0.05, 1.0, friction=True),
        Free("pressure", "–", -0.4, 0.4),
        Free("speed", "–", -0.4, 0.4),
        Free("fall", "–", 0.0, 0.2),
        Free("best", "°C", 0.0, 500.0),
        Free("bite", "–", -0.4, 0.6),
        Free("way", "m", 2.0, 200.0, log=True),
    )

    def law(values: Sequence[float]) -> Law:
        mu, pressure, speed, fall, best, bite, way = values
        return Surface(
            law="surface",
            rig_mass=mass,
            mu=mu,
            pressure=(pressure, pressure),
            speed=(speed, speed),
            fall=(fall, fall),
            best=(best, best),
            bite=(bite, bite),
            way=(way, way),
        )

    return Candidate(
        "surface", free, law, extrapolates="a parabola over temperature: wrong far from its peak"
    )


P_1: Final = Free("p_1", "1/(N m)", 1e-8, 1e-2, log=True)
P_2: Final = Free("p_2", "N m/s", 1e3, 1e8, log=True)
RATIO: Final = Free("p_3/p_2", "1/K", 1e-4, 1e-2, log=True)


def _ostermeyer(mass: float) -> Candidate:
    def law(values: Sequence[float]) -> Law:
        p_1, p_2, ratio = values
        return Ostermeyer(law="ostermeyer", rig_mass=mass, p_1=p_1, p_2=p_2, p_3=ratio * p_2, start=0.4)

    limit = "rises with temperature for ever: no fade"
    return Candidate("ostermeyer", (P_1, P_2, RATIO), law, True, limit)


def _revised(mass: float) -> Candidate:
    slopes = tuple(
        Free(f"{name} over {by}", f"/({unit})", -1.0, 1.0)
        for by, unit in (("pressure", "100 bar"), ("speed", "20 m/s"))
        for name in ("p_1", "p_2", "p_3")
    )
    free = (P_1, P_2, RATIO, *slopes)

    def law(values: Sequence[float]) -> Law:
        base = (values[0], values[1], values[1] * values[2])
        by_pressure = [p * share / 1e7 for p, share in zip(base, values[3:6], strict=True)]
        by_speed = [p * share / 20.0 for p, share in zip(base, values[6:9], strict=True)]
        p_1, p_2, p_3 = zip(base, by_pressure, by_speed, strict=True)
        return OstermeyerRevised(
            law="ostermeyer_revised", rig_mass=mass, p_1=p_1, p_2=p_2, p_3=p_3, start=0.4
        )

    limit = "rises with temperature for ever; slopes over pressure and speed are straight"
    return Candidate("ostermeyer_revised", free, law, True, limit)


LOSS: Final = Free("a", "m/N", 0.0, 1e-7)
DEBRIS: Final = Free("b", "s", 0.0, 0.1)
HEAT: Final = Free("c", "m²/(N K s)", -1e-9, 2e-9)


def ilvo(mass: float, stress: Literal["pad", "line"] = "pad", heat_zero: float = 0.0) -> Candidate:
    """Return 3.22c as corrected in `plant/friction/ilvo.py`; by default its two open choices are R1's."""
    kappa = (Free("kappa_0", "–", -0.6, 1.0), Free("kappa_1", "1/K", -2e-3, 2e-3))

    def law(values: Sequence[float]) -> Law:
        kappa_0, kappa_1, a, b, c = values
        return Ilvo(
            law="ilvo",
            rig_mass=mass,
            kappa_0=kappa_0,
            kappa_1=kappa_1,
            speed_gain=-a,
            debris=b,
            heat_loss=c,
            stress=stress,
            heat_zero=heat_zero,
        )

    limit = "contact vanishes when hot and long pressed; knows no pressure; not for blended braking"
    return Candidate("ilvo", (*kappa, LOSS, DEBRIS, HEAT), law, extrapolates=limit)


def _bounded(stops: Stops, mass: float) -> Candidate:
    low, high = np.percentile(stops.temperature, [1.0, 99.0])
    count = int(np.clip((high - low) / EVEN_STEP, 2, KNOTS))
    inner = [float(round(knot, 1)) for knot in np.linspace(low, high, count)]
    knots = inner + [inner[-1] + 50.0 * (k + 1) for k in range(KNOTS - count)]
    free = (
        *(Free(f"kappa({knot:.0f} °C)", "–", 0.05, 1.0, friction=True) for knot in inner),
        Free("a", "m/N", 0.0, 1e-7),
        Free("b", "s", 0.0, 0.1),
        Free("c", "m²/(N K s)", 0.0, 1e-9),
    )

    def law(values: Sequence[float]) -> Law:
        kappa = list(values[:count])
        kappa += [kappa[-1]] * (KNOTS - count)
        a, b, c = values[count:]
        return IlvoBounded(
            law="ilvo_bounded",
            rig_mass=mass,
            temperature=tuple(knots),
            kappa=tuple(kappa),
            speed_loss=a,
            debris=b,
            heat_loss=c,
        )

    limit = "kappa constant beyond its knots; contact between 0.85 and 1.2"
    return Candidate("ilvo_bounded", free, law, extrapolates=limit, bounded=True)
