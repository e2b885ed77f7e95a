"""A drive cut into windows of half a second: means of all signals, and what the car does in each.

A window is *free* (no brake within 0.3 s), *braking* (a brake acts all along), or left out; *steady* where
the acceleration hardly changes, *straight* where the car hardly turns. Manoeuvres group what shares its
errors: one application of the brakes, or twenty seconds of the rest.
"""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from brakelab.arrays import Vector
from brakelab.identify.vehicle.reader import RATE, DriveSamples, Rows
from brakelab.logs.physics.line import MOVING
from ecu.contract.signals import CORNERS

SECONDS: Final = 0.5
SMOOTH: Final = 0.2  # s
GUARD: Final = 0.3  # s beside a brake
APPLIED: Final = 1.5  # bar above a pressure's zero
STRAIGHT: Final = 0.4  # m/s^2 across
STEADY: Final = (0.4, 0.15)  # m/s^2, change of acceleration within a window; per acceleration
SPIN: Final = 1.12  # of the slowest wheel: one slides
STANDING: Final = 0.2  # rad/s
BLOCK: Final = 20.0  # s, of what is driven without brakes
NEEDED: Final = ("wheel_speed", "accel_x", "yaw_rate", "vehicle_speed", "calliper_pressure", "motor_torque")
"""Inputs that a window is not without, where the drive has them."""
FLOORED: Final = 0.05  # share of samples at 0, none below: a sensor that cannot report less


class Windows(NamedTuple):
    """Means of windows; of signals by half of the samples, shape (2, n) or (4, 2, n); NaN: not sent."""

    drive: NDArray[np.int64]
    t: Vector
    """s since the drive's begin."""
    omega: Vector
    spin_up: Vector
    """rad/s^2, of the axles by halves, shape (2, 2, n)."""
    accel: Vector
    accel_sum: Vector
    """Integral of accel_x from the drive's begin [m/s], so that its steps belong to those of a mean speed."""
    accel_y: Vector
    yaw_rate: Vector
    speed: Vector
    """Reference [m/s]."""
    speed_rate: Vector
    """m/s^2"""
    pressure: Vector
    """bar over its zero."""
    motor: Vector
    free: Rows
    braking: Rows
    steady: Rows
    straight: Rows
    standing: Rows
    cluster: NDArray[np.int64]


def pressure_zeros(drive: DriveSamples) -> Vector:
    """Return the reading of each released brake [bar], shape (4,); 0 of a sensor that cannot report less."""
    zeros = np.zeros(4)
    if not drive.has("calliper_pressure"):
        return zeros
    for corner, name in enumerate(f"calliper_pressure_{corner}" for corner in CORNERS):
        both, noise = drive.halves[name], drive.spread[name]
        if both.min() >= 0.0 and np.mean(both[0] <= 1e-9) > FLOORED:
            continue
        smooth = uniform_filter1d(drive.mean(name), int(SMOOTH * RATE))
        low = np.percentile(smooth, 5)
        released = smooth < low + max(4.0 * noise / np.sqrt(SMOOTH * RATE), 0.3)
        for _ in range(3):
            calm = ~maximum_filter1d(~released, int(4 * GUARD * RATE))
            if not calm.any():
                break
            zeros[corner] = drive.mean(name)[calm].mean()
            spread = max(5.0 * noise / np.sqrt(SMOOTH * RATE), 0.5)
            released = smooth < zeros[corner] + spread
    return zeros


def _brakes(drive: DriveSamples, zeros: Vector) -> Rows:
    """Return the rows in which a brake is applied, shape (n,)."""
    if not drive.has("calliper_pressure"):
        return np.zeros(len(drive), np.bool_)
    smooth = [
        uniform_filter1d(drive.mean(f"calliper_pressure_{corner}"), int(SMOOTH * RATE)) - zero
        for corner, zero in zip(CORNERS, zeros, strict=True)
    ]
    noise = max(drive.spread[f"calliper_pressure_{corner}"] for corner in CORNERS)
    least = max(APPLIED, 4.0 * noise / np.sqrt(2.0 * SMOOTH * RATE))
    return np.asarray(np.maximum(smooth[0] + smooth[1], smooth[2] + smooth[3]) > 2.0 * least)


def cut(drives: Sequence[DriveSamples], zeros: Sequence[Vector], radius: float) -> Windows:
    """Return the windows of all drives; `zeros` of each drive's pressures, `radius` [m] is rough."""
    parts = [_cut(drive, zero, radius) for drive, zero in zip(drives, zeros, strict=True)]
    joined = []
    first = 0
    for place, part in enumerate(parts):
        joined.append(part._replace(drive=part.drive + place, cluster=part.cluster + first))
        first += int(part.cluster.max()) + 1 if len(part.cluster) else 0
    columns: list[Any] = [np.concatenate(column, axis=-1) for column in zip(*joined, strict=True)]
    return Windows(*columns)


def _cut(drive: DriveSamples, zeros: Vector, radius: float) -> Windows:
    width = int(SECONDS * RATE)
    count = len(drive) // width

    def mean(values: Vector) -> Vector:
        blocks = values[..., : count * width].reshape(*values.shape[:-1], count, width)
        return np.asarray(blocks.mean(axis=-1))

    lever = np.arange(width) - 0.5 * (width - 1)
    lever = RATE * lever / (lever @ lever)

    def slope(values: Vector) -> Vector:
        blocks = values[..., : count * width].reshape(*values.shape[:-1], count, width)
        return np.asarray(blocks @ lever)

    def optional(name: str) -> Vector:
        return drive.halves[name] if name in drive else np.full((2, len(drive)), np.nan)

    def whole(rows: Rows) -> Rows:
        return np.asarray(rows[: count * width].reshape(count, width).all(axis=1))

    omega = drive.corners("wheel_speed")
    brake = _brakes(drive, zeros)
    near = maximum_filter1d(brake, int(2 * GUARD * RATE) + 1)
    calm = uniform_filter1d(drive.mean("accel_x"), int(SMOOTH * RATE))
    blocks = calm[: count * width].reshape(count, width)
    change = blocks.max(axis=1) - blocks.min(axis=1)
    known = np.ones(len(drive), np.bool_)
    for name in drive.known:
        if name.startswith(NEEDED):
            known &= drive.known[name]
    means = mean(omega)
    level = means.mean(axis=1)
    moving = level.min(axis=0) * radius > MOVING
    spins = level.max(axis=0) > SPIN * np.maximum(level.min(axis=0), STANDING)
    across = np.abs(mean(optional("yaw_rate")).mean(axis=0)) * level.mean(axis=0) * radius
    still = np.abs(level).max(axis=0) < STANDING
    good = whole(known) & moving & ~spins
    torque = np.full((4, 2, count), np.nan)
    if drive.has("motor_torque"):
        torque = mean(drive.corners("motor_torque"))
    pressure = np.full((4, 2, count), np.nan)
    if drive.has("calliper_pressure"):
        pressure = mean(drive.corners("calliper_pressure")) - zeros[:, None, None]
    braking = whole(brake)
    return Windows(
        drive=np.zeros(count, np.int64),
        t=np.asarray((np.arange(count) + 0.5) * SECONDS, np.float64),
        omega=means,
        spin_up=slope(omega).reshape(2, 2, 2, count).mean(axis=1),
        accel=mean(drive.halves["accel_x"]),
        accel_sum=mean(np.cumsum(drive.halves["accel_x"], axis=1) / RATE),
        accel_y=mean(optional("accel_y")),
        yaw_rate=mean(optional("yaw_rate")),
        speed=mean(optional("vehicle_speed")),
        speed_rate=slope(optional("vehicle_speed")),
        pressure=pressure,
        motor=torque,
        free=good & whole(~near),
        braking=good & braking,
        steady=change < STEADY[0] + STEADY[1] * np.abs(blocks.mean(axis=1)),
        straight=~(across > STRAIGHT),
        standing=whole(known) & still,
        cluster=_clusters(braking),
    )


def _clusters(braking: Rows) -> NDArray[np.int64]:
    """Return the manoeuvre of each window, shape (n,): an application, or a block of the rest."""
    begins = np.diff(braking.astype(np.int64), prepend=0) != 0
    block = np.arange(len(braking)) // int(BLOCK / SECONDS)
    changed = begins | (~braking & (np.diff(block, prepend=0) != 0))
    return np.cumsum(changed)
