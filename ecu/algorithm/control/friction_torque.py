"""Lag of the lining torque behind its demand, which motors can compensate.

Model. The demands sent, after the dead time of the hydraulics (A.17, A.18: 26 ms for a rise, 15 ms for a
fall; here 25 and 15, half cycles), drive a second-order pressure,

    inertia p'' + damping p' + p = min(rise, fall)

by the trapezoidal rule. The dead time is longer than a cycle, so the coming one is known already. The
sensor's 1.8 bar of noise is some 50 N m at a front wheel: its samples correct the model, with greater weight
the more the pressure has changed. Torque is 2 A_k r_eff mu (p - p_0) (A.19) with the friction of the pressure
law: only the lag is modelled, neither errors of the law nor its limits.
"""

import numpy as np

from ecu.algorithm.brake import brake_gain, correct_pressure
from ecu.algorithm.control.pressure_law import friction_in_use
from ecu.algorithm.inputs import fresh
from ecu.contract.params import BAR
from ecu.contract.signals import CALLIPER_PRESSURE, CYCLE_NS
from ecu.jit import Record, kernel

FRICTION_TORQUE_STATE = np.dtype(
    [
        ("demand", "f8", (3, 4)),  # of the last cycles [bar], the newest in row 0
        ("model", "f8", (4,)),  # pressure at the end of the coming cycle, by the demands alone [bar]
        ("rate", "f8", (4,)),  # bar/s
        ("value", "f8", (4,)),  # the same pressure, corrected by the sensor [bar]
        ("variance", "f8", (4,)),  # bar^2
        ("disagreement", "f8", (4,)),  # low-passed innovation [bar]
        ("agreed_s", "f8", (4,)),  # time for which model and sensor have agreed
    ],
    align=True,
)

BUILD_UP = (0.00075, 0.037)  # s^2, s (A.17)
RELEASE = (0.00021, 0.045)  # s^2, s (A.18)
CYCLE = 1e-9 * CYCLE_NS
LONGEST_GAP = 100  # cycles
WALK = 0.1  # bar/sqrt(s)
SHARE = 0.05  # of a change, one standard deviation


@kernel
def _advance_half_cycle(state: Record, i: int, target: float) -> None:
    """Move a wheel's modelled pressure on."""
    inertia, damping = RELEASE if target < state.model[i] else BUILD_UP
    half = 0.25 * CYCLE
    weight = half * (damping + half) / inertia
    pull = 2.0 * half / inertia * (target - state.model[i])
    rate = (state.rate[i] * (1.0 - weight) + pull) / (1.0 + weight)
    state.model[i] += half * (state.rate[i] + rate)
    state.rate[i] = rate


@kernel
def _advance_cycle(state: Record, i: int, sent: float) -> None:
    """Move a wheel's pressure on by the coming cycle; `sent` [bar] is the demand of the one before."""
    demand, before = state.demand, state.model[i]
    demand[2, i], demand[1, i], demand[0, i] = demand[1, i], demand[0, i], sent
    _advance_half_cycle(state, i, min(demand[2, i], demand[1, i]))
    _advance_half_cycle(state, i, min(demand[1, i], demand[0, i]))
    change = state.model[i] - before
    state.value[i] += change
    state.variance[i] += WALK**2 * CYCLE + (SHARE * change) ** 2


@kernel
def follow_pressure(
    params: Record, state: Record, inputs: Record, sent: Record, zero: Record, dt: float
) -> None:
    """Update the model by the demands of the last cycle and the pressures measured now.

    Args:
        params: `PARAMS`.
        state: `FRICTION_TORQUE_STATE`, overwritten.
        inputs: `INPUTS`.
        sent: pressure demands of the last cycle [Pa], shape (4,).
        zero: pressure zeros [bar], shape (4,).
        dt: time since the last cycle [s]; missed cycles held the demand.
    """
    missed = min(max(round(dt / CYCLE), 1), LONGEST_GAP) - 1
    for i in range(4):
        for _ in range(missed):
            _advance_cycle(state, i, sent[i] / BAR)
        place = CALLIPER_PRESSURE + i
        if fresh(inputs, place):
            reading = inputs.value[place] - zero[i]
            correct_pressure(state, i, reading, params.sigma_pressure / BAR, dt)
        _advance_cycle(state, i, sent[i] / BAR)


@kernel
def lagging_torque(params: Record, state: Record, law: Record, wanted: float, i: int) -> float:
    """Return the torque that a wheel's lining lacks of its demand at the end of the coming cycle [N m].

    Args:
        params: `PARAMS`.
        state: `FRICTION_TORQUE_STATE`.
        law: `PRESSURE_LAW_STATE`, for the friction.
        wanted: pressure demanded now [Pa].
        i: wheel.
    """
    lever = brake_gain(params, i)
    push_out = params.push_out_pressure[i]
    missing = max(wanted - push_out, 0.0) - max(BAR * state.value[i] - push_out, 0.0)
    return lever * friction_in_use(law, i) * missing
