"""Corrections by one wheel's speed and by the whole car's balance: the variance of each measurement.

What a model leaves out stands in the variance: signals that lag each other, a slip that changes, a tyre near
its peak, a curve, and the noise of the torques that the prediction was made from.
"""

import math

from ecu.algorithm.estimation.joint.kalman import GATE, clear_derivatives, correct
from ecu.algorithm.estimation.joint.layout import MASS, MOTOR, OFFSET, V
from ecu.algorithm.estimation.joint.pressure import follows
from ecu.algorithm.estimation.joint.prior import SCALE_ONLY, UNKNOWN_KICKS
from ecu.algorithm.estimation.joint.sampling import ACCEL
from ecu.algorithm.estimation.joint.wheel import brake_lever, friction, predict_balance, predict_wheel
from ecu.contract.params import GRAVITY
from ecu.jit import Record, kernel

APPLIED = 1.0  # bar above push-out: the brakes act
COLOURED = 20.0  # times the variance of white noise: what an inverter's torque errs by is not white
SLIDING_FORCE = 0.3  # relative error of the force of a wheel that seems too fast, taken for its brake force
BALANCE_FLOOR = 0.01  # m/s^2 that the balance leaves out
BALANCE_SHARE = 0.004  # of the deceleration
SKEW_FOLLOWED, SKEW_REPORTED = 0.5, 3.0  # windows between pressure and force; a foreign log is worse
ACROSS = 0.4  # of the lateral acceleration: stands for less that lasts a second
SKEW_ACCEL = 0.5  # windows between acceleration and torques
TRANSIENT = 1.0  # of a slip's change since the last window
CURVED = 1.0  # of a slip's part beyond that of a linear tyre: what the peak is not known for
CORNERING = 1.0  # of slip, per squared adhesion used sideways: then load and slip angle are not well known
LOW_SPEED_NOISE = 0.15  # m/s


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
        moving: the car is fast enough for slip to mean something; else the wheel tells the speed alone.
        observing: the brakes are on and something is learned.
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
    variance += per_bar**2 * (w.pressure_variance[i] + _skew(state, i) ** 2)
    transient = TRANSIENT * state.unsettled * ground / params.wheel_radius[i]
    corner = CORNERING * w.across * w.across * state.slip[i] * ground / params.wheel_radius[i]
    curved = CURVED * state.curved * ground / params.wheel_radius[i]
    variance += transient * transient + corner * corner + curved * curved
    state.last_slip[i] = state.slip[i]
    variance += state.per_torque**2 * _motor_variance(state, i, observing)
    innovation = w.omega[i] - omega
    mass, motor = state.free[MASS], state.free[MOTOR]
    state.free[MASS] = state.free[MOTOR] = 0
    state.ratio[i] = correct(state, innovation, variance)
    state.free[MASS], state.free[MOTOR] = mass, motor
    state.pull[i] = math.copysign(min(state.ratio[i], GATE * GATE), innovation)
    state.observed[i] = 1 if observing and state.smooth_pressure[i] > 2.0 * APPLIED else 0


@kernel
def _skew(state: Record, i: int) -> float:
    """Return what a pressure [bar] may be off because it acts earlier or later than it is told."""
    windows = SKEW_FOLLOWED if follows(state.pressures, i) else SKEW_REPORTED
    skew: float = windows * (state.smooth_pressure[i] - state.last_smooth[i])
    return skew


@kernel
def _motor_variance(state: Record, i: int, braking: bool) -> float:
    """Return the variance of a wheel's mean motor torque in this window [(N m)^2]."""
    variance: float = state.motors.variance[i] / state.window.cycles
    return variance if braking else COLOURED * variance


@kernel
def correct_by_balance(params: Record, state: Record, braking: bool) -> None:
    """Correct the state by the force balance along the car; not where a wheel holds what the road gives."""
    w, wild = state.window, 0.0
    left = predict_balance(params, state, braking)
    variance = (
        params.sigma_accel**2 / max(state.sampling.samples[ACCEL], 1)
        + BALANCE_FLOOR**2
        + (BALANCE_SHARE * w.accel) ** 2
    )
    variance += (SKEW_ACCEL * (w.accel - state.last_accel)) ** 2
    variance += (ACROSS * w.across * GRAVITY) ** 2 + (UNKNOWN_KICKS * (1.0 - state.drive_known)) ** 2
    for i in range(4):
        per_bar = brake_lever(params, i) * friction(params, state, i)
        per_torque = 1.0 / (params.wheel_radius[i] * params.mass)
        per_bar *= per_torque
        variance += per_torque**2 * _motor_variance(state, i, braking)
        wild += per_torque * abs(w.motor[i])
        if state.smooth_pressure[i] > 0.5:
            variance += per_bar**2 * (w.pressure_variance[i] + _skew(state, i) ** 2)
        if state.slides[i] and w.omega[i] * params.wheel_radius[i] < w.ground[i]:
            return  # what it holds is the road's to say
        if state.slides[i]:
            variance += (SLIDING_FORCE * per_bar * w.pressure[i]) ** 2
    wild *= max(params.sigma_motor_torque - SCALE_ONLY, 0.0)
    variance += wild * wild * (1.0 if braking else COLOURED)
    state.ratio[4] = correct(state, -left, variance)
