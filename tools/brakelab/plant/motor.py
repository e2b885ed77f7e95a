"""Four motors, each with its half shaft: first order with dead time (A.16), limited by map and battery.

Torque is that at the wheel, positive when it brakes (regenerates). The map has Figure A.7's shape: constant
torque, then constant power; below a wheel speed regeneration fades out. Above the nominal limits lies a peak
that the motor sustains for a time (30 s, Table A.1): use of the peak empties a reserve, which refills
otherwise, and the last second of the reserve fades the peak out. The battery's limits are shared equally by
the motors. Between wheel and battery copper, iron, gear and inverter take their part:

    P_battery = T w - copper T^2 - turning |w|

The motors are switched reluctance (A.2.2), which without current have no field and lose nothing.
"""

import math
from typing import Final

from brakelab.plant.hydraulics import look_back
from brakelab.plant.jit import Record, kernel

TIME_CONSTANT: Final = 0.0022  # s (A.16)
DEAD_TIME: Final = 0.0022  # s (A.16)
RECOVERY: Final = 1.0 / 3.0  # s of peak regained per second at or below the nominal torque. Assumption
PEAK_FADE: Final = 1.0  # s of reserve. Assumption
NOTHING: Final = 1e-100  # N m, below which a torque that decays is zero: subnormal numbers are slow
EXCITED: Final = 1.0  # N m at the wheel, from which on a motor has current


@kernel
def map_torque(torque_limit: float, power_limit: float, speed: float) -> float:
    """Return the torque [N m] of a map with these limits [N m, W] at a wheel speed >= 0 [rad/s]."""
    return min(torque_limit, power_limit / max(speed, 1.0))


@kernel
def motor_loss(params: Record, torque: float, speed: float) -> float:
    """Return the power [W] lost in a motor, its inverter and gear; `torque` and `speed` of the wheel."""
    if abs(torque) < EXCITED:
        return 0.0
    loss: float = params.motor_copper_loss * torque * torque + params.motor_turning_loss * abs(speed)
    return loss


@kernel
def advance_motors(params: Record, state: Record, dt: float) -> None:
    """Advance the four motor torques by `dt` [s]; the newest demand is in the history already."""
    asked = look_back(DEAD_TIME, dt, state.place)
    motors = 0
    for wheel in range(4):
        motors += params.motor_share[wheel] > 0.0
    for wheel in range(4):
        speed = abs(state.wheel_speed[wheel])
        if params.motor_share[wheel] > 0.0:
            nominal = map_torque(params.motor_torque_limit, params.motor_power_limit, speed)
            peak = map_torque(params.motor_peak_torque, params.motor_peak_power, speed)
        else:
            nominal = peak = 0.0
        drawn = abs(state.motor_torque[wheel]) - nominal
        if drawn > 0.0 and peak > nominal:
            state.peak_reserve[wheel] -= dt * min(drawn / (peak - nominal), 1.0)
        else:
            state.peak_reserve[wheel] += dt * RECOVERY
        state.peak_reserve[wheel] = min(max(state.peak_reserve[wheel], 0.0), params.motor_peak_time)
        limit = nominal + (peak - nominal) * min(state.peak_reserve[wheel] / PEAK_FADE, 1.0)
        drive_limit = min(limit, params.discharge_limit / (max(speed, 1.0) * max(motors, 1)))
        charge_limit = min(limit, params.charge_limit / (max(speed, 1.0) * max(motors, 1)))
        state.motor_limit[wheel] = charge_limit * min(speed / params.motor_fade_speed, 1.0)
        target = min(max(state.motor_history[asked, wheel], -drive_limit), state.motor_limit[wheel])
        torque = state.motor_torque[wheel]
        torque += (1.0 - math.exp(-dt / TIME_CONSTANT)) * (target - torque)
        state.motor_torque[wheel] = torque if abs(torque) > NOTHING else 0.0
