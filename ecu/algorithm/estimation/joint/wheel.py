"""Measurement models of one wheel and of the whole car, with analytic derivatives by the states.

Wheel: torque T = s_m T_m + T_b + M_R and the wheel's inertia stand against the tyre force, the force over
load gives slip by the inverse of the tyre's curve, slip and radius give wheel speed.

    F = -(T + I dv/dt / r) / r        n = F / F_Z     u = n / D
    slip = (c D / C) tan(asin(u) / c)                 inverse Magic Formula with E = 0
    slip_x = slip(n_xy) n_x / n_xy                    n_xy^2 = n_x^2 + n_y^2, as a tyre that corners
    omega = v_i (1 + slip) / r        braking; v_i / ((1 - slip) r) driving (A.6)

Car: m (a_x - b) + drag + sum (T_i + I_i domega_i/dt) / r_i = 0.
"""

import math

from ecu.algorithm.estimation.joint.kalman import clear_derivatives
from ecu.algorithm.estimation.joint.layout import (
    BIAS,
    CHANGE,
    DRAG,
    DRIVE,
    LEVEL,
    LOAD,
    MASS,
    MOTOR,
    OFFSET,
    OVERRUN,
    PEAK,
    PEAK_LOAD,
    RADIUS,
    RATIO,
    ROLLING,
    SIDE,
    SINKING,
    SLIP_ERROR,
    STIFFNESS,
    V,
)
from ecu.algorithm.estimation.joint.prior import SCALE_ONLY, UNKNOWN_PER_ERROR
from ecu.algorithm.vehicle import rolling_radius
from ecu.contract.params import BAR
from ecu.jit import Record, kernel

SHAPE = 1.6  # c of the Magic Formula
NOMINAL_PEAK = 0.9  # adhesion
PEAK_DEGRESSION = 0.05  # adhesion falls a little with load (Figure A.6)
LEAST_OF_PEAK = 0.2  # of 1 - 4 y: a peak half as high again as usual
STEEPEST = 0.93  # of the peak; the curve goes on straight from there


@kernel
def slip_of_force(used: float, stiffness: float, peak: float) -> tuple[float, float]:
    """Return slip and its derivative by the adhesion used (force over load); `stiffness` over load."""
    u = used / peak
    inside = min(max(u, -STEEPEST), STEEPEST)
    tangent = math.tan(math.asin(inside) / SHAPE)
    slope = (1.0 + tangent * tangent) / (math.sqrt(1.0 - inside * inside) * stiffness)
    return peak * SHAPE * tangent / stiffness + slope * peak * (u - inside), slope


@kernel
def combined_slip(used: float, across: float, stiffness: float, peak: float) -> tuple[float, float, float]:
    """Return slip along and its derivatives by `used` and ln `peak`, of a tyre that carries `across`."""
    if across == 0.0:
        slip, slope = slip_of_force(used, stiffness, peak)
        return slip, slope, slip - slope * used
    both = math.sqrt(used * used + across * across)
    slip, slope = slip_of_force(both, stiffness, peak)
    along = used / both
    by_used = slope * along * along + slip / both * (1.0 - along * along)
    return slip * along, by_used, along * (slip - slope * both)


@kernel
def brake_lever(params: Record, i: int) -> float:
    """Return brake torque per friction and pressure [N m/bar] of a wheel."""
    lever: float = 2.0 * BAR * params.piston_area[i] * params.effective_radius[i]
    return lever


@kernel
def radius(params: Record, state: Record, i: int, load: float) -> tuple[float, float]:
    """Return the rolling radius [m] of a wheel and its derivative by the logarithm of its sinking."""
    at_rest = params.wheel_radius[i]
    nominal = rolling_radius(load, params.unloaded_radius[i], params.vertical_stiffness[i])
    change = (nominal - at_rest) * math.exp(state.x[SINKING])
    scale = math.exp(state.x[ROLLING] + state.x[RADIUS + i])
    return (at_rest + change) * scale, change * scale


@kernel
def friction(params: Record, state: Record, i: int) -> float:
    """Return the lining friction of a wheel."""
    mu: float = params.mu_nominal[i] * math.exp(state.x[LEVEL + i] + state.x[CHANGE + i // 2])
    return mu


@kernel
def peak_adhesion(state: Record, relative: float) -> float:
    """Return the tyres' peak adhesion at a load over that at rest.

    D = D_0 (1 - 4 y)^(-1/4): slip near the peak is about linear in y, so a y that noise has pushed up can
    come back; in ln D its derivative would be gone by then.
    """
    y = state.x[PEAK]
    at_rest: float = NOMINAL_PEAK * max(1.0 - 4.0 * y, LEAST_OF_PEAK) ** -0.25
    peak: float = at_rest * relative ** (state.x[PEAK_LOAD] - PEAK_DEGRESSION)
    return peak


@kernel
def brake_torque(params: Record, state: Record, i: int, pressure: float) -> float:
    """Return the brake torque [N m] at a pressure above push-out [bar]."""
    if pressure == 0.0:
        return 0.0
    acts = pressure - state.x[OFFSET + i // 2]
    torque: float = brake_lever(params, i) * friction(params, state, i) * acts
    return torque


@kernel
def unknown_share(params: Record, state: Record) -> float:
    """Return what is unknown of the drive, over that of a car that reports no motor torque."""
    share: float = min(UNKNOWN_PER_ERROR * max(params.sigma_motor_torque - SCALE_ONLY, 0.0), 1.0)
    return share if state.motors.samples[0] + state.motors.samples[2] > 0 else 1.0


@kernel
def predict_wheel(params: Record, state: Record, i: int, ground: float) -> float:
    """Return the mean speed of a wheel [rad/s] to expect of this window.

    Sets `state.h`, and slip and force of the wheel. Derivatives are taken at the last window's smooth
    pressure: were the noise of this window's own in both, it would bias what is learned.

    Args:
        params: `PARAMS`.
        state: `JOINT_STATE`.
        i: wheel.
        ground: speed of the wheel over ground in its direction [m/s].
    """
    x, h, w = state.x, state.h, state.window
    load, pressure, smooth = w.load[i], w.pressure[i], state.last_smooth[i]
    r, sinking = radius(params, state, i, load)
    motor = w.motor[i] * math.exp(x[MOTOR])
    # With the mass, so that nothing but air drag tells a scale common to mass and all torques.
    heavier = math.exp(x[MASS])
    own = heavier * (params.rolling_resistance * load * r + params.wheel_inertia[i] * w.change / r)
    force = -(brake_torque(params, state, i, pressure) + motor + own) / r
    scale = 1.0 / (heavier * load)
    relative = load / params.static_load[i]
    exponent = params.stiffness_degression[i] + x[LOAD]
    rear = x[RATIO] if i >= 2 else 0.0
    side = 0.5 * x[SIDE] if i % 2 == 0 else -0.5 * x[SIDE]
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
    driven = state.motors.last_smooth[i] * math.exp(x[MOTOR])
    later = brake_torque(params, state, i, pressure) - brake_torque(params, state, i, smooth)
    used += (later + motor - driven) * scale / r
    slip, slope, by_peak = combined_slip(used, w.across, stiffness, peak)
    state.unsettled = state.slip[i] - slip
    clear_derivatives(state)
    h[V] = omega / max(ground, 0.1)
    mu = friction(params, state, i)
    lever = brake_lever(params, i)
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
    h[LOAD] = by_slip * slip * math.log(relative)
    h[PEAK] = by_slip * by_peak / max(1.0 - 4.0 * x[PEAK], LEAST_OF_PEAK)
    h[PEAK_LOAD] = by_slip * by_peak * math.log(relative)
    h[SIDE] = -by_slip * slip * (0.5 if i % 2 == 0 else -0.5)
    h[SLIP_ERROR + i // 2] = by_slip
    h[RADIUS + i] = h[ROLLING] = -omega - by_slip * slope * used  # a larger wheel needs less force
    h[SINKING] = h[RADIUS + i] * sinking / r
    h[DRIVE + i // 2] = 0.5 * by_force * params.mass
    return omega


@kernel
def car_force(params: Record, state: Record, accel: float) -> float:
    """Return the force of all tyres along the car [N] at a specific force [m/s^2], with what is learned."""
    x = state.x
    drag = math.exp(x[DRAG]) * params.drag_area * x[V] * abs(x[V])
    force: float = math.exp(x[MASS]) * (params.mass * (accel - x[BIAS]) + drag)
    return force


@kernel
def predict_balance(params: Record, state: Record, braking: bool) -> float:
    """Return what is left of the car's balance over the configured mass [m/s^2]; sets `state.h`."""
    x, h, w, mass = state.x, state.h, state.window, params.mass
    clear_derivatives(state)
    speed, heavier = x[V], math.exp(x[MASS])
    drag = heavier * math.exp(x[DRAG]) * params.drag_area * speed * abs(speed) / mass
    left = heavier * (w.common_accel - x[BIAS] + w.lateral / mass) + drag
    # What grows with the mass, by the accelerometer of before: free of the noise of this window's torques.
    inert = heavier * (state.last_smooth_accel - x[BIAS] + w.lateral / mass) + drag
    linings = 0.0
    for i in range(4):
        r, _ = radius(params, state, i, w.load[i])
        driven = w.motor[i] * math.exp(x[MOTOR])
        own = heavier * (params.rolling_resistance * w.load[i] * r + params.wheel_inertia[i] * w.change / r)
        inert += own / (r * mass)
        left += (brake_torque(params, state, i, w.common_pressure[i]) + driven + own) / (r * mass)
        smooth = state.last_smooth[i]
        linings += brake_torque(params, state, i, smooth) / (r * mass)
        per_bar = brake_lever(params, i) * friction(params, state, i) / (r * mass)
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
    result: float = left
    return result
