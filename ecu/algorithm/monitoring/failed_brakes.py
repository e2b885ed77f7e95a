"""Failed callipers and circuits.

A pressure far below its demand means a failed brake or a failed sensor. The car's deceleration tells which:
lining force by the expected pressures, less that by acceleration (4.16), equals the force owed by the
suspected wheels, or zero.

    failed       pressure below `FOLLOWING` of the modelled response to the demands, and more than half of the
                 force that these wheels owe is missing, both for `SURE_S`
    sound again  the pressure follows, or early in another application no force is missing, for `SURE_S`

The expected force uses the friction at the start of the application, corrected by its change while all
pressures follow: friction learned with a wheel believed failed would confirm that belief.
"""

import numpy as np

from ecu.algorithm.brake import brake_gain
from ecu.algorithm.inputs import motor_torque, others_brake, usable
from ecu.algorithm.lag import lag_gain, settled
from ecu.contract.params import BAR, GRAVITY
from ecu.contract.signals import CALLIPER_PRESSURE
from ecu.jit import Record, kernel

FAILED_BRAKES_STATE = np.dtype(
    [
        ("failed", "u1", (4,)),
        ("any", "u1"),
        ("owed", "f8", (4,)),  # lining force by the modelled response to the demands [N], low-passed
        ("given", "f8"),  # force of all linings by the acceleration [N], low-passed
        ("scale", "f8"),  # delivered over owed force while all pressures follow, in this application
        ("settled_s", "f8"),  # time for which the forces could be judged in this application
        ("doubt_s", "f8", (4,)),  # time for which the verdict has been contradicted
    ],
    align=True,
)

LEAST_EXPECTED = 8.0  # bar expected, below it nothing is judged
FOLLOWING = 0.5  # of the expected pressure
MISSING = 0.5  # of the owed force
SURE_S = 0.05
LAG = 0.05  # s: lag of hydraulics, tyres and accelerometer behind the modelled pressure
SETTLED_FROM, SETTLED = 0.05, 0.1  # of the weight, of the force
SCALE_S, LARGEST_SCALE = 0.3, 1.5
AGAIN_S = 0.3  # of an application, in which the previous verdict is re-examined


@kernel
def lining_force(params: Record, law: Record, pressure: float, i: int) -> float:
    """Return the force [N] of a wheel's lining at a pressure [bar]."""
    lever: float = brake_gain(params, i) / params.wheel_radius[i]
    return lever * law.base[i] * max(BAR * pressure - params.push_out_pressure[i], 0.0)


@kernel
def watch_brakes(
    params: Record,
    state: Record,
    inputs: Record,
    estimate: Record,
    law: Record,
    expected: Record,
    zero: Record,
    sent: bool,
    dt: float,
) -> None:
    """Overwrite `state.failed`.

    Args:
        params: `PARAMS`.
        state: `FAILED_BRAKES_STATE`.
        inputs: `INPUTS`.
        estimate: `ESTIMATE` of the last cycle.
        law: `PRESSURE_LAW_STATE`, for the friction.
        expected: pressures that follow from the demands sent, shape (4,) [bar].
        zero: pressure zeros, shape (4,) [bar]; NaN: the reading shows no failure.
        sent: the demands were valid; otherwise, and while another controller brakes, nothing is judged.
        dt: time since the last cycle [s].
    """
    gain = lag_gain(dt, LAG)
    weight = params.mass * GRAVITY
    given = -estimate.tyre_force - params.rolling_resistance * weight
    due, total, suspected, braked = 0.0, 0.0, 0.0, False
    for i in range(4):
        force = lining_force(params, law, expected[i], i)
        state.owed[i] = settled(state.owed[i] + gain * (force - state.owed[i]))
        given -= motor_torque(inputs, i) / params.wheel_radius[i]
        due += force
        total += state.owed[i]
        braked = braked or expected[i] > LEAST_EXPECTED
        if _lacks(inputs, expected[i], zero[i], i):
            suspected += state.owed[i]
    state.given += gain * (given - state.given)
    if not braked:
        state.settled_s, state.scale = 0.0, 1.0
    judged = sent and not others_brake(inputs) and estimate.measured != 0 and estimate.backwards == 0
    judged = judged and total > SETTLED_FROM * weight and abs(due - total) < SETTLED * total
    if judged:
        state.settled_s += dt
        if suspected == 0.0 and state.any == 0:
            scale = min(max(state.given / total, 1.0 / LARGEST_SCALE), LARGEST_SCALE)
            state.scale += dt / SCALE_S * (scale - state.scale)
    missing = state.scale * total - state.given > MISSING * state.scale * suspected
    state.any = 0
    for i in range(4):
        known = judged and expected[i] > LEAST_EXPECTED and usable(inputs, CALLIPER_PRESSURE + i)
        stays = state.failed[i] != 0 and state.settled_s > AGAIN_S
        fails = _lacks(inputs, expected[i], zero[i], i) and (missing or stays)
        state.doubt_s[i] = state.doubt_s[i] + dt if known and fails != (state.failed[i] != 0) else 0.0
        if state.doubt_s[i] >= SURE_S:
            state.failed[i], state.doubt_s[i] = 1 if fails else 0, 0.0
        state.any = max(state.any, state.failed[i])


@kernel
def _lacks(inputs: Record, expected: float, zero: float, i: int) -> bool:
    reading = inputs.value[CALLIPER_PRESSURE + i] - zero
    below = -LEAST_EXPECTED < reading < FOLLOWING * expected  # a brake that gives nothing reads no suction
    return expected > LEAST_EXPECTED and usable(inputs, CALLIPER_PRESSURE + i) and below
