"""Share of the axles that emits least dust, or wears least, at equal deceleration (`control.minimise`).

    F = F_motors,front + F_motors,rear + F_linings           motors first, as far as they go
    x F = F_motors,front + y F_linings                       x: front's share of the force, y: of the linings'
    y = table over the temperatures of front and rear discs  x within [least(z), most(z)]

The tables are made when the configuration is read (`ecu/settings/lining_share.py`): y is the minimum that the
emission models, or the laws of wear, of CONFIG predict; the range of x is that of Annex 5 of ECE R13-H for
linings within 2 sigma, unladen and laden. Where the motors can do it all, x stays as near to the configured
distribution as their limits allow.

While the foot is off the brake y is taken as it is, in an application it moves by `SHARE_RATE`. The
configured distribution is left alone in reverse, beyond the tables, and from the moment that a wheel slips, a
brake has failed, another controller brakes or the car turns hard until the application ends: then grip
counts, not dust.
"""

import math

import numpy as np

from ecu.contract.params import GRAVITY, HEAT_NODES, HEAT_STEP, RATE_NODES, RATE_STEP
from ecu.jit import Record, kernel

CLEANER_STATE = np.dtype(
    [
        ("share", "f8"),  # y in use
        ("left_alone", "u1"),  # for the rest of this application
    ],
    align=True,
)

SHARE_RATE = 0.2  # 1/s
CALM_ACROSS = 3.0  # m/s^2


@kernel
def _node(value: float, step: float, nodes: int) -> tuple[int, float]:
    """Return the node below `value` and the fraction to the next, within the table."""
    place = min(max(value / step, 0.0), nodes - 1.0)
    below = min(int(place), nodes - 2)
    return below, place - below


@kernel
def admitted(params: Record, share: float, rate: float) -> float:
    """Return the share of the front axle within what Annex 5 admits at the braking rate `rate` [g]."""
    k, far = _node(rate, RATE_STEP, RATE_NODES)
    least = (1.0 - far) * params.least_share[k] + far * params.least_share[k + 1]
    most = (1.0 - far) * params.most_share[k] + far * params.most_share[k + 1]
    return min(max(share, least), most)


@kernel
def wanted_share(params: Record, heat: Record) -> float:
    """Return y for the discs' temperatures [degC], shape (4,); NaN: hotter than the table, or unknown."""
    front, rear = 0.5 * (heat[0] + heat[1]), 0.5 * (heat[2] + heat[3])
    hottest = HEAT_STEP * (HEAT_NODES - 1)
    if not (front <= hottest and rear <= hottest):
        return math.nan
    i, a = _node(front, HEAT_STEP, HEAT_NODES)
    j, b = _node(rear, HEAT_STEP, HEAT_NODES)
    table = params.wanted_share
    near: float = (1.0 - b) * table[i, j] + b * table[i, j + 1]
    far: float = (1.0 - b) * table[i + 1, j] + b * table[i + 1, j + 1]
    return (1.0 - a) * near + a * far


@kernel
def _force_share(params: Record, linings: float, motors: Record, front: float, force: float) -> float:
    """Return x for y = `linings`; `motors` [N m] as allowed, shape (4,), `force` [N] of all brakes."""
    by_front, by_rear = 0.0, 0.0
    for i in range(4):
        share = params.blending[i] * motors[i] / (params.wheel_radius[i] * force)
        if i < 2:
            by_front += share
        else:
            by_rear += share
    rest = 1.0 - by_front - by_rear
    if rest > 0.0:
        return by_front + linings * rest
    return min(max(front, 1.0 - by_rear), by_front)


@kernel
def lean(
    params: Record,
    state: Record,
    torque: Record,
    motors: Record,
    heat: Record,
    front: float,
    mass: float,
    decel: float,
    calm: bool,
    dt: float,
) -> None:
    """Share the torque demanded of the wheels anew.

    Args:
        params: `PARAMS`.
        state: `CLEANER_STATE`, overwritten.
        torque: of each wheel [N m], shape (4,), overwritten.
        motors: greatest torque planned for each wheel's motor [N m], shape (4,).
        heat: temperature of each disc [degC], shape (4,).
        front: the configured share of the front axle.
        mass: of the car [kg].
        decel: demanded [m/s^2], NaN: unknown.
        calm: nothing asks for the configured distribution; see above.
        dt: time since the last cycle [s].
    """
    wanted = wanted_share(params, heat)
    if not decel > 0.0:
        state.share, state.left_alone = wanted, 0
        return
    rate = decel / GRAVITY
    if not calm or math.isnan(wanted) or math.isnan(state.share) or rate > RATE_STEP * (RATE_NODES - 1):
        state.left_alone = 1
    if state.left_alone:
        return
    step = SHARE_RATE * dt
    state.share += min(max(wanted - state.share, -step), step)
    share = admitted(params, _force_share(params, state.share, motors, front, mass * decel), rate)
    for i in range(4):
        axle = share if i < 2 else 1.0 - share
        torque[i] = 0.5 * axle * mass * decel * params.wheel_radius[i]
