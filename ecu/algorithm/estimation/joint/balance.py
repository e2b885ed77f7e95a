"""Measurement of the force balance along the car: acceleration, drag and all torques must cancel.

    m (a_x - b) + drag + sum (T_i + I_i domega_i/dt) / r_i = 0

over the configured mass, taken at one time for all signals. Lags, persistent errors and unreported torques
enter the variance.
"""

import math

from ecu.algorithm.brake import brake_gain_per_bar
from ecu.algorithm.estimation.joint.kalman import GATE, REJECT, clear_derivatives, correct
from ecu.algorithm.estimation.joint.layout import (
    BALANCE_RATIO,
    BIAS,
    CHANGE,
    DRAG,
    DRIVE,
    LEVEL,
    MASS,
    MOTOR,
    OFFSET,
    OVERRUN,
    V,
)
from ecu.algorithm.estimation.joint.noise import COLOURED, motor_variance, skew
from ecu.algorithm.estimation.joint.prior import SCALE_ONLY, UNKNOWN_KICKS
from ecu.algorithm.estimation.joint.sampling import ACCEL
from ecu.algorithm.estimation.joint.wheel import brake_torque, friction, radius, torque_at
from ecu.contract.params import GRAVITY
from ecu.jit import Record, kernel

SLIDING_FORCE = 0.3  # relative error of the brake force taken for the force of a wheel that seems too fast
BALANCE_FLOOR = 0.01  # m/s^2, unmodelled in the balance
BALANCE_SHARE = 0.004  # of the deceleration
ACROSS = 0.4  # of the lateral acceleration: stands for a smaller error that lasts a second
LASTS = 0.05  # of that variance, the error's own: a window of a second
PERSISTS_S = 0.3  # beyond the gate on one side while braking: then the state is wrong, not the measurement
UNSEEN_SHARE = 0.15  # of the deceleration, while no wheel speed is known
SKEW_ACCEL = 0.5  # windows between acceleration and torques


@kernel
def predict_balance(params: Record, state: Record, braking: bool) -> float:
    """Return the residual of the car's balance over the configured mass [m/s^2]; sets `state.h`."""
    x, h, w, mass = state.x, state.h, state.window, params.mass
    clear_derivatives(state)
    speed, heavier = x[V], math.exp(x[MASS])
    drag = heavier * math.exp(x[DRAG]) * params.drag_area * speed * abs(speed) / mass
    left = heavier * (w.common_accel - x[BIAS] + w.lateral / mass) + drag
    # Mass-dependent terms use the earlier accelerometer mean: free of the noise of this window's torques.
    inert = heavier * (state.last_smooth_accel - x[BIAS] + w.lateral / mass) + drag
    linings, motor_scale = 0.0, math.exp(x[MOTOR])
    for i in range(4):
        r, _ = radius(params, state, i, w.load[i])
        driven = w.motor[i] * motor_scale
        own = heavier * (params.rolling_resistance * w.load[i] * r + params.wheel_inertia[i] * w.change / r)
        inert += own / (r * mass)
        per_bar, smooth = brake_gain_per_bar(params, i) * friction(params, state, i), state.last_smooth[i]
        left += (torque_at(state, i, per_bar, w.common_pressure[i]) + driven + own) / (r * mass)
        linings += torque_at(state, i, per_bar, smooth) / (r * mass)
        per_bar /= r * mass
        h[LEVEL + i] = per_bar * max(smooth - x[OFFSET + i // 2], 0.0)
        h[CHANGE + i // 2] += h[LEVEL + i]
        if smooth > 0.5:
            h[OFFSET + i // 2] -= per_bar
    h[MASS], h[MOTOR] = inert, -inert - linings
    h[BIAS] = -heavier
    h[DRAG] = drag
    h[DRIVE] = h[DRIVE + 1] = -1.0
    if braking:
        left += x[OVERRUN]
        h[OVERRUN] = 1.0
    return left


@kernel
def linings_tell(params: Record, state: Record, braking: bool) -> bool:
    """Return whether, without any wheel, the car's force is that of linings and motors, not of the road.

    No wheel shows whether it slides: then far less force than expected is no lining's.
    """
    w = state.window
    left = abs(predict_balance(params, state, braking))
    return w.reference_samples > 0 and left < UNSEEN_SHARE * abs(w.accel)


@kernel
def _left_before(params: Record, state: Record, left: float) -> float:
    """Return the residual [m/s^2] that the friction before this application would leave, of `left` now."""
    x = state.x
    for i in range(4):
        moved = x[LEVEL + i] + x[CHANGE + i // 2] - state.before[i]
        torque = brake_torque(params, state, i, state.window.common_pressure[i])
        left -= torque * (1.0 - math.exp(-moved)) / (params.wheel_radius[i] * params.mass)
    return left


@kernel
def correct_by_balance(params: Record, state: Record, braking: bool) -> None:
    """Correct the state by the force balance along the car, unless a wheel's force is limited by the road."""
    w, wild = state.window, 0.0
    left = predict_balance(params, state, braking)
    variance = (
        params.sigma_accel**2 / max(state.sampling.samples[ACCEL], 1)
        + BALANCE_FLOOR**2
        + (BALANCE_SHARE * w.accel) ** 2
    )
    variance += (SKEW_ACCEL * (w.accel - state.last_accel)) ** 2
    variance += (UNKNOWN_KICKS * (1.0 - state.drive_known)) ** 2
    for i in range(4):
        per_bar = brake_gain_per_bar(params, i) * friction(params, state, i)
        per_torque = 1.0 / (params.wheel_radius[i] * params.mass)
        per_bar *= per_torque
        variance += per_torque**2 * motor_variance(state, i, braking)
        wild += per_torque * abs(w.motor[i])
        if state.smooth_pressure[i] > 0.5:
            variance += per_bar**2 * (w.pressure_variance[i] + skew(state, i) ** 2)
        if state.slides[i] and w.omega[i] * params.wheel_radius[i] < w.ground[i]:
            return  # its force is limited by the road's adhesion
        if state.slides[i]:
            variance += (SLIDING_FORCE * per_bar * w.pressure[i]) ** 2
    wild *= max(params.sigma_motor_torque - SCALE_ONLY, 0.0)
    variance += wild * wild * (1.0 if braking else COLOURED)
    since = state.left_s if state.left_s * left > 0.0 else 0.0
    persists = abs(since) >= PERSISTS_S
    wheels_err = persists and abs(_left_before(params, state, left)) < abs(left)
    gate, reject = math.inf if wheels_err else GATE, math.inf if persists else REJECT
    across = (ACROSS * w.across * GRAVITY) ** 2
    excess = 0.0 if persists else (1.0 - LASTS) * across
    ratio = correct(state, -left, variance + LASTS * across + excess, gate, reject)
    beyond = braking and ratio * (left * left + GATE * GATE * excess) > GATE * GATE * left * left
    state.left_s = since + math.copysign(w.time, left) if beyond else 0.0
    state.ratio[BALANCE_RATIO] = ratio
