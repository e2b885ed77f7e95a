"""What is asked for: pedal to deceleration, the automated demand, torque per wheel (5.1, Figure 4.2).

a_dem = max(pedal map, valid decel_demand)
T_b,dem = m a_dem r                                     (5.1)
front share = (l_r + z h) / L,  z = a_dem / g           ideal distribution: equal adhesion of the axles
"""

import math

from ecu.estimation.motion import usable
from ecu.jit import Record, kernel
from ecu.params import GRAVITY, PEDAL_POINTS
from ecu.signals import DECEL_DEMAND, DECEL_DEMAND_VALID, PEDAL_POSITION

MAX_DECEL = 12.0  # m/s^2: no tyre on a road car holds more


@kernel
def pedal_to_decel(params: Record, position: float) -> float:
    """Return the deceleration [m/s^2] of a pedal position [%]: linear between the points of the map."""
    x, y = params.pedal_position, params.pedal_decel
    decel: float = y[0]
    for j in range(1, PEDAL_POINTS):
        if position > x[j - 1] and x[j] > x[j - 1]:
            decel = y[j - 1] + (y[j] - y[j - 1]) * min((position - x[j - 1]) / (x[j] - x[j - 1]), 1.0)
    return decel


@kernel
def automated_demand_valid(inputs: Record) -> bool:
    """Return whether an automated driver asks for a deceleration and vouches for it."""
    return (
        usable(inputs, DECEL_DEMAND)
        and usable(inputs, DECEL_DEMAND_VALID)
        and inputs.value[DECEL_DEMAND_VALID] > 0.5
    )


@kernel
def requested_decel(params: Record, inputs: Record) -> float:
    """Return the deceleration asked for [m/s^2], NaN where neither pedal nor demand is usable."""
    decel = math.nan
    if usable(inputs, PEDAL_POSITION):
        decel = pedal_to_decel(params, inputs.value[PEDAL_POSITION])
    if automated_demand_valid(inputs):
        asked = inputs.value[DECEL_DEMAND]
        decel = asked if math.isnan(decel) else max(decel, asked)
    return min(max(decel, 0.0), MAX_DECEL) if math.isfinite(decel) else math.nan


@kernel
def front_share(params: Record, decel: float) -> float:
    """Return the front axle's share of the brake force in the ideal distribution (Figure 4.2), at most 1."""
    share: float = (params.rear_axle + decel / GRAVITY * params.cog_height) / params.wheelbase
    return min(share, 1.0)


@kernel
def wheel_torque_demand(params: Record, decel: float, corner: int) -> float:
    """Return the brake torque demanded of one wheel [N m], >= 0."""
    share = front_share(params, decel)
    axle = share if corner < 2 else 1.0 - share
    torque: float = 0.5 * axle * params.mass * decel * params.wheel_radius[corner]
    return torque
