"""Friction of a stranger's brake linings and the temperature of his discs.

    T_b = G mu max(p - p_0, 0)
    dT/dt = xi P_b - (d_0 + d_1 v) (T - T_ambient)

Kinds of lining, level mu_0 and strength a:

    constant        mu_0
    rising          mu_0 (1 + a smoothstep((T - 50) / 300)), race pads: a = 0.5
    fading          mu_0 (1 - a / (1 + exp((420 - T) / 50)))
    load and speed  mu_0 (p / 30 bar)^(-a/3) (v / 30 m/s)^(-a/3)
    green           mu_0 (1 - a exp(-E / E_0)), bedding in by the brake's work E
"""

from typing import NamedTuple

import numpy as np

from ecu.jit import kernel

CONSTANT, RISING, FADING, LOAD_AND_SPEED, GREEN = range(5)


class Brake(NamedTuple):
    """Brakes of a car; pairs are front and rear, of one wheel."""

    gain_front: float  # G, N m per bar at friction 1
    gain_rear: float
    push_out: float  # p_0 [bar]
    kind: int
    level_front: float  # mu_0
    level_rear: float
    strength: float  # a
    bedding: float  # E_0 [J]
    heat_front: float  # xi [K/J]
    heat_rear: float
    cooling: float  # d_0 [1/s]
    cooling_by_speed: float  # d_1 [1/m]
    rear_share: float  # rear line pressure over the front one
    valve_knee: float  # front pressure beyond which a valve holds the rear back [bar]
    valve_slope: float  # of the rear share beyond it
    lag: float  # calliper behind line pressure [s]


@kernel
def friction(
    brake: Brake, level: float, temperature: float, pressure: float, speed: float, work: float
) -> float:
    """Return the lining's friction coefficient at disc temperature [degC], bar, m/s and work so far [J]."""
    if brake.kind == RISING:
        u = min(max((temperature - 50.0) / 300.0, 0.0), 1.0)
        return level * (1.0 + brake.strength * u * u * (3.0 - 2.0 * u))
    if brake.kind == FADING:
        return level * (1.0 - brake.strength / (1.0 + np.exp((420.0 - temperature) / 50.0)))
    if brake.kind == LOAD_AND_SPEED:
        both = max(pressure, 3.0) / 30.0 * max(speed, 3.0) / 30.0
        return level * both ** (-brake.strength / 3.0)
    if brake.kind == GREEN:
        return level * (1.0 - brake.strength * np.exp(-work / brake.bedding))
    return level


def warm_level(kind: int, strength: float) -> float:
    """Return what a data sheet's friction of warm linings is over mu_0."""
    return 1.0 + 0.6 * strength if kind == RISING else 1.0


@kernel
def rear_pressure(brake: Brake, front: float) -> float:
    """Return the rear line pressure [bar] to a front one."""
    if front < brake.valve_knee:
        return brake.rear_share * front
    return brake.rear_share * (brake.valve_knee + brake.valve_slope * (front - brake.valve_knee))
