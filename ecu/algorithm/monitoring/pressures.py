"""Calliper pressures beside those that follow from the demands sent (`ecu.algorithm.hydraulics`).

While the ECU's demands are executed, each pressure is known twice. Of the two the demand is what counts for
the force: friction learned as force over demanded pressure gives the demanded force whatever the pressure
really is. So a difference that lasts is taken out of the reading,

    reading = zero + (1 + ratio) model + offset        offset: at released brakes, ratio: at applied ones

but for a tolerance within which a sound reading is better than the model; quick changes remain the sensor's.
Beyond `OFFSET` or `RATIO`, and at once where the reading is far off, the modelled pressure stands for it.

A pressure may really be another: a circuit leaks, someone else brakes, nobody follows the demand. Where the
readings make a clear difference to the force, the car's deceleration (4.16) decides: if it agrees with the
readings, they are believed. A brake that gives nothing is `failed_brakes`' to find.
"""

import math

import numpy as np

from ecu.algorithm.inputs import fresh, others_brake, usable
from ecu.algorithm.monitoring.failed_brakes import LAG, lining_force
from ecu.algorithm.monitoring.witness import compare
from ecu.contract.params import GRAVITY
from ecu.contract.signals import CALLIPER_PRESSURE
from ecu.jit import Record, kernel

PRESSURES_STATE = np.dtype(
    [
        ("offset", "f8", (4,)),  # lasting difference from the model at released brakes [bar]
        ("ratio", "f8", (4,)),  # further one at applied brakes, over the model
        ("rest", "f8", (4,)),  # zero; NaN: no reading of a released brake [bar]
        ("read", "f8"),  # force of the linings by the readings [N], low-passed
        ("honest", "u1"),  # the deceleration agrees with the readings, not with the model
        ("doubt_s", "f8", (4,)),  # excess time for which a reading was too far off
        ("wrong", "u1", (4,)),  # the model stands for this reading
        ("shown_at", "f8", (4,)),  # modelled pressure at which that showed [bar]
    ],
    align=True,
)

APPLIED, RELEASED = 5.0, 0.5  # bar by the model
STEADY = 20.0  # bar/s: at quicker changes lag differs more than sensors do
LEARN_S, WEAK = 0.5, 15.0  # s, bar: at this pressure a ratio is learned half as fast
OFFSET, RATIO = 3.0, 0.1  # bar, 1: no hydraulics and sensor that are sound differ more
LEAST_SCALED = 3.0  # bar, of a ratio's effect: at low pressures noise and zero are a ratio
LARGEST_OFFSET, LARGEST_RATIO = 4.5, 0.5  # bar, 1: learned
FAR, FAR_SHARE = 8.0, 0.2  # bar, of the pressure: too far off for noise and lag
ABOVE = 16.0  # bar, of one sample: noise of 3 bar that is cut off sooner is a bias
KEPT, KEPT_SHARE = 0.6, 0.025  # bar, of the model: so much stays in a reading, of which it is the better one
LEAST_FORCE, LEAST_SHARE = 0.05, 0.4  # of the weight, of the modelled force: a clear difference
LEAST_SPEED = 1.0  # m/s: a car at standstill does not show its brakes' force
SURE_S, DOUBT_S = 0.1, 0.3  # decided by the deceleration, and by nothing but the difference
SHOWN = 0.5  # of the pressure at which a reading was wrong: at none, one that is scaled agrees


@kernel
def _learn(state: Record, i: int, gap: float, model: float, dt: float) -> None:
    """Follow the lasting difference `gap` [bar] of a wheel at a steady pressure `model` [bar]."""
    gain = dt / LEARN_S
    if model < RELEASED:
        offset = state.offset[i] + gain * (gap - state.offset[i])
        state.offset[i] = min(max(offset, -LARGEST_OFFSET), LARGEST_OFFSET)
    elif model > APPLIED:
        error = gap - state.offset[i] - state.ratio[i] * model
        ratio = state.ratio[i] + gain * error * model / (model * model + WEAK * WEAK)
        state.ratio[i] = min(max(ratio, -LARGEST_RATIO), LARGEST_RATIO)


@kernel
def _compare_forces(
    params: Record,
    state: Record,
    inputs: Record,
    law: Record,
    brakes: Record,
    model: Record,
    zero: Record,
    dt: float,
) -> bool:
    """Overwrite `state.honest`; return whether the forces by readings and by the model differ clearly."""
    read, owed = 0.0, 0.0
    for i in range(4):
        place = CALLIPER_PRESSURE + i
        pressure = inputs.value[place] - zero[i] if usable(inputs, place) else model[i]
        read += lining_force(params, law, pressure, i)
        owed += brakes.owed[i]
    state.read += dt / (LAG + dt) * (read - state.read)
    apart = abs(state.read - owed)
    decides: bool = apart > max(LEAST_FORCE * params.mass * GRAVITY, LEAST_SHARE * owed)
    given = brakes.given / brakes.scale
    state.honest = 1 if decides and abs(given - state.read) < abs(given - owed) else 0
    return decides


@kernel
def compare_pressures(
    params: Record,
    state: Record,
    witness: Record,
    inputs: Record,
    estimate: Record,
    law: Record,
    brakes: Record,
    hydraulics: Record,
    sent: bool,
    dt: float,
) -> bool:
    """Overwrite which readings are wrong, and what lasts of all differences; return whether one is new.

    Args:
        params: `PARAMS`.
        state: `PRESSURES_STATE`.
        witness: `WITNESS_STATE`; what is published of the pressures is overwritten.
        inputs: `INPUTS` as received.
        estimate: `ESTIMATE` of the last cycle.
        law: `PRESSURE_LAW_STATE`, for the friction.
        brakes: `FAILED_BRAKES_STATE` of this cycle.
        hydraulics: `HYDRAULICS_STATE`: modelled response to the demands sent.
        sent: the demands were valid; otherwise all readings are believed.
        dt: time since the last cycle [s].
    """
    model, zero, begins = hydraulics.model, estimate.pressure_zero, False
    if not sent:
        state.honest = 0
        for i in range(4):
            state.doubt_s[i], state.wrong[i] = 0.0, 0
        return False
    if others_brake(inputs):
        return False
    decides = _compare_forces(params, state, inputs, law, brakes, model, zero, dt)
    shown = estimate.measured and not estimate.backwards and estimate.speed > LEAST_SPEED
    if decides and not shown:
        return False
    for i in range(4):
        place = CALLIPER_PRESSURE + i
        if not usable(inputs, place) or brakes.failed[i]:
            state.doubt_s[i], state.wrong[i] = 0.0, 0
            continue
        unapplied = estimate.pressure_at_rest[i] if model[i] < RELEASED else zero[i]
        gap = inputs.value[place] - unapplied - model[i]
        if fresh(inputs, place) and not state.honest and abs(hydraulics.rate[i]) < STEADY:
            _learn(state, i, gap, model[i], dt)
        state.rest[i] = zero[i] if abs(state.offset[i]) < OFFSET else math.nan
        far = offset = scaled = 0.0  # test ratios
        if not state.honest:
            far = compare(witness, place, gap, FAR + FAR_SHARE * model[i])
            offset = compare(witness, place, state.offset[i], OFFSET)
            if abs(state.ratio[i]) * model[i] > LEAST_SCALED:
                scaled = compare(witness, place, state.ratio[i] * model[i], RATIO * model[i])
        if max(far, offset, scaled) > 1.0:
            state.doubt_s[i] = min(state.doubt_s[i] + dt, 2.0 * DOUBT_S)
        elif not state.wrong[i] or model[i] >= SHOWN * state.shown_at[i]:
            state.doubt_s[i] = max(state.doubt_s[i] - dt, 0.0)
        if state.doubt_s[i] > (SURE_S if decides else DOUBT_S):
            if not state.wrong[i]:
                begins, state.shown_at[i] = True, model[i]
            state.wrong[i] = 1
        elif state.doubt_s[i] == 0.0:
            state.wrong[i] = 0
    return begins


@kernel
def pressures_doubted(state: Record) -> bool:
    """Return whether a pressure is far off and not yet replaced: the torques of the linings are not known."""
    doubted = False
    for i in range(4):
        doubted = doubted or (state.doubt_s[i] > 0.0 and state.wrong[i] == 0)
    return doubted


@kernel
def lasting_difference(state: Record, i: int, model: float) -> float:
    """Return what is taken out of a reading at a modelled pressure [bar]."""
    lasting: float = state.offset[i] + state.ratio[i] * model
    kept = KEPT**2 + (KEPT_SHARE * model) ** 2
    return lasting - kept / lasting if lasting * lasting > kept else 0.0


@kernel
def beyond_noise(state: Record, pressure: float, model: float) -> bool:
    """Return whether a reading less its zero is above the model [bar] by what one sample's noise never is.

    Force that the car's deceleration does not show is not taken from the motors.
    """
    beyond: bool = not state.honest and pressure - model > ABOVE + FAR_SHARE * model
    return beyond
