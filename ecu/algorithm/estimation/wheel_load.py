"""Wheel loads from the quasi-static load transfer (4.33).

    F_Z,f = m g l_r / (2 L) - m a_x h / (2 L) -+ m a_y h l_r / (b L)     left -, right +
    F_Z,r = m g l_f / (2 L) + m a_x h / (2 L) -+ m a_y h l_f / (b L)

Corrected: the rear lines use l_f, static and lateral (printed: l_r, with which the loads do not sum to m g).
Accelerations are specific forces in road axes, first-order lagged because the body takes time to pitch and
roll.
"""

import math

import numpy as np

from ecu.contract.params import GRAVITY
from ecu.jit import Record, kernel

WHEEL_LOAD_STATE = np.dtype([("accel_x", "f8"), ("accel_y", "f8"), ("load", "f8", (4,))], align=True)

# A wheel load never falls to zero: slip and stiffness would be undefined.
MIN_LOAD_SHARE = 0.1


@kernel
def update_wheel_load(
    params: Record, state: Record, accel_x: float, accel_y: float, speed: float, dt: float
) -> None:
    """Overwrite `state.load` [N] from specific forces in road axes [m/s^2] and speed [m/s].

    Air drag acts at the centre of gravity (assumption), so the tyre forces that balance it transfer load too.
    """
    gain = 1.0 - math.exp(-dt / max(params.load_transfer_lag, 1e-6))
    state.accel_x += gain * (accel_x - state.accel_x)
    state.accel_y += gain * (accel_y - state.accel_y)
    mass, length = params.mass, params.wheelbase
    tyres = mass * state.accel_x + params.drag_area * speed * abs(speed)
    pitch_transfer = tyres * params.cog_height / (2.0 * length)
    for i in range(4):
        opposite = params.rear_axle if i < 2 else params.front_axle
        static = mass * GRAVITY * opposite / (2.0 * length)
        roll_transfer = mass * state.accel_y * params.cog_height * opposite / (params.track * length)
        load = static - pitch_transfer if i < 2 else static + pitch_transfer
        load += -roll_transfer if i % 2 == 0 else roll_transfer
        state.load[i] = max(load, MIN_LOAD_SHARE * static)
