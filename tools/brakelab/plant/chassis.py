"""Sprung body on its suspension: heave, pitch, roll and four unsprung masses over a road with height.

With the road plane's motion (`body.py`) and four spins (`wheel.py`) these are fourteen degrees of freedom.
States: heave z_s, pitch theta (nose down), roll phi (right side down), unsprung heights z_us, their rates;
heights count up from the design position. Inputs: tyre forces, road heights, grade and bank.

    m_s z_s''        =  sum F_V - m_s g_n                                   A.7a
    I_yy theta''     = -sum F_V (x cos(theta) - h sin(theta)) - h sum F_X   A.7b
    I_xx phi''       =  sum F_V (y cos(phi) + h sin(phi)) + h sum F_Y       A.7c
    m_us z_us''      =  F_Z - F_V - m_us g_n                                A.7d
    F_Z = max(F_Z0 + k_t (z_r - z_us), 0)                                   A.8
    F_V = F_V0 + k_s u + stops + damper(u') + k_st (u - u_other side)       A.9
    u = z_us - (z_s - x sin(theta) + y sin(phi) + h (2 - cos(theta) - cos(phi)))      A.10

Corrected: A.7a and A.7d have the strut's force with opposite signs and both carry gravity, one direction (up)
throughout; A.7b and A.7c have struts on the levers l_f, l_r, b/2 and tyre forces on the lever h; A.9's bar
acts on the difference of the sides; A.10 has pitch on l_f, l_r and roll on b/2. Added: the body swings about
the road, h below its centre of gravity, so a leaning body's weight leans with it (terms in h sin). g_n:
gravity across the road.

Assumptions: links carry no vertical force (no anti-dive; roll axis on the ground), the tyre has no vertical
damping, gyroscopic terms of the body are neglected, the body's centre of gravity lies such that
the whole car's is at l_f, l_r.

Discretisation: positions at half the step, one evaluation of the forces there, rates over the whole step,
positions over the second half: second order, one evaluation a step, no scratch memory.
"""

import math

from brakelab.plant.body import tyre_forces
from brakelab.plant.jit import Record, kernel
from brakelab.plant.records import DAMPER_KNOTS, GRAVITY


@kernel
def sprung_mass(params: Record) -> float:
    """Return the mass of the body [kg] (A.1: m_s = m_v - sum m_us)."""
    unsprung = params.unsprung_mass
    return params.mass - unsprung[0] - unsprung[1] - unsprung[2] - unsprung[3]


@kernel
def sprung_front_length(params: Record) -> float:
    """Return the distance of the body's centre of gravity behind the front axle [m]."""
    unsprung = params.unsprung_mass
    base = params.front_length + params.rear_length
    rear = (unsprung[2] + unsprung[3]) * base
    return (params.mass * params.front_length - rear) / sprung_mass(params)


@kernel
def damper_force(params: Record, wheel: int, speed: float) -> float:
    """Return the damper's force [N] at compression speed [m/s]: linear between knots, last slope outside."""
    knots = params.damper_speed
    k = 1
    while k < DAMPER_KNOTS - 1 and speed > knots[k]:
        k += 1
    low = params.damper_force[wheel, k - 1]
    slope = (params.damper_force[wheel, k] - low) / (knots[k] - knots[k - 1])
    return low + slope * (speed - knots[k - 1])


@kernel
def spring_force(params: Record, wheel: int, travel: float) -> float:
    """Return the force [N] of spring and stops at a compression of `travel` [m] from the design height."""
    beyond = max(travel - params.stop_clearance, 0.0) + min(travel + params.stop_clearance, 0.0)
    force: float = params.spring_preload[wheel] + params.spring_stiffness[wheel] * travel
    force += params.stop_stiffness * beyond
    return force


@kernel
def tyre_load(params: Record, wheel: int, height: float) -> float:
    """Return F_Z [N] of a wheel `height` [m] above its design position over the road (A.8)."""
    load: float = params.nominal_load[wheel] - params.vertical_stiffness[wheel] * height
    return max(load, 0.0)


@kernel
def raise_road(params: Record, state: Record, commands: Record) -> None:
    """Set the heights under the wheels, and the work [J] that a change does on the tyres at once."""
    for wheel in range(4):
        height = commands.road_height[wheel]
        if height != state.road_height[wheel]:
            before = tyre_load(params, wheel, state.unsprung_height[wheel] - state.road_height[wheel])
            after = tyre_load(params, wheel, state.unsprung_height[wheel] - height)
            state.road_work += 0.5 * (after**2 - before**2) / params.vertical_stiffness[wheel]
            state.road_height[wheel] = height


@kernel
def advance_chassis(params: Record, state: Record, commands: Record, dt: float) -> None:
    """Advance body and unsprung masses by `dt` [s] and set the wheel loads at half the step [N]."""
    half = 0.5 * dt
    body_mass = sprung_mass(params)
    front = sprung_front_length(params)
    rear = params.front_length + params.rear_length - front
    side = 0.5 * params.track
    gravity = GRAVITY * math.cos(commands.grade) * math.cos(commands.bank)
    force_x, force_y, _ = tyre_forces(params, state, commands.steering_angle)
    raise_road(params, state, commands)

    state.heave += half * state.heave_rate
    state.pitch += half * state.pitch_rate
    state.roll += half * state.roll_rate
    heave_rate = state.heave_rate + half * state.heave_accel
    pitch_cosine, roll_cosine = math.cos(state.pitch), math.cos(state.roll)
    pitch_rise, roll_rise = math.sin(state.pitch), math.sin(state.roll)
    pitch_speed = state.pitch_rate + half * state.pitch_accel
    roll_speed = state.roll_rate + half * state.roll_accel
    pitch_lean = params.cog_height * pitch_rise
    roll_lean = params.cog_height * roll_rise
    raised = state.heave + params.cog_height * (2.0 - pitch_cosine - roll_cosine)

    lift = 0.0
    damped = 0.0
    rising = 0.0
    pitch_moment = 0.0
    roll_moment = 0.0
    for axle in range(2):
        along = front if axle == 0 else -rear
        mount = raised - along * pitch_rise
        mount_rate = heave_rate - (along * pitch_cosine - pitch_lean) * pitch_speed
        left, right = 2 * axle, 2 * axle + 1
        state.unsprung_height[left] += half * state.unsprung_rate[left]
        state.unsprung_height[right] += half * state.unsprung_rate[right]
        travel_left = state.unsprung_height[left] - mount - side * roll_rise
        travel_right = state.unsprung_height[right] - mount + side * roll_rise
        bar = params.anti_roll_stiffness[axle] * (travel_left - travel_right)
        for wheel in range(left, right + 1):
            sign = 1.0 if wheel == left else -1.0
            travel = travel_left if wheel == left else travel_right
            rate = state.unsprung_rate[wheel] + half * state.unsprung_accel[wheel]
            rate -= mount_rate + (sign * side * roll_cosine + roll_lean) * roll_speed
            damping = damper_force(params, wheel, rate)
            strut = spring_force(params, wheel, travel) + damping + sign * bar
            load = tyre_load(params, wheel, state.unsprung_height[wheel] - state.road_height[wheel])
            old_rate = state.unsprung_rate[wheel]
            state.wheel_load[wheel] = load
            state.unsprung_accel[wheel] = (load - strut) / params.unsprung_mass[wheel] - gravity
            state.unsprung_rate[wheel] += dt * state.unsprung_accel[wheel]
            state.unsprung_height[wheel] += half * state.unsprung_rate[wheel]
            damped += damping * rate
            rising += params.unsprung_mass[wheel] * (old_rate + state.unsprung_rate[wheel])
            lift += strut
            pitch_moment -= (along * pitch_cosine - pitch_lean) * strut
            roll_moment += (sign * side * roll_cosine + roll_lean) * strut
    state.heave_accel = lift / body_mass - gravity
    state.pitch_accel = (pitch_moment - params.cog_height * force_x) / params.pitch_inertia
    state.roll_accel = (roll_moment + params.cog_height * force_y) / params.roll_inertia
    old_heave, old_pitch, old_roll = state.heave_rate, state.pitch_rate, state.roll_rate
    state.heave_rate += dt * state.heave_accel
    state.pitch_rate += dt * state.pitch_accel
    state.roll_rate += dt * state.roll_accel
    state.damper_heat += dt * damped
    state.lifted += gravity * half * (rising + body_mass * (old_heave + state.heave_rate))
    swung_back, swung_left = half * (old_pitch + state.pitch_rate), half * (old_roll + state.roll_rate)
    state.tyre_work += params.cog_height * (force_x * swung_back - force_y * swung_left)
    state.heave += half * state.heave_rate
    state.pitch += half * state.pitch_rate
    state.roll += half * state.roll_rate
    position = params.sensor_position
    state.vertical_accel = (
        state.heave_accel - state.pitch_accel * position[0] + state.roll_accel * position[1]
    )


@kernel
def settle(params: Record, state: Record) -> None:
    """Put the car at rest on its springs on a level road: heights, pitch, wheel loads.

    The weight's lean at that pitch is neglected; stops must not be reached.
    """
    base = params.front_length + params.rear_length
    front = sprung_front_length(params)
    first, second = 0.0, 0.0
    for axle in range(2):
        wheel = 2 * axle
        lever = base - front if axle == 0 else front
        strut = 0.5 * sprung_mass(params) * GRAVITY * lever / base
        load = strut + params.unsprung_mass[wheel] * GRAVITY
        height = (params.nominal_load[wheel] - load) / params.vertical_stiffness[wheel]
        mount = height - (strut - params.spring_preload[wheel]) / params.spring_stiffness[wheel]
        first, second = (mount, second) if axle == 0 else (first, mount)
        for i in range(wheel, wheel + 2):
            state.unsprung_height[i] = height
            state.wheel_load[i] = load
    state.pitch = math.asin((second - first) / base)
    lean = params.cog_height * (1.0 - math.cos(state.pitch))
    state.heave = first + front * math.sin(state.pitch) - lean
