"""Torque per wheel: the demand shared between the axles (5.1, Figure 4.2), the rear kept behind the front.

    T_b,dem = m a_dem r                                     (5.1)
    ideal       front share (l_r + z h) / L, z = a_dem / g: both axles use the same share of their grip
    fixed       front share constant
    electronic  front share constant until the ideal one passes it, then the ideal one: the rear is held back

Friction of the linings is known to its sigma only, so none of the three keeps the order of the axles by
itself. Two things do (ECE R13-H, Annex 5: the rear uses no more grip than the front):

- `watch_rear`: where a rear wheel slips more than the front one of its side by more than
  `rear_slip_margin`, the torque of the rear axle is taken back until it does not. That needs no friction.
- `cap_rear`: compensation raises the rear's pressure relative to the front's only as far as the observer
  is sure of it, with the rear at mu + 2 sigma and the front at mu - 2 sigma.
"""

import math

import numpy as np

from ecu.estimation.motion import corner_speed, fresh
from ecu.estimation.tyre import rolling_radius
from ecu.jit import Record, kernel
from ecu.params import DISTRIBUTIONS, GRAVITY
from ecu.signals import WHEEL_SPEED

DISTRIBUTION_STATE = np.dtype(
    [
        ("torque", "f8", (4,)),  # demanded of each wheel [N m], >= 0; NaN without a request
        ("rear", "f8"),  # what of its torque the rear axle is left, LEAST_REAR to 1
        ("beyond", "f8", (2,)),  # slip of a rear wheel beyond the front one of its side, low-passed
        ("offset", "f8", (2,)),  # the same while rolling freely: the radii
        ("free_s", "f8", (2,)),  # how long that was learned, at most LEARNING_TIME
    ],
    align=True,
)

IDEAL, FIXED, ELECTRONIC = range(len(DISTRIBUTIONS))
LEAST_REAR = 0.3  # what the rear keeps whatever its wheels seem to do
TAKE_BACK = 600.0  # 1/s per slip: 1 % too much takes back the rear's torque at 6 1/s
GIVE_BACK = 0.3  # 1/s
SMOOTHING = 0.2  # per sample: 50 ms; leaves a fifth of the wheel speeds' noise
LEARNING_TIME = 2.0  # s
RADIUS_DOUBT = 0.008  # until then: radii within 0.3 % and what else differs, two standard deviations
FREE_ACCEL, FREE_YAW_RATE = 0.5, 0.03  # m/s^2, rad/s
RULED_FROM = 0.15  # z from which on Annex 5 orders the axles
FASTEST = 1.02  # of the ground below it
ROUNDING = 1e-9


@kernel
def ideal_front_share(params: Record, decel: float) -> float:
    """Return the front axle's share of the brake force with equal adhesion of the axles, at most 1."""
    share: float = (params.rear_axle + decel / GRAVITY * params.cog_height) / params.wheelbase
    return min(share, 1.0)


@kernel
def front_share(params: Record, decel: float) -> float:
    """Return the front axle's share of the brake force at a demanded deceleration [m/s^2]."""
    ideal = ideal_front_share(params, decel)
    if params.distribution == IDEAL:
        return ideal
    share: float = params.front_share
    return max(share, ideal) if params.distribution == ELECTRONIC else share


@kernel
def _rear_beyond_front(
    params: Record, inputs: Record, motion: Record, load: Record, speed: float, side: int
) -> float:
    """Return how much more than the front wheel of its side a rear wheel slips.

    NaN without new samples, or where a wheel turns faster than a braked one can: its sensor keeps a value.
    """
    slips = 0.0
    for i in (side, side + 2):
        ground = corner_speed(params, motion, speed, i)
        if not (fresh(inputs, WHEEL_SPEED + i) and ground > 0.0):
            return math.nan
        radius = rolling_radius(load[i], params.unloaded_radius[i], params.vertical_stiffness[i])
        rolled = inputs.value[WHEEL_SPEED + i] * radius / ground
        if rolled > FASTEST:
            return math.nan
        slips += rolled if i == side else -rolled
    return slips


@kernel
def watch_rear(
    params: Record,
    state: Record,
    inputs: Record,
    motion: Record,
    load: Record,
    decel: float,
    speed: float,
    dt: float,
) -> None:
    """Move what the rear axle is left, by the slip of its wheels beyond that of the front ones.

    Wheel speeds are compared with each other, at the radii of their loads (A.4): a rear wheel on its way to
    lock is what observers reject as an outlier. What the radii differ beside that is learned while the car
    rolls freely.

    Args:
        params: `PARAMS`.
        state: `DISTRIBUTION_STATE`; all but `torque` is overwritten.
        inputs: `INPUTS`.
        motion: `MOTION_STATE`.
        load: of the wheels [N].
        decel: demanded [m/s^2]; the rear has all of its torque again once nobody brakes.
        speed: of the vehicle [m/s], NaN: unknown. Below `min_speed` slip says nothing.
        dt: time since the last cycle [s].
    """
    brakes = decel > 0.0
    free = not brakes and abs(motion.accel_x) < FREE_ACCEL and abs(motion.yaw_rate) < FREE_YAW_RATE
    worst = 0.0
    for side in range(2):
        beyond = math.nan
        if speed > params.min_speed:
            beyond = _rear_beyond_front(params, inputs, motion, load, speed, side)
        if math.isnan(beyond):
            state.beyond[side] = 0.0
            continue
        if free:
            state.free_s[side] = min(state.free_s[side] + dt, LEARNING_TIME)
            state.offset[side] += dt / state.free_s[side] * (beyond - state.offset[side])
        state.beyond[side] += SMOOTHING * (beyond - state.offset[side] - state.beyond[side])
        doubt = params.sigma_wheel_speed * params.wheel_radius[side] / speed
        if state.free_s[side] < LEARNING_TIME:
            doubt += RADIUS_DOUBT
        worst = max(worst, state.beyond[side] - params.rear_slip_margin - doubt)
    change = -TAKE_BACK * worst if worst > 0.0 else GIVE_BACK
    state.rear = min(max(state.rear + change * dt, LEAST_REAR), 1.0) if brakes else 1.0


@kernel
def distribute(params: Record, state: Record, mass: float, decel: float) -> None:
    """Overwrite the torque demanded of each wheel [N m]; NaN for an unknown deceleration [m/s^2].

    `mass` [kg] is that of the car as it is known now.
    """
    front = front_share(params, decel)
    for i in range(4):
        axle = front if i < 2 else (1.0 - front) * state.rear
        state.torque[i] = 0.5 * axle * mass * decel * params.wheel_radius[i]


@kernel
def cap_rear(
    params: Record, state: Record, decel: float, lining: Record, friction: Record, pressure: Record
) -> None:
    """Keep compensation from raising the rear's share beyond the line of Annex 5.

    The ratio of the rear's to the front's pressure may exceed that of nominal friction only up to where the
    rear axle with mu + 2 sigma still uses no more grip than the front axle with mu - 2 sigma.

    Args:
        params: `PARAMS`.
        state: `DISTRIBUTION_STATE`.
        decel: demanded [m/s^2].
        lining: torque [N m] that the lining of each wheel is asked for; the motors have the rest.
        friction: `FRICTION_STATE`, what the observer claims.
        pressure: compensated demands [Pa], shape (4,); the rear ones are overwritten.
    """
    if not decel >= RULED_FROM * GRAVITY:
        return
    # Sums over an axle: pressure that acts, the same at nominal friction, force of the linings at the end of
    # their interval, force of the motors.
    front, front_nominal, front_force, front_motors = 0.0, 0.0, 0.0, 0.0
    rear, rear_nominal, rear_force, rear_motors = 0.0, 0.0, 0.0, 0.0
    for i in range(4):
        lever = 2.0 * params.piston_area[i] * params.effective_radius[i]
        acts = max(pressure[i] - params.push_out_pressure[i], 0.0)
        nominal = max(lining[i], 0.0) / (lever * params.mu_nominal[i])
        mu, sigma = friction.mu[i], friction.sigma[i]
        motor = (state.torque[i] - lining[i]) / params.wheel_radius[i]
        if i < 2:
            front += acts
            front_nominal += nominal
            front_force += acts * lever * max(mu - 2.0 * sigma, 0.0) / params.wheel_radius[i]
            front_motors += motor
        else:
            rear += acts
            rear_nominal += nominal
            rear_force += acts * lever * (mu + 2.0 * sigma) / params.wheel_radius[i]
            rear_motors += motor
    if not (rear > 0.0 and rear_force > 0.0):
        return
    share = ideal_front_share(params, decel)
    line = (front_force + front_motors) * (1.0 - share) / share
    allowed = (line - rear_motors) / rear_force
    as_nominal = rear_nominal / rear * (front / front_nominal if front_nominal > 0.0 else 1.0)
    factor = max(allowed, as_nominal)
    if factor < 1.0 - ROUNDING:
        for i in (2, 3):
            push_out = min(params.push_out_pressure[i], pressure[i])
            pressure[i] = push_out + (pressure[i] - push_out) * factor
