"""Estimates of Observers 1 and 2: the records of the single wheels turned into `ESTIMATE`."""

import math

from ecu.jit import Record, kernel


@kernel
def tell_friction(state: Record, estimate: Record) -> None:
    """Overwrite friction, its standard deviation and mode by these observers' states."""
    for i in range(4):
        estimate.mu[i], estimate.sigma[i], estimate.mode[i] = state.mu[i], state.sigma[i], state.mode[i]
        estimate.observed_s[i] = state.observed_s[i]


@kernel
def tell_wheels(
    params: Record, state: Record, estimate: Record, speed: Record, wheels: Record, force: Record
) -> None:
    """Overwrite the estimate of car, tyres and linings by Observer 1 or 2.

    Args:
        params: `PARAMS`.
        state: `FRICTION_STATE`.
        estimate: `ESTIMATE`.
        speed: `SPEED_STATE`.
        wheels: `WHEELS_STATE`.
        force: `FORCE_STATE`.
    """
    estimate.started, estimate.reset, estimate.speed = speed.started, state.reset, speed.speed
    estimate.k_f, estimate.mass, estimate.sigma_force = force.k_f, params.mass, math.nan
    estimate.test_ratio_balance = estimate.test_ratio_speed = math.nan
    tell_friction(state, estimate)
    for i in range(4):
        estimate.slip[i], estimate.force[i] = wheels.slip[i], force.virtual[i]
        estimate.test_ratio[i] = math.nan
