"""One wheel between brake, motor and road: spin, slip and tyre force.

Model. I omega' = -T_motor - T_engine - r F_L - (T_b + f_r r F_z) sign(omega) (A.3; slip and F_L negative in
braking), tau F_L' + F_L = F_L(slip) (A.13), slip = (r omega - v_L) / max(r omega, v_L) (A.6).

Discretisation. Both equations are stiff (r^2 C / (I v) is some 300 1/s at 30 m/s, and at standstill the
carcass is a spring against the wheel), so they are solved together by the trapezoidal rule, linearised in
omega. Brake and rolling resistance are Coulomb friction: they can stop the wheel within a step but never
turn it back. Work of a step is torque times mean spin, exactly the change of the spin's energy.
"""

import math

from brakelab.plant.jit import Record, kernel
from brakelab.plant.motor import motor_loss
from brakelab.plant.tyre import (
    TRANSITION_SPEED,
    degressive,
    relaxation_rate,
    rolling_radius,
    steady_forces,
    stiffnesses,
)


@kernel
def advance_wheel(
    params: Record, state: Record, wheel: int, speed_long: float, speed_lat: float, friction: float, dt: float
) -> None:
    """Advance spin [rad/s] and tyre forces [N] of `wheel` by `dt` [s].

    `speed_long`, `speed_lat` [m/s]: of the hub in the wheel's axes; `friction`: of the road.
    """
    load = state.wheel_load[wheel]
    radius = rolling_radius(params.free_radius[wheel], params.vertical_stiffness[wheel], load)
    omega = state.wheel_speed[wheel]
    reference = max(abs(radius * omega), abs(speed_long), TRANSITION_SPEED)
    slip = (radius * omega - speed_long) / reference
    slip_angle = -speed_lat / max(abs(speed_long), TRANSITION_SPEED)
    c_x, c_y = stiffnesses(params, wheel, load)
    peak = degressive(friction, params.friction_degression, load, params.nominal_load[wheel])
    steady_x, steady_y, stiffness = steady_forces(params, c_x, c_y, peak, slip, slip_angle)
    gain_x = 1.0 - math.exp(-dt * relaxation_rate(c_x, params.longitudinal_stiffness, speed_long))
    gain_y = 1.0 - math.exp(-dt * relaxation_rate(c_y, params.lateral_stiffness, speed_long))

    grown = gain_x * (steady_x - state.force_x[wheel])
    grown_per_spin = 0.5 * gain_x * stiffness * radius / reference
    mean_force = state.force_x[wheel] + 0.5 * grown
    inertia = params.wheel_inertia[wheel] + 0.5 * dt * radius * grown_per_spin
    drive = state.motor_torque[wheel] + state.engine_torque[wheel]
    free = omega - dt * (drive + radius * mean_force) / inertia
    braking, rolling = state.brake_torque[wheel], params.rolling_resistance * load * radius
    stopping = dt * (braking + rolling) / inertia
    turning = max(abs(free) - stopping, 0.0)
    new_omega = math.copysign(turning, free)
    new_force = state.force_x[wheel] + grown + grown_per_spin * (new_omega - omega)

    turned = 0.5 * dt * (omega + new_omega)
    held_back = 1.0 if abs(free) >= stopping else abs(free) / stopping
    rubbed = math.copysign(held_back, free) * turned
    state.brake_work[wheel] = braking * rubbed
    state.rolling_loss += rolling * rubbed
    state.engine_loss += state.engine_torque[wheel] * turned
    regenerated = state.motor_torque[wheel] * turned
    if regenerated > 0.0:
        state.regenerated += regenerated
    else:
        state.driven -= regenerated
    if params.motor_share[wheel] > 0.0:
        charged = regenerated - dt * motor_loss(params, state.motor_torque[wheel], turned / dt)
        state.charged += max(charged, 0.0)
        state.discharged -= min(charged, 0.0)
    state.tyre_work += 0.5 * radius * (state.force_x[wheel] + new_force) * turned

    state.rolling_radius[wheel] = radius
    state.wheel_speed[wheel] = new_omega
    state.force_x[wheel] = new_force
    state.force_y[wheel] += gain_y * (steady_y - state.force_y[wheel])
    state.slip[wheel] = (radius * new_omega - speed_long) / max(
        abs(radius * new_omega), abs(speed_long), TRANSITION_SPEED
    )
    state.slip_angle[wheel] = slip_angle
