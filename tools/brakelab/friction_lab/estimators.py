"""The estimators of section 2.4, identified on one trip and judged on another (Table 2.1, Figure 2.9)."""

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from brakelab.friction_lab.candidates import candidates
from brakelab.friction_lab.fitting import fit, replayed
from brakelab.friction_lab.network import train
from brakelab.friction_lab.stops import Stops
from brakelab.friction_lab.trips import Trip, manoeuvres
from brakelab.plant.friction.law import RigBrake

Vector = NDArray[np.float64]
Estimator = Callable[[Stops], Vector]
"""Friction of every block, shape (blocks,), from pressure, speed and temperature."""

STEADY: Final = 0.03  # relative change of pressure in a block that passes as quasi-static
CONSTANT, SURFACE, OSTERMEYER, NETWORK = "constant", "response surface", "Ostermeyer", "ANN"


def block_inputs(stops: Stops) -> NDArray[np.float64]:
    """Return sliding speed [m/s], pressure [Pa] and temperature [degC] of the blocks, shape (blocks, 3)."""
    at = stops.block_first[:, None] + np.arange(stops.per_block)
    columns = (stops.speed, stops.pressure, stops.temperature)
    return np.stack([column[at].mean(axis=1) for column in columns], axis=1)


def response_surface(stops: Stops) -> Estimator:
    """Return the second-order surface over speed and pressure, from quasi-static blocks."""
    at = stops.block_first[:, None] + np.arange(stops.per_block)
    half = stops.per_block // 2
    pressure = stops.pressure[at]
    change = np.abs(pressure[:, half:].mean(axis=1) / pressure[:, :half].mean(axis=1) - 1.0)
    steady = change < STEADY
    known = block_inputs(stops)[steady, :2]
    low, high = known.min(axis=0), known.max(axis=0)

    middle, scale = known.mean(axis=0), known.std(axis=0)

    def terms(inputs: NDArray[np.float64]) -> NDArray[np.float64]:
        v, p = ((np.clip(inputs, low, high) - middle) / scale).T
        return np.stack([np.ones(len(v)), v, p, v * v, v * p, p * p], axis=1)

    found, _, _, _ = np.linalg.lstsq(terms(known), stops.mu[steady], rcond=None)
    weights: Vector = found
    return lambda other: np.asarray(terms(block_inputs(other)[:, :2]) @ weights)


def estimators(stops: Stops, brake: RigBrake, seed: int) -> dict[str, Estimator]:
    """Return the estimators identified on `stops`."""
    mean = float(stops.mu.mean())
    ostermeyer = next(c for c in candidates(stops, brake) if c.name == "ostermeyer")
    law = fit(ostermeyer, brake, stops, seed).law
    network = train(block_inputs(stops), stops.mu, stops.block_stop, seed)
    return {
        CONSTANT: lambda other: np.full(len(other.mu), mean),
        SURFACE: response_surface(stops),
        OSTERMEYER: lambda other: replayed(law, brake, other, False),
        NETWORK: lambda other: network(block_inputs(other)),
    }


def nrmse(estimate: Vector, mu: Vector) -> float:
    """Return the RMS error over the mean friction [%]."""
    return 100.0 * float(np.sqrt(np.mean((estimate - mu) ** 2)) / mu.mean())


def errors_by_manoeuvre(
    found: dict[str, Estimator], trip: Trip, radius: float
) -> dict[str, dict[str, float]]:
    """Return the nRMSE [%] by estimator (with * on the lumped temperature) and manoeuvre A to D."""
    kinds = manoeuvres(trip.stops, radius)
    table: dict[str, dict[str, float]] = {}
    for name, estimator in found.items():
        for mark, stops in (("", trip.stops), ("*", trip.lumped)):
            if mark and name not in (OSTERMEYER, NETWORK):
                continue
            estimate = estimator(stops)
            within = {kind: np.isin(stops.block_stop, which) for kind, which in kinds.items()}
            table[name + mark] = {kind: nrmse(estimate[b], stops.mu[b]) for kind, b in within.items()}
    return table


def error_by_temperature(estimator: Estimator, stops: Stops, factor: float) -> float:
    """Return the nRMSE [%] over a trip whose temperature is wrong by `factor`, from 0 degC."""
    return nrmse(estimator(replace(stops, temperature=factor * stops.temperature)), stops.mu)
