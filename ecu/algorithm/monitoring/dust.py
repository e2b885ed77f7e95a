"""Particle emission of the brakes per application, by the emission models of CONFIG.

While the car moves and brakes, means are taken of what the models want (8.2). At the end of an application
each corner's model gives its emission factor, and

    particles = sum over corners of factor 10^EF

with the interval of each corner's model; the ends add up too, as if all erred together. Nothing is told of an
application in which a corner did more than `LEAST_WORK` outside what its model was trained on, and the sum is
without it. Axles without a model are not in it.

Kept for life, with the version of the models that counted it: particles, way, the work of all applications
and that of those that were told. Other models begin anew: their sum would be another quantity. Per kilometre
is told while no more than `UNTOLD` of the work was outside.

Mass is `airborne_share` of what the linings lost (`wear.py`), up to 10 um; the discs' own is not in it.

Source: sections 8.1, 8.4; equation 8.4. Assumption: all constants below.
"""

import math

import numpy as np

from ecu.algorithm.inputs import usable
from ecu.algorithm.monitoring.emission_factor import (
    DURATION,
    N_FEATURES,
    PRESSURE,
    TEMPERATURE,
    TORQUE,
    V_END,
    V_IN,
    emission_factor,
    inside,
)
from ecu.contract.dust import NONE
from ecu.contract.params import BAR
from ecu.contract.signals import CALLIPER_PRESSURE
from ecu.jit import Record, kernel

MOVING = 0.5  # m/s: a disc that stands emits nothing
LEAST_WORK = 500.0  # J: less is only felt
UNTOLD = 0.10  # share of the work
LEAST_WAY = 1e3  # m, before anything is told per kilometre
LEAST_WEAR_WAY = 50e3  # m with these linings, before mass is told per kilometre

DUST_STATE = np.dtype(
    [
        ("features", "f8", (4, N_FEATURES)),  # sums while an application lasts, means after it
        ("work", "f8", (4,)),  # J, in this application
        ("particles", "f8"),  # of the last application; NaN: not told
        ("low", "f8"),
        ("high", "f8"),
        ("per_km", "f8"),
        ("mass_per_km", "f8"),  # mg
    ],
    align=True,
)


@kernel
def restore_dust(params: Record, state: Record, learned: Record, wear: Record) -> None:
    """Begin with what is kept, or anew where other models counted it."""
    dust = learned.dust
    if dust.version != params.dust_version:
        dust.version = params.dust_version
        dust.particles = dust.way = dust.work = dust.told_work = 0.0
        dust.applications = 0
    _clear(state)
    state.particles = state.low = state.high = math.nan
    _renew(params, state, learned, wear)


@kernel
def _clear(state: Record) -> None:
    for i in range(4):
        state.work[i] = 0.0
        for k in range(N_FEATURES):
            state.features[i, k] = 0.0


@kernel
def update_dust(
    params: Record,
    state: Record,
    learned: Record,
    inputs: Record,
    estimate: Record,
    discs: Record,
    wear: Record,
    application: Record,
    dt: float,
) -> None:
    """Take in a cycle of `dt` [s]; at the end of an application, count what it emitted."""
    speed = estimate.speed
    learned.dust.way += abs(speed) * dt
    if application.started:
        _clear(state)
    if application.braking and speed > MOVING:
        for i in range(4):
            x = state.features[i]
            if x[DURATION] <= 0.0:
                x[V_IN] = speed
            x[V_END] = speed
            x[DURATION] += dt
            x[TORQUE] += estimate.brake_torque[i] * dt
            x[TEMPERATURE] += discs.temperature[i] * dt
            place = CALLIPER_PRESSURE + i
            pressure = inputs.value[place] - params.push_out_pressure[i] / BAR
            x[PRESSURE] += pressure * dt if usable(inputs, place) else math.nan
            state.work[i] += discs.power[i] * dt
    if application.ended:
        _count(params, state, learned.dust)
        _renew(params, state, learned, wear)


@kernel
def _count(params: Record, state: Record, dust: Record) -> None:
    particles, low, high, work, told = 0.0, 0.0, 0.0, 0.0, True
    for i in range(4):
        x = state.features[i]
        if params.dust_model[i] == NONE or x[DURATION] <= 0.0 or not state.work[i] > LEAST_WORK:
            continue
        for k in range(TORQUE, N_FEATURES):
            if k != DURATION:
                x[k] /= x[DURATION]
        work += state.work[i]
        if not inside(params.dust_low[i], params.dust_high[i], x):
            told = False
            continue
        ef = emission_factor(params.dust_model[i], params.dust_numbers[i], x)
        particles += params.dust_factor[i] * 10.0**ef
        low += 10.0 ** (ef + params.dust_below[i])
        high += 10.0 ** (ef + params.dust_above[i])
    state.particles = state.low = state.high = math.nan
    dust.work += work
    if told and work > 0.0:
        state.particles, state.low, state.high = particles, low, high
        dust.particles += particles
        dust.told_work += work
        dust.applications += 1


@kernel
def _renew(params: Record, state: Record, learned: Record, wear: Record) -> None:
    """Overwrite what is told per kilometre; `wear` is `WEAR_STATE`."""
    dust, state.per_km, state.mass_per_km = learned.dust, math.nan, 0.0
    if dust.way >= LEAST_WAY and dust.told_work > 0.0 and dust.told_work >= (1.0 - UNTOLD) * dust.work:
        state.per_km = 1e3 * dust.particles / dust.way
    for i in range(4):
        way = learned.wear.odometer - learned.wear.fitted_at[i]
        grams = params.airborne_share[i] * wear.mass[i]
        state.mass_per_km += 1e6 * grams / way if way >= LEAST_WEAR_WAY else math.nan
