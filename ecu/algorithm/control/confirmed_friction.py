"""Friction of the pressure law as far as the car's deceleration confirms it.

An estimate that is too high lowers the pressure. It may have risen by what one input says, a wheel speed or
the speed over ground; the force of all brakes is known otherwise:

    r = (-a + d - drag / m - f_roll g) / a_dem                         while the demand is steady

While r is at least `CONFIRMS`, the friction in use counts as confirmed. Below `LEAST_SHARE` what it has risen
by since is taken back, until r is `AGREES`; where that is not enough, up to `LOWER` of the confirmed friction
too: the linings have changed since. All is given again slowly. A friction that falls raises the pressure: it
is followed, but where r is above `TOO_MUCH` already. What it has fallen by is then taken back slowly.

Until a friction was confirmed, all of a rise is one over the base, and more than what is missing. Then what r
will be once hydraulics and car have followed what is taken back already is predicted (a Smith predictor, with
their lag as a model), and counts: without it twice of what is missing was given, and wheels locked.

d is what the accelerometer has moved by against the wheels of late, at their deceleration (c and s of
`accel_error.py`): a drift, or the road. A negative d counts against a rise: two witnesses, accelerometer and
wheels, must confirm what lowers the pressure. A positive one counts where friction is lowered beyond what was
confirmed. On a road that falls away a true rise waits until d is usual, and the car brakes the harder for it.

While the accelerometer is left out, the wheels' deceleration stands for a, less the slope of before, c, where
that counts against a rise. What was taken below the confirmed friction on its word is given again at once;
until any was confirmed c is not known, and no rise is followed.
"""

import numpy as np

from ecu.algorithm.lag import lag_gain
from ecu.algorithm.monitoring.accel_blocks import rolled_accel
from ecu.algorithm.monitoring.error_line import moved_scale
from ecu.algorithm.vehicle import tyre_slip
from ecu.contract.params import GRAVITY
from ecu.jit import Record, kernel

CONFIRMED_STATE = np.dtype(
    [
        ("friction", "f8", (4,)),  # last that was confirmed, 0: none yet
        ("asked", "f8"),  # deceleration demanded and given, low-passed [m/s^2]
        ("given", "f8"),
        ("usual", "f8"),  # c, low-passed [m/s^2]
        ("heading", "f8"),  # torque over that at the base friction: of the friction that is aimed at
        ("in_use", "f8"),  # of the friction in use
        ("pressed", "f8"),  # of that which the pressures have followed
        ("followed", "f8"),  # of that which `given` has followed
        ("steady_s", "f8"),
        ("excess", "f8"),  # of r over `TOO_MUCH`, relative
        ("back", "f8"),  # share of an unconfirmed rise that is taken back; above 1, of `LOWER` too
    ],
    align=True,
)

LEAST_SPEED = 3.0  # m/s: a car that stands does not decelerate
LEAST_DECEL = 2.0  # m/s^2: at less the accelerometer's zero counts for too much
LAG, STEADY, SETTLED_S = 0.15, 0.05, 0.3  # s, of the demand, s: hydraulics and tyres have followed
USUAL_LATENESS, TYRES = 0.063, 0.037  # s: dead time and lag (A.17), tyres
LEAST_SHARE, AGREES, CONFIRMS = 0.92, 0.95, 0.93
TAKE, WIDTH = 10.0, 0.04  # 1/s at an error of `WIDTH`
FIRST_WIDTH = 0.4  # until a friction was confirmed: no more than hydraulics and car can follow
GIVE, GIVE_FAST, OVER = 0.05, 0.5, 1.04  # 1/s, 1/s where more than that is given
LOWER, LOWERING = 0.3, 0.25  # of the friction, 1/s at an error of `WIDTH`: slow against the lag
TOO_MUCH = 1.08  # r that zero and scale of the accelerometer do not explain
FOLLOW_S, USUAL_S = 0.5, 30.0


@kernel
def confirm_friction(
    params: Record,
    state: Record,
    estimate: Record,
    used: Record,
    line: Record,
    blocks: Record,
    decel: float,
    calm: bool,
    slowness: float,
    dt: float,
) -> None:
    """Confirm the friction in use by the car's deceleration, or contradict it.

    Args:
        params: `PARAMS`.
        state: `CONFIRMED_STATE`, overwritten.
        estimate: `ESTIMATE` of this cycle.
        used: friction in use, shape (4,).
        line: `LINE_STATE`, what the accelerometer differs from the wheels by.
        blocks: `ACCELERATION_STATE`, for the acceleration of the wheels.
        decel: demanded [m/s^2], NaN: unknown.
        calm: the ECU alone brakes, forwards, no wheel or axle is held back and no brake has failed.
        slowness: of the hydraulics.
        dt: time since the last cycle [s].
    """
    state.excess, measured, known = 0.0, estimate.measured != 0, state.friction[0] > 0.0
    rolled, offset = rolled_accel(blocks), line.now.offset
    accel, drifted = estimate.accel_x, offset + moved_scale(line) * min(rolled, 0.0) - state.usual
    if not measured:
        accel, drifted = rolled * (1.0 + tyre_slip(params, rolled)) + max(state.usual, 0.0), 0.0
    else:
        state.usual += (offset - state.usual) * min(dt / USUAL_S, 1.0)
    if not decel > LEAST_DECEL:
        state.asked = state.given = state.steady_s = 0.0
        state.pressed = state.followed = 1.0
        return
    resistance = params.drag_area * estimate.speed**2 / params.mass + params.rolling_resistance * GRAVITY
    gain = lag_gain(dt, LAG)
    state.asked += gain * (decel - state.asked)
    state.given += gain * (-accel - resistance - state.given)
    state.pressed += lag_gain(dt, USUAL_LATENESS * slowness + TYRES) * (state.in_use - state.pressed)
    state.followed += gain * (state.pressed - state.followed)
    moves = (measured or known) and estimate.speed > LEAST_SPEED
    steady = calm and moves and abs(decel - state.asked) < STEADY * decel
    state.steady_s = state.steady_s + dt if steady else 0.0
    if not measured:
        state.back += min(max(1.0 - state.back, -TAKE * dt), 0.0 if known else TAKE * dt)
    if state.steady_s < SETTLED_S * max(slowness, 1.0):
        return
    state.excess = max(state.given / (TOO_MUCH * state.asked) - 1.0, 0.0)
    if state.back >= 1.0:
        drifted = max(drifted, 0.0)
    else:
        drifted = min(drifted, 0.0) if known else 0.0
    share = (state.given + drifted) / state.asked
    coming, width = share, WIDTH
    if not known:
        coming, width = share * state.heading / state.followed, FIRST_WIDTH
    missing = (AGREES if state.back > 0.0 else LEAST_SHARE) - coming
    if state.back > 1.0 or (state.back == 1.0 and missing > 0.0):
        lowering = LOWERING * min(max(missing / WIDTH, -1.0), 1.0)
        state.back = min(max(state.back + lowering * dt, 1.0), 2.0)
    elif missing > 0.0:
        state.back = min(state.back + TAKE * min(missing / width, 1.0) * dt, 1.0)
    else:
        state.back = max(state.back - (GIVE_FAST if coming > OVER else GIVE) * dt, 0.0)
    if state.back == 0.0 and state.excess == 0.0 and share > CONFIRMS:
        if not known:
            state.usual = offset  # of the road that the first braking was on
        for i in range(4):
            state.friction[i] += (used[i] - state.friction[i]) * (dt / FOLLOW_S if known else 1.0)


@kernel
def confirmed_friction(state: Record, mu: float, corner: int, base: float) -> float:
    """Return the friction `mu` without what is taken back of it; `base` until one was confirmed."""
    confirmed: float = state.friction[corner]
    if confirmed == 0.0:
        return mu - min(state.back, 1.0) * max(mu - base, 0.0)
    most: float = mu - min(state.back, 1.0) * max(mu - confirmed, 0.0)
    return min(most, confirmed * (1.0 - LOWER * (state.back - 1.0))) if state.back > 1.0 else most


@kernel
def least_friction(state: Record, mu: float, used: float, corner: int, base: float, dt: float) -> float:
    """Return the friction `mu`, fallen from what was confirmed no further than the deceleration allows."""
    if state.excess == 0.0:
        return mu
    reference = state.friction[corner] if state.friction[corner] > 0.0 else base
    return max(mu, min(used * (1.0 + state.excess * dt / FOLLOW_S), max(reference, used)))
