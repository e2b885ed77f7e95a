"""Lining wear with its uncertainty: the wear law corrected by measured thicknesses.

States, of each corner: the mass M worn off at the last measurement and one factor s on the law's wear, by
which the thesis scales its dynamometer law to the road (7.6, from one measurement; here from all of them):

    M(t) = M_k + s g(t)        g: mass by the law since then, coefficients times regressors
    s' = noise, walk^2 per gram; beside it M scatters by weather and roads, scatter^2 per gram

s starts at 1 with the law's spread and, relative to the mass so far, the errors of friction and temperature.
A measured thickness is a measured M (`pad_geometry.py`); both states are corrected by Kalman's rule. All of
it is computed anew from the stored values, so that another law reinterprets the same regressors and
measurements. Linings not registered as new when counting began may have any wear: the belief begins at half
a life, with the deviation of a uniform distribution, and what is left of them is not reported before they are
measured.
"""

import math

import numpy as np

from ecu.algorithm.monitoring.pad_geometry import area_share, mass_of, thickness_lost
from ecu.jit import Record, kernel

BELIEF = np.dtype(
    [
        ("mass", "f8", (4,)),  # worn off at the last measurement, or when counting began [g]
        ("law", "f8", (4,)),  # mass by the law at that time [g]
        ("scale", "f8", (4,)),
        ("mass_variance", "f8", (4,)),  # g^2
        ("covariance", "f8", (4,)),  # of mass and scale [g]
        ("scale_variance", "f8", (4,)),
    ],
    align=True,
)

NEW_SIGMA = 0.15  # mm: spread of new linings, and run-in wear beyond the law (Figure 7.12)
UNIFORM = math.sqrt(12.0)  # width of a uniform distribution over its standard deviation
LEAST_SCALE = 0.2


@kernel
def mass_by_law(params: Record, regressors: Record, i: int) -> float:
    """Return the mass [g] that the law gives for regressors, shape (7, 4), at corner i."""
    mass = 0.0
    for j in range(7):
        mass += params.wear_law[j, i] * regressors[j, i]
    return mass


@kernel
def _input_variance(params: Record, wear: Record, i: int) -> float:
    """Return the relative variance of the wear by that of friction and temperature."""
    mass = mass_by_law(params, wear.regressors, i)
    if mass <= 0.0:
        return 0.0
    by_friction = mass_by_law(params, wear.friction_error, i) / mass
    by_temperature = mass_by_law(params, wear.temperature_error, i) / mass
    return by_friction * by_friction + by_temperature * by_temperature


@kernel
def _ahead(params: Record, state: Record, i: int, law: float) -> tuple[float, float, float, float]:
    """Return mass [g], its variance, its covariance with the scale and the scale's variance at `law` [g]."""
    g = max(law - state.law[i], 0.0)
    walk = params.wear_walk[i] * params.wear_walk[i]
    mass = state.mass[i] + state.scale[i] * g
    variance = state.mass_variance[i] + g * (2.0 * state.covariance[i] + g * state.scale_variance[i])
    covariance = state.covariance[i] + g * state.scale_variance[i] + 0.5 * walk * g * g
    variance += walk * g * g * g / 3.0 + params.wear_scatter[i] * params.wear_scatter[i] * g
    return mass, variance, covariance, state.scale_variance[i] + walk * g


@kernel
def unregistered(params: Record, i: int) -> tuple[float, float]:
    """Return mean and deviation of the thickness lost [mm] by linings of which nobody said anything."""
    return 0.5 * params.pad_life[i], params.pad_life[i] / UNIFORM


@kernel
def is_known(wear: Record, i: int) -> bool:
    """Return whether the linings of corner i were registered as new, or measured."""
    return bool(wear.told[i] != 0 or wear.measurements[i] > 0)


@kernel
def believe(params: Record, state: Record, wear: Record, i: int) -> None:
    """Compute the belief of corner i from all values stored in `wear`."""
    lost, deviation = (0.0, NEW_SIGMA) if wear.told[i] else unregistered(params, i)
    sigma = deviation * params.pad_mass[i] * area_share(params, i, lost)
    state.mass[i] = mass_of(params, i, lost)
    state.law[i] = state.covariance[i] = 0.0
    state.scale[i], state.mass_variance[i] = 1.0, sigma * sigma
    own = params.wear_sigma[i] * params.wear_sigma[i]
    state.scale_variance[i] = own
    if wear.measurements[i] > 0:
        state.scale_variance[i] = own + _input_variance(params, wear, i)
    for k in range(wear.measurements[i]):
        law = mass_by_law(params, wear.measured_at[k], i)
        mass, variance, covariance, of_scale = _ahead(params, state, i, law)
        measured = wear.measured_wear[k, i]
        sigma = wear.measured_sigma[k, i] * params.pad_mass[i] * area_share(params, i, measured)
        surprise = mass_of(params, i, measured) - mass
        whole = variance + sigma * sigma
        gain, gain_scale = variance / whole, covariance / whole
        state.mass[i], state.law[i] = mass + gain * surprise, law
        state.scale[i] = max(state.scale[i] + gain_scale * surprise, LEAST_SCALE)
        state.mass_variance[i] = (1.0 - gain) * variance
        state.covariance[i] = (1.0 - gain) * covariance
        state.scale_variance[i] = of_scale - gain_scale * covariance


@kernel
def worn(params: Record, state: Record, wear: Record, i: int) -> tuple[float, float, float]:
    """Return the wear of corner i: mass [g] of both pads, thickness [mm], its standard deviation [mm]."""
    law = mass_by_law(params, wear.regressors, i)
    mass, variance, _, _ = _ahead(params, state, i, law)
    if wear.measurements[i] == 0:
        variance += law * law * _input_variance(params, wear, i)
    lost = thickness_lost(params, i, mass)
    sigma = math.sqrt(max(variance, 0.0)) / (params.pad_mass[i] * area_share(params, i, lost))
    return mass, lost, sigma
