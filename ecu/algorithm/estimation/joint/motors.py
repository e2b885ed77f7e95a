"""Motor torque as a regressor, with its noise separated.

With a reading T + n the balance has the innovation -c n and the regressor -c (T + n): their product has the
mean c^2 sigma^2 in every window, and would bias the mass upwards without end. So derivatives use the torque
low-passed up to the end of the last window, independent of this window's noise, and the variance of the
measurement includes the noise of the readings, estimated from their second differences.
"""

import numpy as np

from ecu.algorithm.inputs import fresh, motor_torque
from ecu.algorithm.lag import lag_gain
from ecu.contract.signals import MOTOR_TORQUE
from ecu.jit import Record, kernel

MOTORS_STATE = np.dtype(
    [
        ("smooth", "f8", (4,)),  # low-passed [N m]
        ("last_smooth", "f8", (4,)),  # at the end of the last window [N m]
        ("before", "f8", (2, 4)),  # samples, the newer in row 0 [N m]
        ("samples", "i8", (4,)),
        ("variance", "f8", (4,)),  # of a sample's noise [(N m)^2]
    ],
    align=True,
)

SMOOTHING = 0.2  # s
MEMORY = 100  # samples, of the variance
LARGEST_STEP = 200.0  # N m between samples: beyond it the demand has stepped, which is not noise


@kernel
def follow_motors(state: Record, inputs: Record, dt: float) -> None:
    """Update the filters by this cycle's readings."""
    gain = lag_gain(dt, SMOOTHING)
    for i in range(4):
        torque = motor_torque(inputs, i)
        state.smooth[i] += gain * (torque - state.smooth[i])
        if not fresh(inputs, MOTOR_TORQUE + i):
            continue
        bend = torque - 2.0 * state.before[0, i] + state.before[1, i]
        state.before[1, i], state.before[0, i] = state.before[0, i], torque
        state.samples[i] = min(state.samples[i] + 1, MEMORY)
        if state.samples[i] > 2 and abs(bend) < LARGEST_STEP:
            state.variance[i] += (bend * bend / 6.0 - state.variance[i]) / state.samples[i]
