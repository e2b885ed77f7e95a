"""Tyre and brake of a wheel, and the force along the car, as functions of the states.

Slip by the adhesion used n (force over load), and its derivatives; stiffness C and peak D over load as well:

    u = n / D         slip = (c D / C) tan(asin(u) / c)     inverse Magic Formula with E = 0
    slip_x = slip(n_xy) n_x / n_xy                          n_xy^2 = n_x^2 + n_y^2, for a cornering tyre
"""

import math

from ecu.algorithm.brake import brake_gain_per_bar
from ecu.algorithm.estimation.friction import drives_against
from ecu.algorithm.estimation.joint.layout import (
    BIAS,
    CHANGE,
    DEFLECTION_GAIN,
    DRAG,
    LEVEL,
    MASS,
    OFFSET,
    PEAK,
    PEAK_LOAD,
    RADIUS,
    ROLLING,
    V,
)
from ecu.algorithm.estimation.joint.prior import SCALE_ONLY, UNKNOWN_PER_ERROR
from ecu.algorithm.vehicle import rolling_radius
from ecu.jit import Record, kernel

SHAPE = 1.65  # c of the Magic Formula along the wheel (Bakker, Nyborg, Pacejka 1987, SAE 870421)
NOMINAL_PEAK = 0.9  # adhesion
PEAK_DEGRESSION = 0.05  # adhesion falls a little with load (Figure A.6)
LEAST_OF_PEAK = 0.2  # of 1 - 4 y: a peak 1.5 times the usual
LINEAR_FROM = 0.93  # of the peak; the curve continues linearly from there
APPLIED = 1.0  # bar above push-out: the brakes act


@kernel
def slip_of_force(used: float, stiffness: float, peak: float) -> tuple[float, float]:
    """Return slip and its derivative by the adhesion used (force over load); `stiffness` over load."""
    u = used / peak
    inside = min(max(u, -LINEAR_FROM), LINEAR_FROM)
    tangent = math.tan(math.asin(inside) / SHAPE)
    slope = (1.0 + tangent * tangent) / (math.sqrt(1.0 - inside * inside) * stiffness)
    return peak * SHAPE * tangent / stiffness + slope * peak * (u - inside), slope


@kernel
def combined_slip(used: float, across: float, stiffness: float, peak: float) -> tuple[float, float, float]:
    """Return slip along the wheel and its derivatives by `used` and ln `peak`, `across` used sideways."""
    if across == 0.0:
        slip, slope = slip_of_force(used, stiffness, peak)
        return slip, slope, slip - slope * used
    both = math.sqrt(used * used + across * across)
    slip, slope = slip_of_force(both, stiffness, peak)
    along = used / both
    by_used = slope * along * along + slip / both * (1.0 - along * along)
    return slip * along, by_used, along * (slip - slope * both)


@kernel
def radius(params: Record, state: Record, i: int, load: float) -> tuple[float, float]:
    """Return the rolling radius [m] of a wheel and its derivative by the logarithm of its deflection gain."""
    at_rest = params.wheel_radius[i]
    nominal = rolling_radius(load, params.unloaded_radius[i], params.vertical_stiffness[i])
    change = (nominal - at_rest) * math.exp(state.x[DEFLECTION_GAIN])
    scale = math.exp(state.x[ROLLING] + state.x[RADIUS + i])
    return (at_rest + change) * scale, change * scale


@kernel
def friction(params: Record, state: Record, i: int) -> float:
    """Return the lining friction of a wheel."""
    return params.mu_nominal[i] * math.exp(state.x[LEVEL + i] + state.x[CHANGE + i // 2])


@kernel
def peak_adhesion(state: Record, relative: float) -> float:
    """Return the tyres' peak adhesion at a load over that at rest.

    D = D_0 (1 - 4 y)^(-1/4): slip near the peak is about linear in y, so a y raised by noise can recover; in
    ln D its derivative would have vanished.
    """
    y = state.x[PEAK]
    at_rest: float = NOMINAL_PEAK * max(1.0 - 4.0 * y, LEAST_OF_PEAK) ** -0.25
    return at_rest * relative ** (state.x[PEAK_LOAD] - PEAK_DEGRESSION)


@kernel
def brake_torque(params: Record, state: Record, i: int, pressure: float) -> float:
    """Return the brake torque [N m] at a pressure above push-out [bar]."""
    if pressure == 0.0:
        return 0.0
    return torque_at(state, i, brake_gain_per_bar(params, i) * friction(params, state, i), pressure)


@kernel
def torque_at(state: Record, i: int, per_bar: float, pressure: float) -> float:
    """Return the same where the torque per pressure, `per_bar` [N m/bar], is known already."""
    return per_bar * (pressure - state.x[OFFSET + i // 2]) if pressure != 0.0 else 0.0


@kernel
def weigh_linings(params: Record, state: Record) -> float:
    """Set `state.h` of each lining's level to its force per bar [N]; return their sum."""
    h, total = state.h, 0.0
    for i in range(LEVEL, LEVEL + 4):
        h[i] = brake_gain_per_bar(params, i - LEVEL) * friction(params, state, i - LEVEL)
        h[i] /= params.wheel_radius[i - LEVEL]
        total += h[i]
    return total


@kernel
def drive_opposes(params: Record, state: Record, share: float) -> bool:
    """Return whether that share of the window's motor torques drives against the brakes."""
    motors, brakes = 0.0, 0.0
    for i in range(4):
        motors += share * state.window.motor[i]
        brakes += brake_torque(params, state, i, state.window.pressure[i])
    return drives_against(motors, brakes)


@kernel
def unknown_share(params: Record, state: Record) -> float:
    """Return the unknown share of the drive, relative to that of a car that reports no motor torque."""
    share: float = min(UNKNOWN_PER_ERROR * max(params.sigma_motor_torque - SCALE_ONLY, 0.0), 1.0)
    return share if state.motors.samples[0] + state.motors.samples[2] > 0 else 1.0


@kernel
def car_force(params: Record, state: Record, accel: float) -> float:
    """Return the force of all tyres along the car [N] at a specific force [m/s^2], by the learned states."""
    x = state.x
    drag = math.exp(x[DRAG]) * params.drag_area * x[V] * abs(x[V])
    return math.exp(x[MASS]) * (params.mass * (accel - x[BIAS]) + drag)
