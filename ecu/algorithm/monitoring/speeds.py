"""Plausibility of wheel speeds and vehicle speed against each other and the accelerometer.

Each wheel gives the car's speed at its radius, turning removed. With the vehicle speed they form a median
that two inputs of one frame cannot move; where they are even in number, with dead reckoning too, whose zero
and slope are followed slowly: wheels that were driven have drawn it along. A wheel is judged by its
low-passed difference from the median, less what its radius has been found to differ by while rolling:

    slower than it    while nothing brakes that wheel: it rolls or is driven
    faster than it    while nothing drives it

and where it is off by more than `SLID`, `SPIN_UP_S` later, so a wheel that slides or spins is never judged.
Wheels that roll freely turn alike to within `ALIKE`; the vehicle speed tells which do not. Where the
accelerometer confirms it and not the wheels together (`carried.py`), which slip does not explain, or no wheel
is believed, it stands for the median; while it is confirmed it is not judged. No wheel that is braked is
faster than it, none that is driven slower: then they are judged as if they rolled.

The vehicle speed is judged where it is slower than the wheels and nothing drives them, and where it is faster
while they roll freely, or while dead reckoning agrees with them. A constant error of less than
`FARTHEST_BASE` is another radius.

A wheel speed that is late by the braking of the car (`lateness.py`) is judged by that alone; such a vehicle
speed counts as older.

Braked wheels that slip together leave the car. Dead reckoning does not follow a median that is more than
`LEAVES` below it, but the vehicle speed where the two agree, and stands for the median. For `SPIN_UP_S` more
no wheel is judged as one that rolls freely, or as too slow. Driven wheels that spin together leave the car
likewise, above it by more than `SPINS` of its speed and `SPINS_BY`.
"""

import math

import numpy as np

from ecu.algorithm.inputs import OVERSLEPT_S, driver_accelerates, motor_torque, usable
from ecu.algorithm.monitoring.carried import (
    CARRIED_STATE,
    WHEELS,
    carry_speeds,
    over_ground_confirmed,
    wheels_confirmed,
)
from ecu.algorithm.monitoring.lateness import (
    KNOWN,
    LATENESS_STATE,
    NEAR_LIMIT,
    begin_lateness,
    doubted_lag,
    follow_lag,
    judge_lag,
    reference_lag,
)
from ecu.algorithm.monitoring.witness import judge
from ecu.algorithm.vehicle import corner_speed, tyre_slip
from ecu.contract.signals import VEHICLE_SPEED, VEHICLE_SPEED_VALID, WHEEL_SPEED
from ecu.jit import Record, kernel

SPEED, RECKONED = 4, 5
WITNESSES = 6
SPEEDS_STATE = np.dtype(
    [
        ("implied", "f8", (WITNESSES,)),  # car's speed by wheels, vehicle speed, reckoning [m/s]; NaN: silent
        ("sorted", "f8", (WITNESSES,)),
        ("apart", "f8", (5,)),  # excess of an input over the median or reckoning, relative, low-passed
        ("base", "f8", (5,)),  # the same while rolling: error of the radius
        ("torque", "f8", (4,)),  # of the linings, low-passed [N m]
        ("spins_s", "f8", (4, 2)),  # time for which a wheel that was braked, or driven, may still slide
        ("left_s", "f8"),  # the same of all that slid together
        ("rolled_s", "f8"),  # learning time of that, at most `BASE_S`
        ("reckoned", "f8"),  # m/s
        ("slope", "f8"),  # of the road and the accelerometer's zero [m/s^2]
        ("started", "u1"),
        ("lateness", LATENESS_STATE),
        ("carried", CARRIED_STATE),
    ],
    align=True,
)

LEAST_SPEED = 5.0  # m/s
SMOOTHING_S = 0.1
TOLERANCE, UNFOUND = 0.035, 0.03  # of the speed, added before the radii are found
ROLLING, ROLLING_ACROSS = 0.012, 0.002  # of the speed while rolling freely, by lateral acceleration [s^2/m]
ABSOLUTE, LAG_S = 0.15, 0.3  # m/s; of a vehicle speed, while the car slows
ALIKE, ALIKE_ACROSS, ALIKE_BY, ALIKE_S = 0.003, 0.005, 0.06, 1.0  # as these, of wheels beside wheels; s
SLIPPING = 0.06  # added for a vehicle speed above wheels that are braked
DOUBT_S = 0.3
SPIN_UP_S = 0.5  # of a wheel that slid on ice: lag of the hydraulics, and 15 m/s^2 at an adhesion of 0.05
SLID = 0.08  # beyond the slip at which a tyre on a dry road gives most
BASE_S, FOUND_S = 20.0, 0.5
FARTHEST_BASE = 0.03
FREE_ACCEL, DRIVEN_ACCEL = 1.0, 0.5  # m/s^2
DRAGGED_ACCEL = -0.7  # m/s^2, an engine that holds wheels on ice
TORQUE = 60.0  # N m, above which a wheel is braked or driven
RECKON, SLOPE_RECKON = 0.8, 0.16  # 1/s, 1/s^2: critically damped at 0.4 rad/s
RECKON_REACH = 0.04  # of the speed, greatest innovation
AWAY = 0.02  # of the speed, dead reckoning above wheels beyond which they do not tell a lag
BY_ONE_AXLE = 2.0  # times the slip of a car that all wheels drive
LEAVES = 0.5 * SLID  # of the speed: reckoning and wheels that slip by `SLID` have this median
SPINS, SPINS_BY = 0.15, 2.0  # of the speed, m/s: more than a grade that begins moves the reckoning by


@kernel
def _place(i: int) -> int:
    return WHEEL_SPEED + i if i < SPEED else VEHICLE_SPEED


@kernel
def _gather(params: Record, state: Record, inputs: Record, estimate: Record) -> None:
    """Overwrite the car's speed by each input, `implied`."""
    for i in range(4):
        turning = corner_speed(params, estimate, estimate.speed, i) - estimate.speed
        rolled = abs(inputs.value[WHEEL_SPEED + i]) * params.wheel_radius[i]
        state.implied[i] = (rolled - turning) * (1.0 - state.base[i])
    delay = params.vehicle_speed_delay + 1e-9 * inputs.age_ns[VEHICLE_SPEED] + reference_lag(state.lateness)
    over_ground = inputs.value[VEHICLE_SPEED] + delay * estimate.accel_x
    state.implied[SPEED] = over_ground * (1.0 - state.base[SPEED])
    invalid = params.mapped[VEHICLE_SPEED_VALID] != 0 and inputs.value[VEHICLE_SPEED_VALID] < 0.5
    for i in range(5):
        if not usable(inputs, _place(i)) or (i == SPEED and invalid):
            state.implied[i] = math.nan
    state.implied[RECKONED] = state.reckoned if state.started else math.nan


@kernel
def _median(state: Record, witness: Record) -> float:
    """Return the median of the witnesses that speak and are not rejected; NaN: fewer than three do."""
    count = 0
    for i in range(WITNESSES):
        value, k = state.implied[i], count
        if math.isfinite(value) and (count % 2 == 0 if i == RECKONED else not witness.rejected[_place(i)]):
            while k > 0 and state.sorted[k - 1] > value:
                state.sorted[k] = state.sorted[k - 1]
                k -= 1
            state.sorted[k] = value
            count += 1
    middle: float = 0.5 * (state.sorted[(count - 1) // 2] + state.sorted[count // 2])
    return middle if count > 2 else math.nan


@kernel
def _may_slip(state: Record, median: float, braked: bool, drives: bool) -> bool:
    """Return whether the wheels may have left the car by slip: behind it if braked, ahead of it if driven."""
    for i in range(4):
        braked = braked or state.spins_s[i, 0] > 0.0
        drives = drives or state.spins_s[i, 1] > 0.0
    behind, ahead = state.carried.behind[WHEELS], median - state.implied[SPEED]
    slip: bool = (braked and max(behind, ahead) < 0.0) or (drives and min(behind, ahead) > 0.0)
    return slip


@kernel
def _over_ground_tells(state: Record, witness: Record, median: float, braked: bool, drives: bool) -> bool:
    """Return whether the vehicle speed stands for the wheels: it is confirmed, or no wheel is believed."""
    if not math.isfinite(state.implied[SPEED]) or witness.rejected[VEHICLE_SPEED]:
        return False
    confirmed = over_ground_confirmed(state.carried) and not _may_slip(state, median, braked, drives)
    return confirmed or _believed(state, witness) == 1 << SPEED


@kernel
def _wheels_left(state: Record, median: float) -> bool:
    """Return whether braked wheels' median is below the car's speed, and no vehicle speed agrees with it."""
    below = median < (1.0 - LEAVES) * state.reckoned
    left: bool = state.started != 0 and below and not state.implied[SPEED] < 0.5 * (median + state.reckoned)
    return left


@kernel
def _wheels_spin(state: Record, median: float, speed: float) -> bool:
    """Return whether driven wheels' median is above the car's `speed`, and no vehicle speed agrees."""
    above = median > (1.0 + SPINS) * speed + SPINS_BY
    spin: bool = above and not state.implied[SPEED] > 0.5 * (median + speed)
    return spin


@kernel
def _reckon(state: Record, witness: Record, estimate: Record, median: float, left: bool, dt: float) -> None:
    """Advance dead reckoning; without an accelerometer it is the median. `left`: see `_wheels_left`."""
    if not (state.started and estimate.measured):
        state.reckoned, state.slope, state.started = median, 0.0, 1
        return
    reach = RECKON_REACH * max(median, LEAST_SPEED)
    innovation = min(max(median - state.reckoned, -reach), reach)
    if left:
        innovation = state.implied[SPEED] - state.reckoned
        if not (abs(innovation) < LEAVES * state.reckoned) or witness.rejected[VEHICLE_SPEED]:
            innovation = 0.0
    state.slope -= SLOPE_RECKON * dt * innovation
    state.reckoned += (estimate.accel_x - state.slope + RECKON * innovation) * dt


@kernel
def _judged(
    state: Record, i: int, ground: float, free: bool, braked: bool, driven: bool, drives: bool, slip: float
) -> float:
    """Return by how much input `i` contradicts the others, over the speed; NaN: nothing is said of it.

    Where wheels slip together the median, `ground`, slips with them: dead reckoning and vehicle speed count.
    Without a vehicle speed an axle that is slower while the car is driven (`drives`) may be one that is not;
    with one that is not confirmed, as far as those that drive it `slip`.
    """
    apart: float = state.apart[i] - state.base[i]
    if free:
        return apart
    if i < SPEED:
        reckoned, speed = state.reckoned / ground, state.implied[SPEED] / ground
        alike = state.apart[i ^ 1] - state.base[i ^ 1] < 0.5 * apart
        rolls = drives and alike and math.isnan(speed)
        speed = 1.0 if math.isnan(speed) else speed
        faster = apart + 1.0 - max(reckoned, speed, 1.0)
        slower = apart + 1.0 - min(reckoned, speed, 1.0) + (slip if alike else 0.0)
        if faster > 0.0 and not driven:
            return faster
        return slower if slower < 0.0 and not braked and not rolls else math.nan
    if apart < 0.0:
        return math.nan if driven else apart
    away = abs(state.implied[SPEED] - state.reckoned)
    judged = away > 2.0 * abs(ground - state.reckoned) + SLIPPING * ground
    return max(apart - SLIPPING, 0.0) if judged else math.nan


@kernel
def _slides(state: Record, i: int, apart: float, braked: bool, driven: bool, dt: float) -> bool:
    """Return whether wheel `i`, off by `apart`, may still slide or spin from what braked or drove it."""
    left_s = state.spins_s[i]
    left_s[0] = SPIN_UP_S if braked else max(left_s[0] - dt, 0.0)
    left_s[1] = SPIN_UP_S if driven else max(left_s[1] - dt, 0.0)
    slides: bool = (left_s[0] > 0.0 and apart < -SLID) or (left_s[1] > 0.0 and apart > SLID)
    return slides


@kernel
def _believed(state: Record, witness: Record) -> int:
    """Return the mask of the inputs that speak and are not rejected."""
    mask = 0
    for i in range(5):
        if math.isfinite(state.implied[i]) and not witness.rejected[_place(i)]:
            mask |= 1 << i
    return mask


@kernel
def _above(state: Record, witness: Record, i: int, fastest: float, slip: float) -> float:
    """Return what a wheel reads above vehicle speed and `fastest`, or the former above the wheels [m/s].

    `slip` [m/s] of the wheels is allowed for.
    """
    implied = state.implied[i]
    if i < SPEED:
        speed, known = state.implied[SPEED], doubted_lag(state.lateness) < KNOWN
        if known and math.isfinite(speed) and not witness.rejected[VEHICLE_SPEED]:
            fastest = max(fastest, speed)
        return implied + slip - fastest
    for j in range(4):
        if math.isfinite(state.implied[j]) and not witness.rejected[_place(j)]:
            fastest = max(fastest, state.implied[j] + slip)
    return implied - fastest


@kernel
def watch_speeds(
    params: Record, state: Record, witness: Record, inputs: Record, estimate: Record, guarded: bool, dt: float
) -> None:
    """Judge wheel speeds and vehicle speed.

    Args:
        params: `PARAMS`.
        state: `SPEEDS_STATE`, overwritten.
        witness: `WITNESS_STATE`; the five inputs' fields are overwritten.
        inputs: `INPUTS` as received.
        estimate: `ESTIMATE` of the last cycle; backwards, or slower than `LEAST_SPEED`, nothing is judged.
        guarded: the slip guard acts.
        dt: time since the last cycle [s].
    """
    if dt > OVERSLEPT_S:
        state.started = 0
    _gather(params, state, inputs, estimate)
    median, accel = _median(state, witness), estimate.accel_x
    braked = accel < DRAGGED_ACCEL
    drives = accelerates = driver_accelerates(inputs) or accel > DRIVEN_ACCEL
    for i in range(4):
        state.torque[i] += (estimate.brake_torque[i] - state.torque[i]) * min(dt / SMOOTHING_S, 1.0)
        braked = braked or state.torque[i] > TORQUE
        drives = drives or motor_torque(inputs, i) < -TORQUE
    seen = estimate.measured != 0 and not estimate.backwards and dt < OVERSLEPT_S
    carry_speeds(params, state.carried, state.implied, accel, seen, drives, dt)
    tells = _over_ground_tells(state, witness, median, braked, drives)
    median = state.implied[SPEED] if tells else median
    known = state.reckoned if state.started else estimate.speed
    spin = drives and not braked and _wheels_spin(state, median, known)
    left = (braked and _wheels_left(state, median)) or (spin and state.started != 0)
    ground = state.reckoned if left else median
    begins = not state.started and not spin and estimate.speed > LEAST_SPEED
    if estimate.backwards or not ground > LEAST_SPEED or not (state.started or begins):
        state.started = 0
        for i in range(5):
            state.apart[i] = state.base[i]
        if seen and wheels_confirmed(state.carried):
            judge(witness, VEHICLE_SPEED, state.implied[SPEED] - median, SPINS_BY, DOUBT_S, dt)
        return
    _reckon(state, witness, estimate, median, left, dt)
    if begins and drives:
        state.reckoned = estimate.speed
    free = not accelerates and accel > DRAGGED_ACCEL
    state.left_s = SPIN_UP_S if left else max(state.left_s - dt, 0.0)
    free = free and state.left_s == 0.0
    for i in range(4):
        free = free and abs(state.torque[i] + motor_torque(inputs, i)) < TORQUE
    state.rolled_s = min(state.rolled_s + dt, BASE_S) if free else state.rolled_s
    found = state.rolled_s >= FOUND_S
    tolerance = TOLERANCE + ABSOLUTE / ground + (0.0 if found else UNFOUND)
    rolling = ROLLING + ROLLING_ACROSS * abs(estimate.accel_y) + ABSOLUTE / ground
    if free and found:
        tolerance = rolling + LAG_S * abs(accel) / ground
        if state.rolled_s > ALIKE_S and not tells and _believed(state, witness) >= 1 << SPEED:
            rolling = ALIKE + ALIKE_ACROSS * abs(estimate.accel_y) + ALIKE_BY / ground
    lateness, slip = state.lateness, tyre_slip(params, accel) * ground
    delay = reference_lag(lateness)
    reckoned = 0.0 if state.implied[SPEED] < 0.5 * (ground + state.reckoned) else state.reckoned
    slides = guarded or state.left_s > 0.0 or reckoned > (1.0 + AWAY) * ground + slip
    slides = slides or -accel > NEAR_LIMIT * estimate.grip_limit
    shows = begin_lateness(lateness, _believed(state, witness), accel, estimate.accel_y, slides, dt)
    for i in range(5):
        if math.isnan(state.implied[i]):
            continue
        if shows:
            above = _above(state, witness, i, max(ground + slip, reckoned), slip)
            above -= accel * delay if i == SPEED else 0.0
            follow_lag(lateness, i, above, accel, ground, dt)
        implied = state.implied[i] / (1.0 - state.base[i])
        state.apart[i] += (implied / ground - 1.0 - state.apart[i]) * min(dt / SMOOTHING_S, 1.0)
        braking, motor, braked = state.torque[i % 4], motor_torque(inputs, i % 4), False
        driven = accelerates or motor < -TORQUE
        if i < SPEED:
            braked = braking + motor > TORQUE or accel < DRAGGED_ACCEL or state.left_s > 0.0
        beside = max(-BY_ONE_AXLE * slip / ground, 0.0) if motor > -TORQUE and not tells else 0.0
        apart = _judged(state, i, ground, free, braked, driven, drives, beside)
        confirmed = i == SPEED and over_ground_confirmed(state.carried)
        if confirmed or (i < SPEED and _slides(state, i, apart, braked, driven, dt)):
            apart = math.nan
        place = _place(i)
        unit = ground / params.wheel_radius[i] if i < SPEED else ground
        lag = doubted_lag(lateness) * abs(accel) / ground if i == SPEED else 0.0
        allowed = rolling if (tells or free) and found and i < SPEED else tolerance + lag
        if i == SPEED or not judge_lag(lateness, witness, i, place, unit / ground, dt):
            judge(witness, place, apart * unit, allowed * unit, DOUBT_S, dt)
        if free and not witness.rejected[place] and abs(apart) < allowed:
            base = state.base[i] + (state.apart[i] - state.base[i]) * dt / max(state.rolled_s, dt)
            state.base[i] = min(max(base, -FARTHEST_BASE), FARTHEST_BASE)
