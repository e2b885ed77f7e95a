"""Line between two decelerations, y = c + s h, by a Kalman filter of two states, and what it usually is.

`accel_error.py` has two: by what they have moved from the usual line, an error that comes shows.
"""

import math

import numpy as np

from ecu.algorithm.monitoring.accel_blocks import BLOCK_S
from ecu.jit import Record, kernel

_FIT = np.dtype(
    [
        ("offset", "f8"),  # m/s^2
        ("scale", "f8"),
        ("p", "f8", (3,)),  # variances of both, covariance
    ],
    align=True,
)
LINE_STATE = np.dtype(
    [
        ("now", _FIT),
        ("usual", _FIT),  # while nothing has moved
        ("offset_s", "f8"),  # learning times of that [s]
        ("scale_s", "f8"),
    ],
    align=True,
)

SCALE_MOST = 0.05  # standard deviation
LARGEST_SCALE = 0.5


@kernel
def correct_line(line: Record, h: float, innovation: float, noise: float) -> None:
    """Correct a line by a difference at `h` [m/s^2]."""
    p = line.p
    to_offset, to_scale = p[0] + h * p[2], p[2] + h * p[1]
    variance = to_offset + h * to_scale + noise * noise
    line.offset += to_offset / variance * innovation
    line.scale = min(max(line.scale + to_scale / variance * innovation, -LARGEST_SCALE), LARGEST_SCALE)
    p[0] -= to_offset * to_offset / variance
    p[1] -= to_scale * to_scale / variance
    p[2] -= to_offset * to_scale / variance


@kernel
def widen_line(line: Record, offset: float, scale: float) -> None:
    """Widen a line by a block's random walk."""
    line.p[0] += offset * offset * BLOCK_S
    line.p[1] = min(line.p[1] + scale * scale * BLOCK_S, SCALE_MOST**2)


@kernel
def sigma_line(line: Record, h: float) -> float:
    """Return the standard deviation of a line at `h` [m/s^2]."""
    return math.sqrt(max(line.p[0] + h * (2.0 * line.p[2] + h * line.p[1]), 0.0))


@kernel
def learn_offset(line: Record, memory_s: float) -> None:
    """Let the usual offset follow that of now, over `memory_s` at most."""
    line.offset_s = min(line.offset_s + BLOCK_S, memory_s)
    line.usual.offset += (line.now.offset - line.usual.offset) * BLOCK_S / line.offset_s


@kernel
def learn_scale(line: Record, memory_s: float) -> None:
    """Let the usual scale follow that of now, over `memory_s` at most."""
    line.scale_s = min(line.scale_s + BLOCK_S, memory_s)
    line.usual.scale += (line.now.scale - line.usual.scale) * BLOCK_S / line.scale_s


@kernel
def moved_offset(line: Record) -> float:
    """Return what the offset of a line has moved by [m/s^2]; of that by the wheels it is c less the slope."""
    moved: float = line.now.offset - line.usual.offset
    return moved


@kernel
def moved_scale(line: Record) -> float:
    """Return what the scale of a line has moved by [-]."""
    moved: float = line.now.scale - line.usual.scale
    return moved


@kernel
def lesser(one: float, other: float) -> float:
    """Return the one of two values that is nearer to zero; 0 where their signs differ."""
    if one * other <= 0.0:
        return 0.0
    return one if abs(one) < abs(other) else other
