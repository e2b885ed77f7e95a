"""Deceleration by accelerometer, wheels and torques, each as a mean over a block of 0.1 s.

`acceleration.py` has the three sources. What tyres may add to that of the wheels where the force changes is
(SLIP + SLIP_BY_SPEED v) range(f).
"""

import math

from ecu.algorithm.inputs import fresh, motor_torque
from ecu.algorithm.vehicle import tyre_slip
from ecu.contract.params import GRAVITY
from ecu.contract.signals import ACCEL_X, WHEEL_SPEED
from ecu.jit import Record, kernel

A, W, F, ROLLED = range(4)
KINDS = 4
BLOCKS = 12

BLOCK_S = 0.1
LONGEST_BLOCK_S = 0.125  # cycles were missed
SLIP, SLIP_BY_SPEED = 0.1, 0.01  # -, s/m
SHOWN = 0.5  # of the acceleration at which it jumped: a scale shows at no lesser one


@kernel
def gather_block(
    params: Record,
    state: Record,
    inputs: Record,
    estimate: Record,
    base: Record,
    braking: bool,
) -> None:
    """Add a cycle to the sums of the block: accelerometer, wheels, force of the brakes and motors."""
    value = inputs.value
    force, wheels = 0.0, 0.0
    for i in range(4):
        radius = params.wheel_radius[i]
        lining = estimate.brake_torque[i] * base[i] / estimate.mu[i] if braking else 0.0
        force -= (lining + motor_torque(inputs, i)) / (radius * params.mass)
        wheels += 0.25 * value[WHEEL_SPEED + i] * radius
    reading = value[ACCEL_X] / (1.0 + GRAVITY * params.pitch_gradient)
    state.sum[A] += reading + estimate.yaw_rate * estimate.lateral_speed
    state.sum[W] += wheels * (1.0 + tyre_slip(params, reading))
    state.sum[F] += force
    state.sum[ROLLED] += wheels
    state.readings += 1 if fresh(inputs, ACCEL_X) else 0
    state.cycles += 1


@kernel
def close_block(params: Record, state: Record) -> None:
    """Put the block's means before those of earlier ones, and begin the next block."""
    turns = 0.5 * params.wheel_radius[0] * params.sigma_wheel_speed
    variance = 0.6 * params.sigma_accel**2 + 2.0 * (turns / (2.0 * BLOCK_S)) ** 2
    state.sigma = math.sqrt(variance / max(state.readings, 1))
    for k in range(BLOCKS - 1, 0, -1):
        for j in range(KINDS):
            state.mean[k, j] = state.mean[k - 1, j]
    for j in range(KINDS):
        state.mean[0, j] = state.sum[j] / state.cycles
        state.sum[j] = 0.0
    sound = state.good != 0 and state.time < LONGEST_BLOCK_S
    state.good_blocks = state.good_blocks + 1 if sound else 0
    state.known_blocks = state.known_blocks + 1 if sound and state.known else 0
    state.compared_blocks = state.compared_blocks + 1 if sound and state.known else 0
    state.time, state.cycles, state.readings, state.good, state.known = 0.0, 0, 0, 1, 1


@kernel
def now(mean: Record, j: int) -> float:
    """Return the mean of a quantity over the last three blocks."""
    return (mean[0, j] + mean[1, j] + mean[2, j]) / 3.0


@kernel
def before(mean: Record, j: int) -> float:
    """Return the mean of a quantity over four blocks, which ended a block before the last three began."""
    return 0.25 * (mean[4, j] + mean[5, j] + mean[6, j] + mean[7, j])


@kernel
def wheels_accel(mean: Record, j: int) -> float:
    """Return dv/dt now, v in column `j` [m/s^2]."""
    return (mean[0, j] - mean[2, j]) / (2.0 * BLOCK_S)


@kernel
def smooth_accel(mean: Record) -> float:
    """Return dv/dt over the last four blocks [m/s^2]."""
    return float((mean[0, W] - mean[3, W]) / (3.0 * BLOCK_S))


@kernel
def rolled_accel(state: Record) -> float:
    """Return d(omega r)/dt over the last blocks, of all wheels [m/s^2]; 0 without two of them."""
    mean = state.mean
    return float((mean[0, ROLLED] - mean[2, ROLLED]) / (2.0 * BLOCK_S))


@kernel
def force_moved(mean: Record, blocks: int) -> tuple[float, float]:
    """Return the range of f over the last `blocks`, and what slip may add to dv/dt by that [m/s^2]."""
    least, greatest = mean[0, F], mean[0, F]
    for k in range(1, blocks):
        least, greatest = min(least, mean[k, F]), max(greatest, mean[k, F])
    moved = greatest - least
    return moved, (SLIP + SLIP_BY_SPEED * now(mean, W)) * moved
