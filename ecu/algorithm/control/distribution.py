"""Brake force distribution: the torque demand shared between the axles (5.1, Figure 4.2), rear axle limited.

    T_b,dem = m a_dem r                                     (5.1)
    ideal       front share (l_r + z h) / L, z = a_dem / g: both axles use the same share of their grip
    fixed       front share constant
    electronic  front share constant until the ideal one passes it, then the ideal one: the rear is held back

Lining friction is uncertain, so none of the three alone guarantees the order in which the axles lock. Two
functions do (ECE R13-H, Annex 5: the rear uses no more grip than the front):

- `watch_trailing`: where a rear wheel slips more than the front one of its side by more than
  `rear_slip_margin`, and by the car's speed `LEAST_SLIP` more than tyres do at the deceleration measured,
  torque of the rear axle moves to the front one until it no longer does. A front wheel counts as no faster
  than the ground: one whose speed is late or scaled alone takes nothing. One that the slip guard holds is no
  measure: just cut, it slips less than it can. Of one whose axle gives back what it took, what it slipped
  then counts for `FOLLOWS_S`. This needs no friction estimate. A wheel that slips as before `DENIED_S` after
  its axle was relieved does not slip: what it reads less, and slowly less in this braking, is taken for its
  radius; nor does the other one, as long as it reads no less (one frame has both). Beside a front wheel whose
  brake has failed it may slip `LONE_SLIP`. The front takes all of it up to `GRIP` of its load, beyond that
  slowly; none from when it slips more than `GRIP_SLIP`.
- `cap_trailing`: compensation raises the rear's pressure relative to the front's only as far as the estimate
  is certain, with the rear at mu + 2 sigma and the front at mu - 2 sigma.

In reverse the front axle trails and is unloaded: z is negative in the ideal share, and both functions apply
to the front axle.
"""

import math

import numpy as np

from ecu.algorithm.brake import brake_gain
from ecu.algorithm.inputs import fresh
from ecu.algorithm.vehicle import corner_speed, rolling_radius
from ecu.contract.params import DISTRIBUTIONS, GRAVITY
from ecu.contract.signals import WHEEL_SPEED
from ecu.jit import Record, kernel

DISTRIBUTION_STATE = np.dtype(
    [
        ("torque", "f8", (4,)),  # demanded of each wheel [N m], >= 0; NaN without a request
        ("trailing", "f8"),  # share of its torque that the trailing axle keeps, LEAST_TRAILING to 1
        ("grip", "f8"),  # force over load to which the leading axle takes the rest
        ("spent", "u1"),  # a leading wheel has slipped too much: it grows no more in this braking
        ("let_go_s", "f8"),  # time for which what the leading wheels slipped then still counts
        ("slid", "f8", (2,)),  # the least of `rolled` then, fading
        ("rolled", "f8", (2,)),  # by a leading wheel over the distance of the ground below it, low-passed
        ("beyond", "f8", (2,)),  # slip of a trailing wheel less that of the leading one, low-passed
        ("offset", "f8", (2,)),  # the same of a rear wheel while rolling freely: error of the radii
        ("free_s", "f8", (2,)),  # learning time of that, at most LEARNING_TIME
        ("slip", "f8", (2,)),  # of a trailing wheel by the car's speed, low-passed
        ("slipped", "f8", (2,)),  # `beyond` of it before its axle was relieved
        ("held_s", "f8", (2,)),  # time for which it has slipped as much since
    ],
    align=True,
)

IDEAL, FIXED, ELECTRONIC = range(len(DISTRIBUTIONS))
LEAST_TRAILING = 0.3  # share that the trailing axle always keeps
KEPT = 0.95  # of it, below which the axle counts as held back
TAKE_BACK = 600.0  # 1/s per slip: 1 % excess reduces the torque at 6 1/s
GIVE_BACK, GIVE_BACK_DENIED = 0.3, 2.0  # 1/s
RELIEVED, DENIED_S = 0.7, 0.25  # share kept, s: a wheel that slips turns faster then, on ice too
AS_BEFORE, DEEPEST = 0.8, 0.1  # of the slip; slip beyond which a wheel locks
DENIES, GROWS = 10.0, 0.03  # 1/s, of what is beyond; slip beyond that grows as a wheel's that locks
SMOOTHING = 0.2  # per sample: 50 ms; leaves a fifth of the wheel speeds' noise
LEARNING_TIME = 2.0  # s
RADIUS_DOUBT = 0.008  # before learning: radii within 0.3 % and other differences, two standard deviations
FREE_ACCEL, FREE_YAW_RATE = 0.5, 0.03  # m/s^2, rad/s
LEAST_SLIP = 0.012  # of a trailing wheel that may lock, beyond that of its force: tyres peak at 0.03 on ice
RULED_FROM = 0.15  # z above which Annex 5 orders the axles
FASTEST_ROLLING = 1.02  # of the ground below it
GRIP, GRIP_RATE = 0.6, 0.5  # force over load taken over at once, 1/s beyond it
GRIP_SLIP = 0.05  # of a leading wheel, beyond which it gives back what it took, as long as it does
RELEASE_S, FOLLOWS_S = 0.2, 0.3  # s: slip follows the hydraulics, and its low-pass; it has followed
LONE_SLIP = 0.04  # of a trailing wheel beside one that rolls freely: tyres peak at 0.1 on a dry road
ROUNDING = 1e-9


@kernel
def ideal_front_share(params: Record, decel: float) -> float:
    """Return the front axle's share of the brake force at equal adhesion utilisation of the axles, 0 to 1.

    `decel` [m/s^2] is positive driving forwards, negative driving backwards.
    """
    share: float = (params.rear_axle + decel / GRAVITY * params.cog_height) / params.wheelbase
    return min(max(share, 0.0), 1.0)


@kernel
def front_share(params: Record, decel: float) -> float:
    """Return the front axle's share of the brake force; `decel` as for `ideal_front_share`."""
    ideal = ideal_front_share(params, decel)
    if params.distribution == IDEAL:
        return ideal
    share: float = params.front_share
    if params.distribution == ELECTRONIC:
        share = min(share, ideal) if decel < 0.0 else max(share, ideal)
    return share


@kernel
def _rolled(params: Record, inputs: Record, estimate: Record, speed: float, i: int) -> float:
    """Return how far a wheel rolls over the distance of the ground below it: 1 plus its slip.

    NaN without a new sample, or where the wheel turns faster than a braked one can: its sensor is stuck.
    """
    ground = math.copysign(1.0, speed) * corner_speed(params, estimate, speed, i)
    if not (fresh(inputs, WHEEL_SPEED + i) and ground > 0.0):
        return math.nan
    radius = rolling_radius(estimate.load[i], params.unloaded_radius[i], params.vertical_stiffness[i])
    rolled: float = abs(inputs.value[WHEEL_SPEED + i]) * radius / ground
    return rolled if rolled <= FASTEST_ROLLING else math.nan


@kernel
def _excused(state: Record, side: int) -> bool:
    """Return whether a trailing wheel reads no less than the other one, which was found not to slip."""
    other = 1 - side
    excused: bool = state.held_s[other] > DENIED_S and state.slip[side] < state.slip[other] + LEAST_SLIP
    return excused


@kernel
def watch_trailing(
    params: Record,
    state: Record,
    inputs: Record,
    estimate: Record,
    failed: Record,
    guarded: Record,
    decel: float,
    speed: float,
    reckoned: float,
    dt: float,
) -> None:
    """Adjust the torque share of the trailing axle by the slip of its wheels relative to the leading ones.

    Wheel speeds are compared with each other, at the radii of their loads (A.4): an observer would reject a
    trailing wheel about to lock as an outlier. The remaining difference of the radii is learned while the car
    rolls freely.

    Args:
        params: `PARAMS`.
        state: `DISTRIBUTION_STATE`; all but `torque` is overwritten.
        inputs: `INPUTS`.
        estimate: `ESTIMATE`.
        failed: wheels whose brake has failed, shape (4,).
        guarded: wheels held by the slip guard, shape (4,): a leading one is no measure.
        decel: demanded [m/s^2]; the axle regains its full torque once no brake is demanded.
        speed: of the vehicle [m/s], NaN: unknown. Below `min_speed` slip is not evaluated.
        reckoned: the same by dead reckoning [m/s], 0: unknown; the greater of the two shows a slip.
        dt: time since the last cycle [s].
    """
    brakes = decel > 0.0
    free = not brakes and abs(estimate.accel_x) < FREE_ACCEL and abs(estimate.yaw_rate) < FREE_YAW_RATE
    worst, trailing, denied = 0.0, 1.0 if speed > 0.0 else -1.0, False
    used = min(max(-trailing * estimate.accel_x, 0.0), max(decel, 0.0)) / GRAVITY
    for side in range(2):
        front = rear = math.nan
        if abs(speed) > params.min_speed:
            front = _rolled(params, inputs, estimate, speed, side)
            rear = _rolled(params, inputs, estimate, speed, side + 2)
        if brakes and trailing > 0.0:
            front = min(front, 1.0)
        elif brakes:
            rear = min(rear, 1.0)
        beyond = front - rear
        if math.isnan(beyond):
            state.beyond[side] = 0.0
            continue
        rolled = (rear if trailing > 0.0 else front) * (abs(speed) / max(reckoned, abs(speed)))
        state.slip[side] += SMOOTHING * (1.0 - rolled - state.slip[side])
        leads = front if trailing > 0.0 else rear
        state.rolled[side] += SMOOTHING * (leads - state.rolled[side])
        if state.let_go_s > 0.0:
            beyond -= trailing * max(leads - state.slid[side], 0.0)
        if free:
            state.free_s[side] = min(state.free_s[side] + dt, LEARNING_TIME)
            state.offset[side] += dt / state.free_s[side] * (beyond - state.offset[side])
        state.beyond[side] += SMOOTHING * (trailing * (beyond - state.offset[side]) - state.beyond[side])
        doubt = params.sigma_wheel_speed * params.wheel_radius[side] / abs(speed)
        if state.free_s[side] < LEARNING_TIME:
            doubt += RADIUS_DOUBT
        leading = side if trailing > 0.0 else side + 2
        margin = LONE_SLIP if failed[leading] else params.rear_slip_margin
        excess = state.beyond[side] - margin - doubt
        slips = state.slip[side] > LEAST_SLIP + used / params.slip_stiffness[leading] and excess > 0.0
        if state.trailing > RELIEVED:
            state.slipped[side] = state.beyond[side]
        as_before = state.beyond[side] > AS_BEFORE * state.slipped[side] or state.held_s[side] > DENIED_S
        as_before = as_before and state.beyond[side] < DEEPEST and not failed[leading]
        if brakes and slips and as_before and state.trailing < RELIEVED:
            state.held_s[side] += dt
        elif not brakes or (slips and not (state.held_s[side] > DENIED_S and excess < GROWS)):
            state.held_s[side] = 0.0
        if state.held_s[side] > DENIED_S:
            state.offset[side] += trailing * DENIES * dt * max(excess, 0.0)
            denied = True
        elif slips and not (guarded[leading] or _excused(state, side)):
            worst = max(worst, excess)
    change = -TAKE_BACK * worst
    if worst == 0.0:
        change = GIVE_BACK_DENIED if denied else GIVE_BACK
    state.trailing = min(max(state.trailing + change * dt, LEAST_TRAILING), 1.0) if brakes else 1.0


@kernel
def distribute(params: Record, state: Record, mass: float, decel: float, backwards: bool, dt: float) -> None:
    """Overwrite the torque demanded of each wheel [N m]; NaN for an unknown deceleration [m/s^2].

    `mass` [kg] is the current estimate; `backwards`: the car is in reverse.
    """
    signed = -decel if backwards else decel
    front = front_share(params, signed)
    lead = 1.0 - front if backwards else front
    trail = (1.0 - lead) * state.trailing
    slips = min(state.rolled[0], state.rolled[1]) < 1.0 - GRIP_SLIP
    state.let_go_s = max(state.let_go_s - dt, 0.0)
    if not decel > 0.0:
        state.grip, state.spent = GRIP, 0
    elif not (slips or state.spent) and state.trailing < 1.0:
        state.grip += GRIP_RATE * dt
    if decel > 0.0:
        load = ideal_front_share(params, signed)
        per_grip = max(1.0 - load if backwards else load, ROUNDING) * GRAVITY / decel
        lead = max(lead, min(1.0 - trail, state.grip * per_grip))
        if slips:
            state.grip, state.spent = min(state.grip, lead / per_grip) * (1.0 - dt / RELEASE_S), 1
            for side in range(2):
                back = (state.rolled[side] - state.slid[side]) * dt / FOLLOWS_S
                slid = state.slid[side] + back if state.let_go_s > 0.0 else 1.0
                state.slid[side] = min(state.rolled[side], slid)
            state.let_go_s = FOLLOWS_S
    for i in range(4):
        axle = trail if (i < 2) == backwards else lead
        state.torque[i] = 0.5 * axle * mass * decel * params.wheel_radius[i]


@kernel
def cap_trailing(
    params: Record,
    state: Record,
    decel: float,
    lining: Record,
    estimate: Record,
    pressure: Record,
    failed: Record,
    backwards: bool,
) -> None:
    """Limit compensation such that the trailing axle's share stays within the line of Annex 5.

    The ratio of the trailing to the leading axle's pressure may exceed that of nominal friction only up to
    where the trailing axle with mu + 2 sigma still uses no more grip than the leading one with mu - 2 sigma.

    Args:
        params: `PARAMS`.
        state: `DISTRIBUTION_STATE`.
        decel: demanded [m/s^2].
        lining: torque [N m] demanded of each wheel's lining; the motors supply the rest.
        estimate: `ESTIMATE`, for friction and its standard deviation.
        pressure: compensated demands [Pa], shape (4,); those of the trailing axle are overwritten.
        failed: wheels whose brake has failed, shape (4,); the rule then applies to the wheels that brake.
        backwards: the car is in reverse.
    """
    if not decel >= RULED_FROM * GRAVITY:
        return
    # Sums over an axle: pressure that acts, the same at nominal friction, force of the linings at the end of
    # their interval, force of the motors.
    lead, lead_nominal, lead_force, lead_motors = 0.0, 0.0, 0.0, 0.0
    trail, trail_nominal, trail_force, trail_motors = 0.0, 0.0, 0.0, 0.0
    leading, trailing = 0, 0
    for i in range(4):
        if failed[i]:
            continue
        lever = brake_gain(params, i)
        acts = max(pressure[i] - params.push_out_pressure[i], 0.0)
        nominal = max(lining[i], 0.0) / (lever * params.mu_nominal[i])
        mu, sigma = estimate.mu[i], estimate.sigma[i]
        motor = (state.torque[i] - lining[i]) / params.wheel_radius[i]
        if (i < 2) != backwards:
            leading += 1
            lead += acts
            lead_nominal += nominal
            lead_force += acts * lever * max(mu - 2.0 * sigma, 0.0) / params.wheel_radius[i]
            lead_motors += motor
        else:
            trailing += 1
            trail += acts
            trail_nominal += nominal
            trail_force += acts * lever * (mu + 2.0 * sigma) / params.wheel_radius[i]
            trail_motors += motor
    if not (trail_force > 0.0 and leading > 0):
        return
    share = ideal_front_share(params, -decel if backwards else decel)
    share = 1.0 - share if backwards else share
    line = (lead_force + lead_motors) * (1.0 - share) / share * trailing / leading
    allowed = (line - trail_motors) / trail_force
    as_nominal = trail_nominal / trail * (lead / lead_nominal if lead_nominal > 0.0 else 1.0)
    factor = max(allowed, as_nominal)
    if factor < 1.0 - ROUNDING:
        first = 0 if backwards else 2
        for i in range(first, first + 2):
            push_out = min(params.push_out_pressure[i], pressure[i])
            pressure[i] = push_out + (pressure[i] - push_out) * factor
