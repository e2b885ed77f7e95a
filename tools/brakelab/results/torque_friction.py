"""Friction by measured torque over time: recursive least squares with forgetting (thesis, 3.1)."""

from typing import Final

import numpy as np

from brakelab.arrays import Vector

MEMORY: Final = 0.1  # s
_INFORMATION: Final = 1e-3  # (N m)^2, before the first sample, of friction 0


def friction_over_time(torque: Vector, pressure: Vector, lever: float, dt: float) -> Vector:
    """Return mu_b, shape as `torque` [N m]; `pressure` [Pa] on the pads, `lever` 2 A_k r_eff [m^3]."""
    from scipy.signal import lfilter

    forget = float(np.exp(-dt / MEMORY))
    pressed = lever * pressure
    known = _INFORMATION * forget ** np.arange(1, len(torque) + 1)
    both, square = (
        lfilter([1.0], [1.0, -forget], product) for product in (pressed * torque, pressed * pressed)
    )
    return np.asarray(both / (square + known))
