"""Measurement of a wheel's speed, by tyre, brake and radius.

The torque T = s_m T_m + T_b + M_R and the wheel's inertia stand against the tyre force F; the force over load
gives slip by the inverse of the tyre's curve (`wheel.py`), slip and radius give wheel speed.

    F = -(T + I dv/dt / r) / r        n = F / F_Z     n_xy^2 = n_x^2 + n_y^2
    omega = v_i (1 + slip) / r        braking; v_i / ((1 - slip) r) driving (A.6)

Unmodelled effects enter the variance: lag of pressure, change of slip, a tyre near its peak, cornering, and
the noise of the torques used for the prediction.
"""

import math

from ecu.algorithm.brake import brake_gain_per_bar
from ecu.algorithm.estimation.joint.kalman import GATE, clear_derivatives, correct
from ecu.algorithm.estimation.joint.layout import (
    CHANGE,
    DEFLECTION_GAIN,
    DRIVE,
    LEVEL,
    LOAD,
    MASS,
    MOTOR,
    OFFSET,
    PEAK,
    PEAK_LOAD,
    RADIUS,
    RATIO,
    ROLLING,
    SIDE,
    SLIP_ERROR,
    STIFFNESS,
    WHEEL_RATIO,
    V,
)
from ecu.algorithm.estimation.joint.noise import motor_variance, skew
from ecu.algorithm.estimation.joint.sliding import side_share, wheel_slides
from ecu.algorithm.estimation.joint.wheel import (
    APPLIED,
    LEAST_OF_PEAK,
    combined_slip,
    friction,
    peak_adhesion,
    radius,
    torque_at,
)
from ecu.jit import Record, kernel

TRANSIENT = 1.0  # of a slip's change since the last window
CURVED = 1.0  # of the part of a slip beyond that of a linear tyre: uncertainty of the peak
CORNERING = 1.0  # of slip, per squared lateral adhesion: load and slip angle are then uncertain
LOW_SPEED_NOISE = 0.15  # m/s
CHANGED = 4.0  # times the squared gate, of a rolling wheel whose radius is another one
ROLLS = 60.0  # N m, of a motor, below which a wheel that is not braked rolls freely


@kernel
def predict_wheel(params: Record, state: Record, i: int, ground: float) -> float:
    """Return the expected mean speed of a wheel [rad/s] in this window.

    Sets `state.h`, and slip and force of the wheel. Derivatives are taken at the last window's smooth
    pressure: this window's noise in both would bias the learned states.

    Args:
        params: `PARAMS`.
        state: `JOINT_STATE`.
        i: wheel.
        ground: speed of the wheel over ground in its direction [m/s].
    """
    x, h, w = state.x, state.h, state.window
    load, pressure, smooth = w.load[i], w.pressure[i], state.last_smooth[i]
    r, deflection_gain = radius(params, state, i, load)
    motor_scale, lever, mu = math.exp(x[MOTOR]), brake_gain_per_bar(params, i), friction(params, state, i)
    motor, braked = w.motor[i] * motor_scale, torque_at(state, i, lever * mu, pressure)
    # With the mass, so that air drag alone reveals a scale common to mass and all torques.
    heavier = math.exp(x[MASS])
    own = heavier * (params.rolling_resistance * load * r + params.wheel_inertia[i] * w.change / r)
    force = -(braked + motor + own) / r
    scale = 1.0 / (heavier * load)
    relative = load / params.static_load[i]
    log_relative = math.log(relative)
    exponent = params.stiffness_degression[i] + x[LOAD]
    rear = x[RATIO] if i >= 2 else 0.0
    by_side = side_share(x[SIDE], i)
    side = by_side * x[SIDE]
    stiffness = params.slip_stiffness[i] * math.exp(x[STIFFNESS] + rear + side) * relative**-exponent
    peak = peak_adhesion(state, relative)
    used = force * scale
    slip, _, _ = combined_slip(used, w.across, stiffness, peak)
    state.slip[i], state.force[i] = slip, force
    state.curved = slip - used / stiffness
    if slip < 0.0:
        omega, by_slip = ground * (1.0 + slip) / r, ground / r
    else:
        keep = max(1.0 - slip, 0.1)
        omega, by_slip = ground / (keep * r), ground / (keep * keep * r)
    driven = state.motors.last_smooth[i] * motor_scale
    used += (braked - torque_at(state, i, lever * mu, smooth) + motor - driven) * scale / r
    slip, slope, by_peak = combined_slip(used, w.across, stiffness, peak)
    state.unsettled = state.slip[i] - slip
    clear_derivatives(state)
    h[V] = omega / max(ground, 0.1)
    by_force = by_slip * slope * scale
    state.per_torque = -by_force / r
    h[LEVEL + i] = -by_force * lever * mu * max(smooth - x[OFFSET + i // 2], 0.0) / r
    h[CHANGE + i // 2] = h[LEVEL + i]
    h[OFFSET + i // 2] = by_force * lever * mu / r if smooth > 0.5 else 0.0
    h[MOTOR] = -by_force * driven / r
    h[MASS] = -by_slip * slope * (used + own * scale / r)
    h[STIFFNESS] = -by_slip * slip
    if i >= 2:
        h[RATIO] = -by_slip * slip
    h[LOAD] = by_slip * slip * log_relative
    h[PEAK] = by_slip * by_peak / max(1.0 - 4.0 * x[PEAK], LEAST_OF_PEAK)
    h[PEAK_LOAD] = by_slip * by_peak * log_relative
    h[SIDE] = -by_slip * slip * by_side
    h[SLIP_ERROR + i // 2] = by_slip
    h[RADIUS + i] = h[ROLLING] = -omega - by_slip * slope * used  # a larger wheel needs less force
    h[DEFLECTION_GAIN] = h[RADIUS + i] * deflection_gain / r
    h[DRIVE + i // 2] = 0.5 * by_force * params.mass
    return omega


@kernel
def correct_by_wheel(
    params: Record, state: Record, i: int, before: float, moving: bool, observing: bool
) -> None:
    """Correct the state by a wheel's mean speed in this window.

    Args:
        params: `PARAMS`.
        state: `JOINT_STATE`, overwritten.
        i: wheel.
        before: the car's speed before the first correction of this window [m/s].
        moving: the car is fast enough for slip to be defined; otherwise the wheel corrects the speed alone.
        observing: the brakes are applied and learning is active.
    """
    w, x = state.window, state.x
    n = w.omega_samples[i]
    ground = max(w.ground[i] + x[V] - before, 0.0)
    omega = predict_wheel(params, state, i, ground)
    if not moving:
        clear_derivatives(state)
        r = params.wheel_radius[i]
        state.h[V] = 1.0 / r
        correct(
            state, w.omega[i] - ground / r, (params.sigma_wheel_speed**2 + (LOW_SPEED_NOISE / r) ** 2) / n
        )
        return
    per_bar = state.h[OFFSET + i // 2]
    variance = params.sigma_wheel_speed**2 / n
    variance += per_bar**2 * (w.pressure_variance[i] + skew(state, i) ** 2)
    transient = TRANSIENT * state.unsettled * ground / params.wheel_radius[i]
    corner = CORNERING * w.across * w.across * state.slip[i] * ground / params.wheel_radius[i]
    curved = CURVED * state.curved * ground / params.wheel_radius[i]
    variance += transient * transient + corner * corner + curved * curved
    state.last_slip[i] = state.slip[i]
    variance += state.per_torque**2 * motor_variance(state, i, observing)
    innovation = w.omega[i] - omega
    mass, motor = state.free[MASS], state.free[MOTOR]
    state.free[MASS] = state.free[MOTOR] = 0
    state.ratio[WHEEL_RATIO + i] = correct(state, innovation, variance)
    state.free[MASS], state.free[MOTOR] = mass, motor
    rolls = state.free[RADIUS + i] != 0 and not observing and abs(w.motor[i]) < ROLLS
    if rolls and state.ratio[WHEEL_RATIO + i] > CHANGED * GATE * GATE:
        state.p[RADIUS + i, RADIUS + i] += (innovation / omega) ** 2  # it has changed: it is learned anew
    state.signed_ratio[i] = math.copysign(min(state.ratio[WHEEL_RATIO + i], GATE * GATE), innovation)
    state.observed[i] = 1 if observing and state.smooth_pressure[i] > 2.0 * APPLIED else 0


@kernel
def correct_by_wheels(params: Record, state: Record, before: float, moving: bool, observing: bool) -> bool:
    """Correct the state by every wheel that indicates vehicle speed; return whether a wheel speed arrived.

    Arguments as for `correct_by_wheel`.
    """
    w, came = state.window, False
    for i in range(4):
        state.observed[i], state.signed_ratio[i] = 0, 0.0
        if w.omega_samples[i] == 0:
            continue
        came = True
        state.slides[i] = 1 if wheel_slides(params, state, i) else 0
        if not state.slides[i]:
            state.untrusted_s = 0.0
            correct_by_wheel(params, state, i, before, moving, observing)
    return came
