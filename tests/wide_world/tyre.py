"""Longitudinal grip of a stranger's tyre: a curve with a peak that falls towards sliding.

    F = mu(F_z) F_z g(x),  x = C s / mu,  mu(F_z) = grip (F_z / F_z0)^-e

s is slip (v - omega r) / v, positive while braking, C the slip stiffness over load, and g a curve with
slope 1 at the origin and greatest value 1, of one of three kinds:

    brush        cubic of a parabolic contact pressure, sliding friction falls off beyond it
    Dugoff       1 - 1 / (4 x) beyond x = 1/2, times a friction that falls with sliding
    exponential  y exp((1 - y^q) / q), y = x / exp(1 / q), down to the sliding friction
"""

from typing import NamedTuple

import numpy as np

from ecu.jit import kernel

BRUSH, DUGOFF, EXPONENTIAL = range(3)
DECAY = 3.0, 12.0  # x over which the friction of brush and Dugoff falls


class Tyre(NamedTuple):
    """Tyres of a car, front and rear alike."""

    kind: int
    stiffness: float  # C, slip stiffness over load at the reference load
    shape: float  # q of the exponential curve
    fall: float  # share of the peak that is lost in full sliding
    top: float  # greatest value of the curve before it is scaled to 1: `greatest`
    exponent: float  # e of friction over load
    load: float  # F_z0 [N]


@kernel
def _unscaled(kind: int, x: float, shape: float, fall: float) -> float:
    if kind == BRUSH:
        if x < 3.0:
            theta = x / 3.0
            return 3.0 * theta - 3.0 * theta**2 + theta**3
        return 1.0 - fall * (1.0 - np.exp((3.0 - x) / DECAY[0]))
    if kind == DUGOFF:
        falling = 1.0 - fall * (1.0 - np.exp(-x / DECAY[1]))
        return falling * (x if x < 0.5 else 1.0 - 0.25 / x)
    y = x * np.exp(-1.0 / shape)
    rise = y * np.exp((1.0 - y**shape) / shape)
    return rise if y < 1.0 else 1.0 - fall + fall * rise


@kernel
def curve(tyre: Tyre, x: float) -> float:
    """Return g(x) for x >= 0."""
    return _unscaled(tyre.kind, x * tyre.top, tyre.shape, tyre.fall) / tyre.top


def greatest(kind: int, shape: float, fall: float) -> float:
    """Return the greatest value of the unscaled curve, for `Tyre.top`."""
    return max(_unscaled(kind, x, shape, fall) for x in np.arange(0.01, 40.0, 0.01))


@kernel
def grip_left(tyre: Tyre, load: float, grip: float, lateral: float) -> float:
    """Return the peak longitudinal friction that load and cornering leave.

    Args:
        tyre: the tyre.
        load: wheel load [N].
        grip: peak friction of tyre and road at the reference load.
        lateral: lateral force over load: the ellipse leaves the rest of the grip, at least a fifth.
    """
    peak = grip * (load / tyre.load) ** -tyre.exponent
    return peak * np.sqrt(max(1.0 - (lateral / peak) ** 2, 0.04))


@kernel
def braking_force(tyre: Tyre, slip: float, load: float, left: float) -> float:
    """Return the force [N] against the motion, negative for negative slip; `left` is that of `grip_left`."""
    force = left * load * curve(tyre, tyre.stiffness * abs(slip) / left)
    return force if slip >= 0.0 else -force


@kernel
def spin(
    tyre: Tyre, omega: float, speed: float, torque: float, inertia: float, radius: float, load: float,
    left: float, dt: float,
) -> tuple[float, float]:  # fmt: skip
    """Return wheel speed [rad/s] after dt and the mean braking force [N] until then.

    I omega' = r F(s) - T is stiff: an implicit Euler step, linear in omega. Beyond the peak the slope is
    left out, so a wheel falls into lock by its inertia. A wheel that stands slides at the force of lock.

    Args:
        tyre: the tyre.
        omega: wheel speed [rad/s].
        speed: of the car [m/s].
        torque: of brake and engine against the rotation [N m].
        inertia: of the wheel and what turns with it [kg m^2].
        radius: rolling radius [m].
        load: wheel load [N].
        left: as `grip_left` returns it.
        dt: step [s].
    """
    reference = max(speed, 1.0)
    slip = (speed - omega * radius) / reference
    force = braking_force(tyre, slip, load, left)
    ahead = braking_force(tyre, slip + 1e-4, load, left)
    slope = max((ahead - force) / 1e-4, 0.0) * radius / reference  # -dF / domega
    change = dt * (force * radius - torque) / (inertia + dt * radius * slope)
    if omega + change < 0.0:
        return 0.0, braking_force(tyre, speed / reference, load, left)
    return omega + change, force - slope * change
