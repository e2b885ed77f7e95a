"""Ranges of learned values: what no lining, wheel or car can have is not taken from a store or a ring."""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ecu.algorithm.estimation.joint.whole_filter import HIGHEST_STATE, LOWEST_STATE
from ecu.algorithm.monitoring.wear import ENERGY, ENERGY_T, POWER2, POWER2_T, RATE, RATE_T
from ecu.contract.records import N_MEASURED, RecordArray

MU_RANGE: Final = (0.5, 1.5)  # of nominal
RADIUS_ERROR_LIMIT: Final = 0.03
DISC_EXCESS_LIMIT: Final = 2000.0  # K above the air, with its error
JOINT_LIMIT: Final = 1.5
"""Of any state of the joint observer: logarithms, and the rest is smaller still."""
FARTHEST_DISTANCE: Final = 1e10  # m, of an odometer
THICKEST_PAD: Final = 50.0  # mm
COLDEST_DISC: Final = -100.0  # degC
LEAST_EIGENVALUE: Final = 1e-6  # of a correlation matrix, below zero: rounding


def out_of_range(learned: RecordArray, mu_nominal: NDArray[np.float64]) -> str:
    """Return the name of the first implausible value of `learned` (shape (1,)), empty if there is none."""
    row = learned[0]
    known = row["observed_s"] > 0  # of a corner never observed, the friction is not checked
    share = row["mu_b"] / mu_nominal
    sigma = row["sigma_mu_b"]
    p = covariance_of(row["joint_covariance"])
    checks = {
        "observed_s": np.isfinite(row["observed_s"]) & (row["observed_s"] >= 0),
        "mu_b": ~known | ((share >= MU_RANGE[0]) & (share <= MU_RANGE[1])),
        "sigma_mu_b": ~known | (np.isfinite(sigma) & (sigma > 0)),
        "radius_error": np.abs(row["radius_error"]) <= RADIUS_ERROR_LIMIT,
        "radius_sigma": np.isfinite(row["radius_sigma"]) & (row["radius_sigma"] > 0),
        "joint": np.abs(row["joint"]) <= JOINT_LIMIT,
        "joint_covariance": np.asarray(not row["joint_known"] or is_covariance(p)),
        "whole": (row["whole"] >= LOWEST_STATE) & (row["whole"] <= HIGHEST_STATE),
        "whole_covariance": np.asarray(is_covariance(covariance_of(row["whole_covariance"]))),
        "disc_excess": (row["disc_excess"] >= 0) & (row["disc_excess"] <= DISC_EXCESS_LIMIT),
        "brakings": np.asarray(row["brakings"] >= 0),
    }
    first = next((name for name, good in checks.items() if not good.all()), "")
    return first or wear_out_of_range(learned["wear"]) or dust_out_of_range(learned["dust"])


def wear_out_of_range(wear: RecordArray) -> str:
    """Return the name of the first implausible value of `wear` (shape (1,)), empty if there is none."""
    row = wear[0]
    checks = {
        name: np.isfinite(row[name]) & (row[name] >= 0) for name in ("friction_error", "temperature_error")
    }
    checks |= {name: _are_sums(row[name]) for name in ("regressors", "leg_ends", "measured_at")}
    checks["odometer"] = np.asarray(0 <= row["odometer"] <= FARTHEST_DISTANCE)
    checks["fitted_at"] = (row["fitted_at"] >= 0) & (row["fitted_at"] <= row["odometer"])
    checks["told"] = np.isin(row["told"], (0, 1))
    checks["measurements"] = (row["measurements"] >= 0) & (row["measurements"] <= N_MEASURED)
    used = np.arange(N_MEASURED)[:, None] < row["measurements"]
    checks["measured_wear"] = ~used | (np.abs(row["measured_wear"]) <= THICKEST_PAD)
    checks["measured_sigma"] = ~used | ((row["measured_sigma"] > 0) & (row["measured_sigma"] <= THICKEST_PAD))
    checks["legs"] = np.asarray(0 <= row["legs"] <= FARTHEST_DISTANCE)
    return next((name for name, good in checks.items() if not good.all()), "")


def _are_sums(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which regressors of wear, shape (..., N_REGRESSORS, 4), a disc above `COLDEST_DISC` gives."""
    least = np.zeros_like(values)
    for with_temperature, without in ((ENERGY_T, ENERGY), (RATE_T, RATE), (POWER2_T, POWER2)):
        least[..., with_temperature, :] = COLDEST_DISC * np.abs(values[..., without, :])
    return np.isfinite(values) & (values >= least)


def dust_out_of_range(dust: RecordArray) -> str:
    """Return the name of the first implausible value of `dust` (shape (1,)), empty if there is none."""
    row = dust[0]
    checks = {name: np.isfinite(row[name]) and row[name] >= 0 for name in ("particles", "work", "told_work")}
    checks["way"] = 0 <= row["way"] <= FARTHEST_DISTANCE
    checks["applications"] = row["applications"] >= 0
    return next((name for name, good in checks.items() if not good), "")


def covariance_of(triangle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the symmetric matrix whose lower triangle, by rows, is `triangle`."""
    n = int(math.sqrt(2 * len(triangle)))
    matrix = np.zeros((n, n))
    matrix[np.tril_indices(n)] = triangle
    return matrix + np.tril(matrix, -1).T


def is_covariance(matrix: NDArray[np.float64]) -> bool:
    """Return whether a symmetric matrix, shape (n, n), is a covariance: finite, no eigenvalue below 0."""
    if not np.isfinite(matrix).all() or (np.diag(matrix) < 0).any():
        return False
    sigma = np.sqrt(np.maximum(np.diag(matrix), 1e-30))
    return bool(np.linalg.eigvalsh(matrix / np.outer(sigma, sigma)).min() > -LEAST_EIGENVALUE)
