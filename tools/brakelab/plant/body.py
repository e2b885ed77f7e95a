"""The car in the road plane: velocity of its wheels, motion under the tyre forces; the reduced attitude.

Model. Planar: A.1 (corrected: psi' v_y carries the mass), wheel positions A.2 and A.5 (corrected: rear axle
at l_r), road grade and bank, drag at the height of the centre of gravity (assumption). Signs: ISO 8855.

Attitude without a suspension (seven degrees of freedom): the acceleration absorbed by springs and tyres is a
second-order lag of the acceleration; pitch, roll and load transfer are proportional to it, so loads lag
behind the forces. With a suspension `chassis.py` replaces it.
"""

import math

from brakelab.plant.hydraulics import second_order
from brakelab.plant.jit import Record, kernel
from brakelab.plant.records import GRAVITY

SMALLEST_LOAD = 50.0  # N. Least load of a lifted wheel, so that the tyre's equations stay finite


@kernel
def set_wheel_loads(params: Record, state: Record, grade: float, bank: float) -> None:
    """Set the four wheel loads [N] from the absorbed acceleration (sum: m g cos(grade) cos(bank))."""
    base = params.front_length + params.rear_length
    weight = params.mass * GRAVITY * math.cos(grade) * math.cos(bank)
    transfer = params.mass * state.felt_accel[0] * params.cog_height / base
    lateral = params.mass * state.felt_accel[1] * params.cog_height / params.track
    front = weight * params.rear_length / base - transfer
    rear = weight * params.front_length / base + transfer
    front_side = lateral * params.roll_share_front
    rear_side = lateral - front_side
    state.wheel_load[0] = max(0.5 * front - front_side, SMALLEST_LOAD)
    state.wheel_load[1] = max(0.5 * front + front_side, SMALLEST_LOAD)
    state.wheel_load[2] = max(0.5 * rear - rear_side, SMALLEST_LOAD)
    state.wheel_load[3] = max(0.5 * rear + rear_side, SMALLEST_LOAD)


@kernel
def hub_velocity(params: Record, state: Record, wheel: int, steering_angle: float) -> tuple[float, float]:
    """Return longitudinal and lateral speed [m/s] of a wheel over the road in its axes (A.5, corrected).

    A body that pitches or rolls on its suspension swings its wheels about the centre of gravity: the tyre
    forces' lever in A.7b, A.7c and this velocity belong together, or energy would be lost.
    """
    side = 0.5 * params.track if wheel % 2 == 0 else -0.5 * params.track
    along = params.front_length if wheel < 2 else -params.rear_length
    x = state.speed_x - state.yaw_rate * side - params.cog_height * state.pitch_rate
    y = state.speed_y + state.yaw_rate * along + params.cog_height * state.roll_rate
    if wheel >= 2:
        return x, y
    sine, cosine = math.sin(steering_angle), math.cos(steering_angle)
    return x * cosine + y * sine, y * cosine - x * sine


@kernel
def tyre_forces(params: Record, state: Record, steering_angle: float) -> tuple[float, float, float]:
    """Return force forward [N], force to the left [N] and yaw moment [N m] of the four tyres (A.1)."""
    force_x = 0.0
    force_y = 0.0
    moment = 0.0
    for wheel in range(4):
        side = 0.5 * params.track if wheel % 2 == 0 else -0.5 * params.track
        along = params.front_length if wheel < 2 else -params.rear_length
        angle = steering_angle if wheel < 2 else 0.0
        sine, cosine = math.sin(angle), math.cos(angle)
        x = state.force_x[wheel] * cosine - state.force_y[wheel] * sine
        y = state.force_y[wheel] * cosine + state.force_x[wheel] * sine
        force_x += x
        force_y += y
        moment += along * y - side * x
    return force_x, force_y, moment


@kernel
def advance_planar(
    params: Record, state: Record, steering_angle: float, grade: float, bank: float, dt: float
) -> None:
    """Advance speed, yaw rate and position by `dt` [s] under the tyre forces (A.1, corrected).

    The axes turn with the car at its mean yaw rate, trapezoidal: turning alone changes no energy.
    """
    force_x, force_y, moment = tyre_forces(params, state, steering_angle)
    drag = params.drag_factor * state.speed_x * abs(state.speed_x)
    state.accel_x = (force_x - drag) / params.mass
    state.accel_y = force_y / params.mass
    state.yaw_accel = moment / params.yaw_inertia
    state.bank = bank

    uphill = GRAVITY * math.sin(grade)
    sideways = GRAVITY * math.cos(grade) * math.sin(bank)
    old_x, old_y, old_rate = state.speed_x, state.speed_y, state.yaw_rate
    state.yaw_rate += dt * state.yaw_accel
    half_turn = 0.25 * dt * (old_rate + state.yaw_rate)
    x = old_x + half_turn * old_y + dt * (state.accel_x - uphill)
    y = old_y - half_turn * old_x + dt * (state.accel_y - sideways)
    state.speed_x = (x + half_turn * y) / (1.0 + half_turn * half_turn)
    state.speed_y = (y - half_turn * x) / (1.0 + half_turn * half_turn)

    forward, left = 0.5 * dt * (old_x + state.speed_x), 0.5 * dt * (old_y + state.speed_y)
    turned = 0.5 * dt * (old_rate + state.yaw_rate)
    state.distance += forward
    state.heading += turned
    sine, cosine = math.sin(state.heading), math.cos(state.heading)
    state.position_x += forward * cosine - left * sine
    state.position_y += forward * sine + left * cosine
    state.drag_loss += drag * forward
    state.lifted += params.mass * (uphill * forward + sideways * left)
    state.tyre_work -= force_x * forward + force_y * left + moment * turned


@kernel
def advance_attitude(params: Record, state: Record, dt: float) -> None:
    """Let pitch and roll of a car without suspension follow its acceleration for `dt` [s]."""
    old_rate = state.felt_rate[0]
    inertia = 1.0 / params.body_frequency**2
    damping = 2.0 * params.body_damping / params.body_frequency
    state.felt_accel[0], state.felt_rate[0] = second_order(
        state.felt_accel[0], old_rate, state.accel_x, inertia, damping, dt
    )
    state.felt_accel[1], state.felt_rate[1] = second_order(
        state.felt_accel[1], state.felt_rate[1], state.accel_y, inertia, damping, dt
    )
    state.pitch = -params.pitch_gradient * state.felt_accel[0]
    state.pitch_accel = -params.pitch_gradient * (state.felt_rate[0] - old_rate) / dt
    state.roll = params.roll_gradient * state.felt_accel[1]
