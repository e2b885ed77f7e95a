"""Zero and scale of the accelerometer that have drifted, by the wheels' deceleration and by coasting.

    a - dw/dt = c + s dw/dt      c: zero and slope of the road, walks by `SLOPE_WALK`; s: scale error
    a - f     = b                b: zero, while no brake is applied and the motors alone drive the car

of the blocks of 0.1 s that `acceleration.py` gathers. The first is a Kalman filter of two states: a slope
does not come and go with the brakes. An error beyond its doubt is taken off the reading; one within is left
to the observer. A zero moves b and c alike: c by what it is apart from the slope, its mean while b was within
its doubt. A b that c does not show is no zero of the accelerometer (`motors.py`). A reading that is off by
more than `GROSS` is not followed: it is implausible as a whole.
"""

import math

import numpy as np

from ecu.algorithm.inputs import fresh
from ecu.algorithm.monitoring.acceleration import BLOCK_S, ROLLED, A, F, W
from ecu.algorithm.monitoring.witness import compare
from ecu.contract.params import GRAVITY
from ecu.contract.signals import ACCEL_X
from ecu.jit import Record, kernel

ACCEL_ERROR_STATE = np.dtype(
    [
        ("offset", "f8"),  # c [m/s^2]
        ("scale", "f8"),  # s
        ("p", "f8", (3,)),  # variances of both, covariance
        ("zero", "f8"),  # b [m/s^2]
        ("slope", "f8"),  # c as b was found within its doubt, mean of the last `SLOPE_S` [m/s^2]
        ("sloped_s", "f8"),  # learning time of that, at most `SLOPE_S`
        ("coasted_s", "f8"),  # learning time of that, at most `ZERO_S`
        ("proven_s", "f8"),  # time for which the motors' torques alone have driven the car, at most `SURE_S`
        ("zero_off", "f8"),  # taken off the reading [m/s^2]
        ("scale_off", "f8"),  # of it
        ("reading", "f8"),  # last sample [m/s^2]
        ("same_s", "f8"),  # time for which every sample has been that
    ],
    align=True,
)

OFFSET_START, SCALE_START, SCALE_MOST = 0.5, 0.03, 0.05  # m/s^2, -, -
LEAST_SHOWN = 2.0  # m/s^2, below which a scale does not show
ACROSS = 1.0  # m/s^2, above which tyres drag
SLOPE_WALK, SCALE_WALK = 0.1, 0.01  # m/s^2 and - per root second
NOISE = 0.15  # m/s^2, of a block's difference
SLIP, SLIP_BY_SPEED = 0.1, 0.01  # of a change of force, -, s/m
STEADY = 1.0  # m/s^2 in 0.2 s, beyond which tyres are on their way
FARTHEST = 0.5
GROSS = 1.5  # m/s^2
ZERO_S, FEWEST_S = 1.0, 0.3
FORCE = 0.1  # relative error of mass and motors
WEIGHT = 0.15  # m/s^2, error of drag and rolling resistance
SCALE_DOUBT, SIGMAS = 0.03, 2.0
ZERO_DOUBT = 0.25  # m/s^2
PROVING, ENGINE = 1.0, 0.2  # m/s^2; of it, what an unreported engine exceeds
PROVEN_S, SURE_S, REFUTES = 0.5, 3.0, 5.0  # s, s; times as fast as it is proven
CONFIRMED = 0.5  # of the zero, what the wheels must show of it too
KEPT = 0.4
SLOPE_S = 10.0
SAME_S = 0.6  # the blocks whose deceleration is compared
CHANGED = 1.0  # m/s^2, of the wheels' deceleration meanwhile


@kernel
def _off(value: float, doubt: float, off: float) -> float:
    """Return what to take off: an error beyond its doubt, until it is below `KEPT` of it.

    `off`: taken off until now.
    """
    least = doubt if off == 0.0 else KEPT * doubt
    return value if abs(value) > least else 0.0


@kernel
def _follow_scale(state: Record, mean: Record) -> None:
    """Correct offset and scale error by the last block."""
    p = state.p
    p[0] += SLOPE_WALK**2 * BLOCK_S
    p[1] = min(p[1] + SCALE_WALK**2 * BLOCK_S, SCALE_MOST**2)
    change = abs(mean[0, F] - mean[2, F])
    if change > STEADY:
        return
    rolled = (mean[0, W] - mean[1, W]) / BLOCK_S
    h = (mean[0, W] - mean[3, W]) / (3.0 * BLOCK_S)
    if abs(h) < LEAST_SHOWN:
        h = 0.0  # noise of the wheels would show as a scale
    noise = NOISE + (SLIP + SLIP_BY_SPEED * mean[0, W]) * change / (2.0 * BLOCK_S)
    innovation = 0.5 * (mean[0, A] + mean[1, A]) - rolled - state.offset - state.scale * h
    if abs(innovation) > GROSS:
        return
    to_offset, to_scale = p[0] + h * p[2], p[2] + h * p[1]
    variance = to_offset + h * to_scale + noise * noise
    state.offset += to_offset / variance * innovation
    state.scale = min(max(state.scale + to_scale / variance * innovation, -FARTHEST), FARTHEST)
    p[0] -= to_offset * to_offset / variance
    p[1] -= to_scale * to_scale / variance
    p[2] -= to_offset * to_scale / variance


@kernel
def _follow_zero(params: Record, state: Record, mean: Record) -> None:
    """Low-pass the difference from the motors' force and the resistances, by its certainty, and the slope."""
    speed = mean[0, W]
    resistance = params.drag_area * speed * speed / params.mass + params.rolling_resistance * GRAVITY
    innovation = mean[0, A] - mean[0, F] + resistance - state.zero
    if mean[0, F] > PROVING:
        engine = ENGINE * mean[0, F] + ZERO_DOUBT
        if abs(innovation) < engine:
            state.proven_s = min(state.proven_s + BLOCK_S, SURE_S)
        elif innovation > engine:
            state.proven_s = max(state.proven_s - REFUTES * BLOCK_S, 0.0)
    if abs(innovation) > GROSS or state.proven_s < PROVEN_S:
        return
    certainty = (WEIGHT / (WEIGHT + FORCE * abs(mean[0, F]))) ** 2
    state.coasted_s = min(state.coasted_s + certainty * BLOCK_S, ZERO_S)
    gain = certainty * BLOCK_S / state.coasted_s
    state.zero += gain * innovation
    if abs(state.zero) < ZERO_DOUBT:
        state.sloped_s = min(state.sloped_s + BLOCK_S, SLOPE_S)
        state.slope += (state.offset - state.slope) * BLOCK_S / state.sloped_s


@kernel
def moved_offset(state: Record) -> float:
    """Return what the wheels show of a zero of the accelerometer [m/s^2]: c less the slope."""
    moved: float = state.offset - state.slope
    return moved


@kernel
def follow_accel_error(
    params: Record, state: Record, witness: Record, blocks: Record, across: float, braking: bool
) -> None:
    """Overwrite what is to be taken off the accelerometer's reading.

    Args:
        params: `PARAMS`.
        state: `ACCEL_ERROR_STATE`, overwritten.
        witness: `WITNESS_STATE`; what is published of the accelerometer is overwritten.
        blocks: `ACCELERATION_STATE`, whose last block was closed in this cycle.
        across: lateral acceleration [m/s^2].
        braking: a brake application lasts.
    """
    if state.p[0] == 0.0:
        state.p[0], state.p[1] = OFFSET_START**2, SCALE_START**2
    if blocks.good_blocks > 3:
        _follow_scale(state, blocks.mean)
    if blocks.known_blocks > 1 and not braking and abs(across) < ACROSS:
        _follow_zero(params, state, blocks.mean)
    doubt = SCALE_DOUBT + SIGMAS * math.sqrt(state.p[1])
    compare(witness, ACCEL_X, state.scale * LEAST_SHOWN, doubt * LEAST_SHOWN)
    state.scale_off = _off(state.scale, doubt, state.scale_off)
    if state.coasted_s > FEWEST_S:
        confirmed = moved_offset(state) / state.zero > CONFIRMED if state.zero != 0.0 else False
        state.zero_off = _off(state.zero, ZERO_DOUBT, state.zero_off) if confirmed else 0.0
        if confirmed:
            compare(witness, ACCEL_X, state.zero, ZERO_DOUBT)


@kernel
def watch_frozen(state: Record, blocks: Record, witness: Record, inputs: Record, dt: float) -> None:
    """Reject a reading whose samples are all the same while the wheels' deceleration changes.

    Args:
        state: `ACCEL_ERROR_STATE`, overwritten.
        blocks: `ACCELERATION_STATE`.
        witness: `WITNESS_STATE`; the accelerometer's fields are overwritten.
        inputs: `INPUTS` as received.
        dt: time since the last cycle [s].
    """
    if fresh(inputs, ACCEL_X):
        same = inputs.value[ACCEL_X] == state.reading
        state.reading, state.same_s = inputs.value[ACCEL_X], state.same_s + dt if same else 0.0
    if state.same_s == 0.0:
        witness.rejected[ACCEL_X] = 0
    mean = blocks.mean
    change = (mean[0, ROLLED] - mean[1, ROLLED] - mean[3, ROLLED] + mean[4, ROLLED]) / BLOCK_S
    if state.same_s > SAME_S and compare(witness, ACCEL_X, -change, CHANGED) > 1.0:
        witness.rejected[ACCEL_X] = 1


@kernel
def correct_accel(state: Record, reading: float) -> float:
    """Return the reading [m/s^2] less what zero and scale are known to have drifted by."""
    corrected: float = (reading - state.zero_off) / (1.0 + state.scale_off)
    return corrected
