"""An accelerometer whose reading stands still, or comes late.

frozen   every sample is the last one for `SAME_S`, while the wheels' deceleration changes
late     where the force of linings and motors has changed and is steady again, the reading has followed by L:

    L = sum over 1.2 s of ((f - f_0) / (f_1 - f_0) - (a - a_0) / (a_1 - a_0)) 0.1 s

of the blocks of `accel_blocks.py`, 0 before and 1 after the change. Each is over its own change, so neither
friction, mass, slope nor the reading's zero and scale are in it; tyres and pitch take up to 0.045 s (all
simulated cars). A reading that is late seems to be a lining that rubs less as the brakes come, and more as
they go, and motors that give what they do not: these are believed again. It is left out until it is in time.
"""

import math

import numpy as np

from ecu.algorithm.inputs import fresh
from ecu.algorithm.monitoring.accel_blocks import BLOCK_S, BLOCKS, ROLLED, A, F
from ecu.algorithm.monitoring.witness import believe, compare
from ecu.contract.signals import ACCEL_X, MOTOR_TORQUE
from ecu.jit import Record, kernel

ACCEL_TIMING_STATE = np.dtype(
    [
        ("reading", "f8"),  # last sample [m/s^2]
        ("same_s", "f8"),  # time for which every sample has been that
        ("alike", "i8"),  # changes of force in a row that have said the same, at most `AGAIN`
        ("late", "u1"),
    ],
    align=True,
)

SAME_S, CHANGED = 0.6, 1.0  # s of blocks that are compared; m/s^2, of the wheels' deceleration meanwhile
LEAST_CHANGE = 1.5  # m/s^2, of the force
STEADY, SETTLED = 0.15, 4  # of the change; blocks after it
FOLLOWS = 0.4  # of the change, what the reading has to show of it
LATE, IN_TIME = 0.07, 0.05  # s
SURE, AGAIN = 2, 4  # blocks that say that it is late, and in time again
RATE = 10.0  # m/s^3, of a force that changes: at it the innovation is published


@kernel
def _frozen(state: Record, mean: Record, witness: Record, inputs: Record, dt: float) -> bool:
    if fresh(inputs, ACCEL_X):
        same = inputs.value[ACCEL_X] == state.reading
        state.reading, state.same_s = inputs.value[ACCEL_X], state.same_s + dt if same else 0.0
    change = (mean[0, ROLLED] - mean[1, ROLLED] - mean[3, ROLLED] + mean[4, ROLLED]) / BLOCK_S
    return bool(state.same_s > SAME_S and compare(witness, ACCEL_X, -change, CHANGED) > 1.0)


@kernel
def _ends(mean: Record, j: int) -> tuple[float, float]:
    """Return column `j` before the last blocks' change and after it."""
    return 0.5 * (mean[BLOCKS - 1, j] + mean[BLOCKS - 2, j]), 0.5 * (mean[0, j] + mean[1, j])


@kernel
def _lag(mean: Record) -> float:
    """Return by how much later than the force the reading has changed [s]; NaN: nothing is said."""
    before, after = _ends(mean, F)
    first, last = _ends(mean, A)
    change, followed = after - before, last - first
    steady = STEADY * abs(change)
    said = abs(change) > LEAST_CHANGE and abs(mean[BLOCKS - 1, F] - before) < 0.5 * steady
    for k in range(SETTLED):
        said = said and abs(mean[k, F] - after) < steady
    # The linings' first force is in the reading before it counts as braking.
    said = said and max(abs(mean[BLOCKS - 1, A] - first), abs(mean[0, A] - last)) < 0.5 * steady
    if not said or followed * change < FOLLOWS * change * change:
        return math.nan
    lag = 0.0
    for k in range(BLOCKS):
        lag += BLOCK_S * ((mean[k, F] - before) / change - (mean[k, A] - first) / followed)
    return lag


@kernel
def _follow_lag(state: Record, mean: Record, witness: Record) -> None:
    """Overwrite `late` by the last blocks."""
    lag = _lag(mean)
    if math.isnan(lag):
        return
    compare(witness, ACCEL_X, max(lag, 0.0) * RATE, LATE * RATE)  # early ones: the pressures are late
    said = lag < IN_TIME if state.late else lag > LATE
    state.alike = state.alike + 1 if said else 0
    if state.alike == (AGAIN if state.late else SURE):
        state.late, state.alike = 1 - state.late, 0
        for i in range(MOTOR_TORQUE, MOTOR_TORQUE + 4):
            if state.late:
                believe(witness, i)  # they were judged by it


@kernel
def watch_timing(state: Record, blocks: Record, witness: Record, inputs: Record, dt: float) -> None:
    """Reject a reading that stands still while the wheels' deceleration changes, or is late.

    Args:
        state: `ACCEL_TIMING_STATE`, overwritten.
        blocks: `ACCELERATION_STATE`.
        witness: `WITNESS_STATE`; the fields of accelerometer and motors are overwritten.
        inputs: `INPUTS` as received.
        dt: time since the last cycle [s].
    """
    frozen = _frozen(state, blocks.mean, witness, inputs, dt)
    if blocks.time == 0.0 and blocks.compared_blocks >= BLOCKS:
        _follow_lag(state, blocks.mean, witness)
    kept = witness.rejected[ACCEL_X] != 0 and state.same_s > 0.0
    witness.rejected[ACCEL_X] = 1 if frozen or kept or state.late else 0
