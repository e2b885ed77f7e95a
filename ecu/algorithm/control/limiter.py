"""Output limiter: bounds of pressure, its rate and the left-right difference, one axle per call.

For each corner, given the demand of the uncompensated law and the compensated one:

1. not finite, or moving against the uncompensated demand: the uncompensated demand counts until the
   compensated one recovers;
2. T(p, nominal friction) stays within 0.6–1.6 of the torque demanded;
3. left and right differ by no more than `LEFT_RIGHT_SHARE` of the torque demanded, T(p, nominal friction)
   over it: learned friction, compensation and fallbacks of one side together. Torque taken from one side is
   added to the other, so that the axle torque is unchanged;
4. 0–180 bar, and no more than the accumulator holds, as callipers confirm, or the slip guard lets through;
5. rise at most `max_pressure_rate` (at least 1500 bar/s: an emergency stop is not delayed); a fall is
   unlimited while the demand falls or to stay below 2 and 4, and as slow as a rise while it does not.

So published pressures violate 3 only at a wheel held by the slip guard, where the hydraulics are exhausted,
and while a corner moves at the rate of 5: 60 ms at most. A lost sensor is no reason.

Small on purpose, so that it can be tested exhaustively.
"""

import math

import numpy as np

from ecu.algorithm.brake import brake_gain
from ecu.algorithm.inputs import usable
from ecu.algorithm.monitoring.witness import compare, leave_out
from ecu.contract.params import BAR
from ecu.contract.signals import ACCUMULATOR_PRESSURE, CALLIPER_PRESSURE
from ecu.jit import Record, kernel

LIMITER_STATE = np.dtype(
    [
        ("pressure", "f8", (4,)),  # last output [Pa]
        ("uncompensated", "f8", (4,)),  # last uncompensated demand [Pa]
        ("wanted", "f8", (4,)),  # last compensated demand [Pa]
        ("ceiling", "f8", (4,)),  # highest pressure admitted at a corner [Pa]
        ("share", "f8", (4,)),  # T(target, nominal friction) over the torque demanded, 0: no demand
        ("asked", "f8", (4,)),  # compensated demand after the left-right limit [Pa]
        ("falls", "u1", (4,)),  # the demand of the corner falls
        ("limited", "u1"),
        ("starved", "u1"),  # the accumulator holds less than is demanded
        ("short_s", "f8"),  # time for which callipers have confirmed that
        ("above_s", "f8"),  # time for which a calliper has held more than the accumulator reads
        ("confirmed", "u1"),  # the accumulator's reading limits
        ("denied", "u1"),  # it does not: a calliper holds more
    ],
    align=True,
)

LEAST_TORQUE, GREATEST_TORQUE = 0.6, 1.6
LEFT_RIGHT_SHARE = 0.10
BEYOND_ANY = 1e12  # Pa; two infinite pressures have no ratio
# A demand that rises while its compensated twin falls by more than this in one cycle is a fault [Pa].
AGAINST_DEMAND = 5e5
EMPTY = 10.0 * BAR  # far below the gas pressure of any accumulator
MARGIN = 8.0  # bar, of a calliper's pressure above the accumulator's
CONFIRMED_S, DENIED_S = 0.4, 0.1


@kernel
def reads_empty(inputs: Record) -> bool:
    """Return whether an accumulator reports a pressure at which no brake would work."""
    known: bool = usable(inputs, ACCUMULATOR_PRESSURE)
    return known and BAR * inputs.value[ACCUMULATOR_PRESSURE] <= EMPTY


@kernel
def watch_accumulator(state: Record, witness: Record, inputs: Record, dt: float) -> None:
    """Overwrite whether the accumulator's reading limits.

    It does once more is demanded and no calliper has more, both for `CONFIRMED_S`: it takes two witnesses to
    take pressure away. A calliper that holds more denies it.

    Args:
        state: `LIMITER_STATE`.
        witness: `WITNESS_STATE`; what is published of the accumulator is overwritten.
        inputs: `INPUTS`.
        dt: time since the last cycle [s].
    """
    if not usable(inputs, ACCUMULATOR_PRESSURE):
        state.short_s, state.above_s, state.confirmed, state.denied = 0.0, 0.0, 0, 0
        return
    reading, highest, asked = inputs.value[ACCUMULATOR_PRESSURE], 0.0, 0.0
    for i in range(4):
        if usable(inputs, CALLIPER_PRESSURE + i):
            highest = max(highest, inputs.value[CALLIPER_PRESSURE + i])
        asked = max(asked, state.asked[i] / BAR)
    state.above_s = state.above_s + dt if highest > reading + MARGIN else 0.0
    if state.above_s > DENIED_S:
        state.denied = 1
    elif (asked > MARGIN and highest < reading < asked) or (highest > MARGIN and reading > asked + MARGIN):
        state.denied = 0
    short = asked > reading + MARGIN and highest < reading + MARGIN and state.denied == 0
    state.short_s = state.short_s + dt if short else 0.0
    if state.short_s > CONFIRMED_S:
        state.confirmed = 1
    elif not short and (asked < reading or state.denied):
        state.confirmed = 0
    compare(witness, ACCUMULATOR_PRESSURE, min(reading - highest, 0.0), MARGIN)
    if state.denied or reads_empty(inputs):
        leave_out(witness, ACCUMULATOR_PRESSURE)


@kernel
def available_pressure(params: Record, state: Record, inputs: Record) -> float:
    """Return the highest pressure [Pa] available from the hydraulics: the accumulator's, where confirmed.

    A reading of an empty accumulator does not limit: if true, no pressure is lost; if the sensor errs, all
    would be.
    """
    available: float = params.max_pressure
    if state.confirmed and usable(inputs, ACCUMULATOR_PRESSURE) and not reads_empty(inputs):
        available = min(BAR * inputs.value[ACCUMULATOR_PRESSURE], available)
    return available


@kernel
def _nominal_pressure(params: Record, torque: float, corner: int) -> float:
    """Return the pressure [Pa] beyond push-out that makes a torque at nominal friction."""
    return min(torque / (brake_gain(params, corner) * params.mu_nominal[corner]), BEYOND_ANY)


@kernel
def _bound(
    params: Record, state: Record, corner: int, wanted: float, uncompensated: float, torque: float
) -> None:
    """Overwrite `state.share` and `state.asked`, the corner's demand by rules 1 and 2."""
    state.share[corner] = 0.0
    state.asked[corner] = wanted
    if not (math.isfinite(torque) and torque > 0.0):
        state.uncompensated[corner] = state.wanted[corner] = 0.0
        return
    nominal = _nominal_pressure(params, torque, corner)
    push_out = params.push_out_pressure[corner]
    if not (math.isfinite(uncompensated) and uncompensated >= 0.0):
        uncompensated = push_out + nominal
    demand_change = uncompensated - state.uncompensated[corner]
    wanted_change = wanted - state.wanted[corner]
    against = state.wanted[corner] > 0.0 and (
        (demand_change >= 0.0 and wanted_change < -AGAINST_DEMAND)
        or (demand_change <= 0.0 and wanted_change > AGAINST_DEMAND)
    )
    state.falls[corner] = demand_change < 0.0
    state.uncompensated[corner] = uncompensated
    if math.isfinite(wanted) and not against:
        state.wanted[corner] = pressure = wanted
    else:
        pressure = uncompensated
        state.limited = 1
    share = (pressure - push_out) / nominal
    state.share[corner] = min(max(share, LEAST_TORQUE), GREATEST_TORQUE)
    allowed = min(push_out + state.share[corner] * nominal, params.max_pressure)
    if abs(allowed - pressure) > 1.0:
        state.limited = 1


@kernel
def _level(params: Record, state: Record, left: int, torque: Record) -> None:
    """Move the shares of an axle towards each other until they meet rule 3."""
    right = left + 1
    if state.share[left] == 0.0 or state.share[right] == 0.0:
        return
    apart = state.share[left] - state.share[right]
    excess = math.copysign(max(abs(apart) - LEFT_RIGHT_SHARE, 0.0), apart)
    if excess == 0.0:
        return
    state.limited = 1
    both = torque[left] + torque[right]
    for i, other, high in ((left, right, excess), (right, left, -excess)):
        down = high * (torque[other] / both)
        state.share[i] -= down
        state.asked[i] -= down * _nominal_pressure(params, torque[i], i)


@kernel
def _approach(params: Record, state: Record, corner: int, torque: float, dt: float) -> None:
    """Overwrite `state.pressure` by rules 4 and 5."""
    if state.share[corner] == 0.0:
        state.pressure[corner] = 0.0
        return
    ceiling = state.ceiling[corner]
    if not 0.0 <= ceiling <= params.max_pressure:
        ceiling = params.max_pressure
    nominal, push_out = _nominal_pressure(params, torque, corner), params.push_out_pressure[corner]
    high = min(push_out + GREATEST_TORQUE * nominal, ceiling)
    bounded = min(push_out + state.share[corner] * nominal, ceiling)
    last = state.pressure[corner]
    if not 0.0 <= last <= params.max_pressure:
        last = 0.0
    step = params.max_pressure_rate * dt if 0.0 < dt < 1.0 else 0.0
    if bounded > last + step:
        bounded = last + step
    elif bounded < last - step and not state.falls[corner]:
        bounded = min(last - step, high)
    state.pressure[corner] = bounded


@kernel
def limit_axle(
    params: Record,
    state: Record,
    left: int,
    wanted: Record,
    uncompensated: Record,
    torque: Record,
    dt: float,
) -> None:
    """Overwrite `state.pressure` of an axle, the pressures to send [Pa]; all arguments may be NaN.

    Args:
        params: `PARAMS`.
        state: `LIMITER_STATE`, overwritten except `ceiling`; an invalid ceiling counts as `max_pressure`.
        left: the axle's left corner, 0 or 2.
        wanted: compensated pressures [Pa], shape (4,).
        uncompensated: pressures by the base friction [Pa], shape (4,).
        torque: friction torques demanded of the corners [N m], shape (4,).
        dt: time since the last cycle [s].
    """
    for i in (left, left + 1):
        _bound(params, state, i, wanted[i], uncompensated[i], torque[i])
    _level(params, state, left, torque)
    for i in (left, left + 1):
        _approach(params, state, i, torque[i], dt)
