"""Wear laws as curves: specific wear over disc and speed (Figure 7.9), sensitivity (Figure 7.10)."""

from typing import Final

import numpy as np

from brakelab.arrays import Array
from ecu.algorithm.monitoring.wear import ENERGY, ENERGY_T, ENERGY_T2, POWER2, POWER2_T, RATE, RATE_T

TABLE_7_1: Final = {
    "extended": np.array([0.1016, 0.0, 0.3984e-6, 0.4887, 0.0, 0.0, 0.66e-2]),
    "quasi-static": np.array([0.1016, 0.0, 0.3984e-6, 0.0, 0.0, 0.0, 0.0]),
}
"""Coefficients, disc in degC."""
SHARE: Final = {"front": 0.325, "rear": 0.175}
"""Of the car's mass that one brake of the axle slows. Assumption."""


def specific_wear(
    coefficients: Array, temperature: Array, power: Array | float, rate: Array | float
) -> Array:
    """Return k_b [g/MJ] of (7.13), corrected to |omega'|; arguments of one shape, or numbers.

    `temperature` of the disc [degC], `power` of friction [MW], `rate` |omega'|/omega [1/s].
    """
    g = coefficients
    quasi_static = g[0] + g[1] * temperature + g[2] * temperature**2
    return np.asarray(quasi_static + (g[3] + g[4] * temperature) * rate + (g[5] + g[6] * temperature) * power)


def wear_surface(coefficients: Array, speed: Array, temperature: Array, decel: float, mass: float) -> Array:
    """Return k_b [g/MJ] over `temperature` [degC] (rows) and `speed` [m/s] (columns), as Figure 7.9.

    The brake alone slows `mass` [kg] at `decel` [m/s^2].
    """
    return specific_wear(coefficients, temperature[:, None], 1e-6 * mass * decel * speed, decel / speed)


def with_friction_error(regressors: Array, error: float) -> Array:
    """Return regressors, shape (7,), with a torque wrong by the relative `error`."""
    factors = np.full(7, 1.0 + error)
    factors[POWER2:] = (1.0 + error) ** 2
    return np.asarray(regressors * factors)


def with_temperature_error(regressors: Array, error: float) -> Array:
    """Return regressors, shape (7,), with a disc temperature wrong by `error` [K]."""
    wrong = regressors.copy()
    wrong[ENERGY_T2] += 2.0 * error * regressors[ENERGY_T] + error**2 * regressors[ENERGY]
    wrong[ENERGY_T] += error * regressors[ENERGY]
    wrong[RATE_T] += error * regressors[RATE]
    wrong[POWER2_T] += error * regressors[POWER2]
    return wrong


def sensitivity(coefficients: Array, regressors: Array, errors: Array, of: str) -> Array:
    """Return the relative error of a block's wear at each of `errors`, as Figure 7.10.

    `of` "friction" (relative) or "temperature" [K]; `regressors` shape (7,).
    """
    wrong = with_friction_error if of == "friction" else with_temperature_error
    mass = float(coefficients @ regressors)
    return np.array([float(coefficients @ wrong(regressors, each)) / mass - 1.0 for each in errors])
