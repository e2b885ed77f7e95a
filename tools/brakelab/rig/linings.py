"""Fault bits that tell of a car's linings: friction is further from the configured one than is compensated.

That is no fault that the rig injects and none of the ECU: the same bits come on a sound car whose linings rub
a third less than its configuration says. The rig knows the truth and holds the bits against it.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector
from brakelab.report.drive import DriveResult
from ecu.algorithm.control.limiter import LEAST_TORQUE
from ecu.algorithm.control.pressure_law import GREATEST_CHANGE
from ecu.contract.faults import BRAKE_FADE, DEMAND_LIMITED
from ecu.contract.signals import CORNERS
from ecu.settings.config import Config, new_params

OF_LININGS: Final = BRAKE_FADE | DEMAND_LIMITED
TOLERANCE: Final = 1.05
"""The ECU judges by its estimate of friction, whose error this is."""


def friction_ratios(truth: DriveResult, vehicle: Config) -> tuple[Vector, Vector]:
    """Return true friction over what the ECU may expect, and over the configured one, shape (n, 4) each.

    Expected is the configured friction, or the greatest that the wheel had before: its base is learned.
    """
    nominal = new_params(vehicle)["mu_nominal"][0]
    mu = np.stack([truth.column(f"mu_b_{corner}") for corner in CORNERS], axis=1)
    return mu / np.maximum(np.maximum.accumulate(mu, axis=0), nominal), mu / nominal


def beyond_compensation(truth: DriveResult, vehicle: Config) -> NDArray[np.bool_]:
    """Return the rows in which linings of a wheel are, or were, beyond what is compensated, shape (n,).

    Were counts: the pressure law begins each application with what the last one taught.
    """
    expected, configured = friction_ratios(truth, vehicle)
    weak = expected < (1.0 - GREATEST_CHANGE) * TOLERANCE
    strong = configured > 1.0 / (LEAST_TORQUE * TOLERANCE)
    return np.logical_or.accumulate((weak | strong).any(axis=1))


def tell_linings(truth: DriveResult, vehicle: Config) -> str:
    """Return which linings are furthest from the configured friction, as text."""
    _, configured = friction_ratios(truth, vehicle)
    furthest = np.unravel_index(np.argmax(np.abs(np.log(configured))), configured.shape)
    change = 100.0 * (float(configured[furthest]) - 1.0)
    axle = "front" if furthest[1] < 2 else "rear"
    return (
        f"{axle} linings {abs(change):.0f} % {'above' if change > 0.0 else 'below'} the configured friction"
    )
