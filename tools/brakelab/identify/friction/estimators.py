"""The estimators of section 2.4, identified on one trip and judged on another (Table 2.1, Figure 2.9)."""

from collections.abc import Callable
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector
from brakelab.identify.friction.candidates import candidates
from brakelab.identify.friction.fit import fit, replayed
from brakelab.identify.friction.stops import Stops
from brakelab.identify.friction.trips import Trip, manoeuvres
from brakelab.plant.friction.law import RigBrake

Estimator = Callable[[Stops], Vector]
"""Friction of every block, shape (blocks,), from pressure, speed and temperature."""

STEADY: Final = 0.03  # relative change of pressure in a block that passes as quasi-static
CONSTANT, SURFACE, LUGRE = "constant", "response surface", "static LuGre"
OSTERMEYER, NETWORK = "Ostermeyer", "ANN"


def quasi_static(stops: Stops) -> NDArray[np.bool_]:
    """Return which blocks pass as quasi-static, shape (blocks,), as 2.4.1 takes them after SAE J2707."""
    at = stops.block_first[:, None] + np.arange(stops.per_block)
    half = stops.per_block // 2
    pressure = stops.pressure[at]
    change = np.abs(pressure[:, half:].mean(axis=1) / pressure[:, :half].mean(axis=1) - 1.0)
    return np.asarray(change < STEADY)


def steady(stops: Stops) -> Stops:
    """Return the stops with their quasi-static blocks alone."""
    kept = quasi_static(stops)
    return replace(
        stops, block_first=stops.block_first[kept], block_stop=stops.block_stop[kept], mu=stops.mu[kept]
    )


def estimators(stops: Stops, brake: RigBrake, seed: int) -> dict[str, Estimator]:
    """Return the estimators identified on `stops`; surface and LuGre on their quasi-static blocks."""
    mean = float(stops.mu.mean())
    known = {candidate.name: candidate for candidate in candidates(stops, brake)}

    def of(name: str, seen: Stops) -> Estimator:
        law = fit(known[name], brake, seen, seed).law
        return lambda other: replayed(law, brake, other, False)

    return {
        CONSTANT: lambda other: np.full(len(other.mu), mean),
        SURFACE: of("quadratic", steady(stops)),
        LUGRE: of("static_lugre", steady(stops)),
        OSTERMEYER: of("ostermeyer", stops),
        NETWORK: of("network", stops),
    }


class Error(NamedTuple):
    """An estimator's error over the mean friction [%]."""

    nrmse: float
    mean: float
    """Signed; what it leaves of `nrmse` is scatter."""


def nrmse(estimate: Vector, mu: Vector) -> float:
    """Return the RMS error over the mean friction [%]."""
    return 100.0 * float(np.sqrt(np.mean((estimate - mu) ** 2)) / mu.mean())


def errors_by_manoeuvre(
    found: dict[str, Estimator], trip: Trip, radius: float
) -> dict[str, dict[str, Error]]:
    """Return the errors by estimator (with * on the lumped temperature) and manoeuvre A to D."""
    kinds = manoeuvres(trip.stops, radius)
    table: dict[str, dict[str, Error]] = {}
    for name, estimator in found.items():
        for mark, stops in (("", trip.stops), ("*", trip.lumped)):
            if mark and name not in (OSTERMEYER, NETWORK):
                continue
            estimate = estimator(stops)
            within = {kind: np.isin(stops.block_stop, which) for kind, which in kinds.items()}
            table[name + mark] = {
                kind: Error(
                    nrmse(estimate[b], stops.mu[b]),
                    100.0 * float((estimate[b] - stops.mu[b]).mean() / stops.mu[b].mean()),
                )
                for kind, b in within.items()
            }
    return table


def error_by_temperature(estimator: Estimator, stops: Stops, factor: float) -> float:
    """Return the nRMSE [%] over a trip whose temperature is wrong by `factor`, from 0 degC."""
    return nrmse(estimator(replace(stops, temperature=factor * stops.temperature)), stops.mu)
