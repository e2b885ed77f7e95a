"""The estimators of section 2.4, identified on one trip and judged on another (Table 2.1, Figure 2.9)."""

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from brakelab.arrays import Vector
from brakelab.identify.friction.candidates import candidates
from brakelab.identify.friction.fit import fit, replayed
from brakelab.identify.friction.network import train
from brakelab.identify.friction.stops import Stops
from brakelab.identify.friction.trips import Trip, manoeuvres
from brakelab.plant.friction.law import RigBrake

Estimator = Callable[[Stops], Vector]
"""Friction of every block, shape (blocks,), from pressure, speed and temperature."""

STEADY: Final = 0.03  # relative change of pressure in a block that passes as quasi-static
CONSTANT, SURFACE, LUGRE = "constant", "response surface", "static LuGre"
OSTERMEYER, NETWORK = "Ostermeyer", "ANN"


def block_inputs(stops: Stops) -> NDArray[np.float64]:
    """Return sliding speed [m/s], pressure [Pa] and temperature [degC] of the blocks, shape (blocks, 3)."""
    at = stops.block_first[:, None] + np.arange(stops.per_block)
    columns = (stops.speed, stops.pressure, stops.temperature)
    return np.stack([column[at].mean(axis=1) for column in columns], axis=1)


def quasi_static(stops: Stops) -> NDArray[np.bool_]:
    """Return which blocks pass as quasi-static, shape (blocks,), as 2.4.1 takes them after SAE J2707."""
    at = stops.block_first[:, None] + np.arange(stops.per_block)
    half = stops.per_block // 2
    pressure = stops.pressure[at]
    change = np.abs(pressure[:, half:].mean(axis=1) / pressure[:, :half].mean(axis=1) - 1.0)
    return np.asarray(change < STEADY)


def response_surface(stops: Stops) -> Estimator:
    """Return the second-order surface over speed and pressure, from quasi-static blocks."""
    steady = quasi_static(stops)
    known = block_inputs(stops)[steady, :2]
    low, high = known.min(axis=0), known.max(axis=0)

    middle, scale = known.mean(axis=0), known.std(axis=0)

    def terms(inputs: NDArray[np.float64]) -> NDArray[np.float64]:
        v, p = ((np.clip(inputs, low, high) - middle) / scale).T
        return np.stack([np.ones(len(v)), v, p, v * v, v * p, p * p], axis=1)

    weights = np.linalg.lstsq(terms(known), stops.mu[steady], rcond=None)[0]
    return lambda other: np.asarray(terms(block_inputs(other)[:, :2]) @ weights)


def static_lugre(stops: Stops) -> Estimator:
    """Return the steady sliding friction of the LuGre model, from quasi-static blocks.

    mu = mu_C + (mu_S - mu_C) exp(-(v / v_S)^2) + sigma_2 v: Coulomb, static, Stribeck's speed, viscous.
    """
    steady = quasi_static(stops)
    speed, mu = block_inputs(stops)[steady, 0], stops.mu[steady]
    mean, fast = float(mu.mean()), float(speed.max())

    def law(numbers: Vector, v: Vector) -> Vector:
        coulomb, static, stribeck, viscous = numbers
        return np.asarray(coulomb + (static - coulomb) * np.exp(-((v / stribeck) ** 2)) + viscous * v)

    bounds = ([0.0, 0.0, 0.05 * fast, -mean / fast], [2.0 * mean, 3.0 * mean, 2.0 * fast, mean / fast])
    fits = [
        least_squares(lambda n: law(n, speed) - mu, [mean, mean, share * fast, 0.0], bounds=bounds)
        for share in (0.1, 0.3, 1.0)
    ]
    best = min(fits, key=lambda fit: float(fit.cost)).x
    return lambda other: law(best, block_inputs(other)[:, 0])


def estimators(stops: Stops, brake: RigBrake, seed: int) -> dict[str, Estimator]:
    """Return the estimators identified on `stops`."""
    mean = float(stops.mu.mean())
    ostermeyer = next(c for c in candidates(stops, brake) if c.name == "ostermeyer")
    law = fit(ostermeyer, brake, stops, seed).law
    network = train(block_inputs(stops), stops.mu, stops.block_stop, seed)
    return {
        CONSTANT: lambda other: np.full(len(other.mu), mean),
        SURFACE: response_surface(stops),
        LUGRE: static_lugre(stops),
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
