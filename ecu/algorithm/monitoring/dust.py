"""Particle emission of the brakes per application, by the emission models of CONFIG.

While the car moves and brakes, the models' features are averaged (8.2). At the end of an application
each corner's model gives its emission factor, and

    particles = sum over corners of factor 10^EF

with the interval of each corner's model; its ends are summed too, as for fully correlated errors. An
application in which a corner did more than `LEAST_WORK` outside its model's training range is not reported
and not summed. Axles without a model are excluded.

Stored permanently, with the version of the models: particles, distance, the work of all applications and of
the reported ones. Other models start from zero: their sum is a different quantity. Emission per kilometre is
reported while no more than `UNKNOWN_WORK` of the work was outside.

Mass is `airborne_share` of the linings' wear (`wear.py`), up to 10 um, without that of the discs.

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
from ecu.algorithm.monitoring.wear_belief import mass_by_law
from ecu.contract.dust import NONE
from ecu.contract.params import BAR
from ecu.contract.signals import CALLIPER_PRESSURE
from ecu.jit import Record, kernel

MOVING = 0.5  # m/s: a disc at standstill emits nothing
LEAST_WORK = 500.0  # J: below it an application counts as negligible
UNKNOWN_WORK = 0.10  # share of the work
LEAST_DISTANCE = 1e3  # m, before emission per kilometre is reported
LEAST_WEAR_DISTANCE = 50e3  # m with these linings, before mass per kilometre is reported

DUST_STATE = np.dtype(
    [
        ("features", "f8", (4, N_FEATURES)),  # sums while an application lasts, means after it
        ("work", "f8", (4,)),  # J, in this application
        ("particles", "f8"),  # of the last application; NaN: not reported
        ("low", "f8"),
        ("high", "f8"),
        ("per_km", "f8"),
        ("mass_per_km", "f8"),  # mg
    ],
    align=True,
)


@kernel
def restore_dust(params: Record, state: Record, learned: Record, wear: Record) -> None:
    """Restore the stored sums, or start from zero where other models counted them."""
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
    """Add a cycle of `dt` [s]; at the end of an application, add its emission."""
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
    particles, low, high, work, counted = 0.0, 0.0, 0.0, 0.0, True
    for i in range(4):
        x = state.features[i]
        if params.dust_model[i] == NONE or x[DURATION] <= 0.0 or not state.work[i] > LEAST_WORK:
            continue
        for k in range(TORQUE, N_FEATURES):
            if k != DURATION:
                x[k] /= x[DURATION]
        work += state.work[i]
        if not inside(params.dust_low[i], params.dust_high[i], x):
            counted = False
            continue
        ef = emission_factor(params.dust_model[i], params.dust_numbers[i], x)
        particles += params.dust_factor[i] * 10.0**ef
        low += 10.0 ** (ef + params.dust_below[i])
        high += 10.0 ** (ef + params.dust_above[i])
    state.particles = state.low = state.high = math.nan
    dust.work += work
    if counted and work > 0.0:
        state.particles, state.low, state.high = particles, low, high
        dust.particles += particles
        dust.told_work += work
        dust.applications += 1


@kernel
def _renew(params: Record, state: Record, learned: Record, wear: Record) -> None:
    """Overwrite the emission per kilometre; `wear` is `WEAR_STATE`."""
    dust, state.per_km, state.mass_per_km = learned.dust, math.nan, 0.0
    counted = dust.told_work > 0.0 and dust.told_work >= (1.0 - UNKNOWN_WORK) * dust.work
    if counted and dust.way >= LEAST_DISTANCE:
        state.per_km = 1e3 * dust.particles / dust.way
    for i in range(4):
        distance = learned.wear.odometer - learned.wear.fitted_at[i]
        worn = wear.belief.scale[i] * mass_by_law(params, learned.wear.regressors, i)
        grams = params.airborne_share[i] * worn
        state.mass_per_km += 1e6 * grams / distance if distance >= LEAST_WEAR_DISTANCE else math.nan
