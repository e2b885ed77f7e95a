"""Combustion engine in overrun: what it takes from the driven wheels while the throttle is closed.

Friction and pumping of the crankshaft, T = drag_torque + drag_growth n, reach the wheels through the overall
ratio of the gear. An automatic gearbox holds the highest gear in which the engine turns at `lowest_speed` at
least; below that in first gear the clutch opens. No sensor of the simulated car reports this torque.

The motors stand for the engine's pull, so as much of the drag is gone as they drive with.
"""

import math
from typing import Final

from brakelab.plant.jit import Record, kernel
from brakelab.plant.records import GEARS

CLOSING: Final = 0.2  # s, throttle and manifold, and a change of gear. Assumption


@kernel
def overrun_torque(params: Record, wheel_speed: float) -> float:
    """Return the torque [N m] at all driven wheels together, throttle closed, at their mean speed [rad/s]."""
    ratio = params.engine_ratio[0]
    for gear in range(1, GEARS):
        if params.engine_ratio[gear] * wheel_speed >= params.engine_lowest_speed:
            ratio = params.engine_ratio[gear]
    speed = ratio * max(wheel_speed, 0.0)
    clutch = min(speed / params.engine_lowest_speed, 1.0)
    crankshaft: float = clutch * (params.engine_drag_torque + params.engine_drag_growth * speed)
    return ratio * crankshaft


@kernel
def advance_engine(params: Record, state: Record, dt: float) -> None:
    """Advance the torque [N m] that the engine takes from each wheel by `dt` [s]; none without an engine."""
    if params.engine_ratio[0] == 0.0:
        return
    speed = 0.0
    driving = 0.0
    for wheel in range(4):
        speed += params.engine_share[wheel] * state.wheel_speed[wheel]
        driving += max(-state.motor_torque[wheel], 0.0)
    asked = max(overrun_torque(params, speed) - driving, 0.0)
    gain = 1.0 - math.exp(-dt / CLOSING)
    for wheel in range(4):
        target = params.engine_share[wheel] * asked
        state.engine_torque[wheel] += gain * (target - state.engine_torque[wheel])
