"""States of the joint observer that are stored between drives.

Stored are the states that outlive a drive, with their full covariance, so that states correlated for lack of
observability stay so after a restart. States that may have changed meanwhile (load, tyres, weather) become
less certain; the peak belongs to the road and is not stored."""

import math

import numpy as np

from ecu.algorithm.estimate import GREATEST_RATIO, LEAST_RATIO
from ecu.algorithm.estimation.joint.estimates import sigma_friction
from ecu.algorithm.estimation.joint.kalman import clear_state
from ecu.algorithm.estimation.joint.layout import (
    BIAS,
    DELAY,
    DRAG,
    LEVEL,
    MASS,
    MEAN,
    PASSING,
    PEAK,
    RADIUS,
    ROLLING,
    STIFFNESS,
    N,
)
from ecu.algorithm.estimation.joint.observer import start_joint
from ecu.algorithm.estimation.joint.prior import limit_variance, set_prior, widen_levels
from ecu.jit import Record, kernel

KEPT = np.array([i for i in range(N) if i not in PASSING])

# Standard deviations added for a pause of unknown length.
PAUSE = np.zeros(N)
PAUSE[STIFFNESS] = 0.05
PAUSE[RADIUS : RADIUS + 4] = PAUSE[ROLLING] = 0.0003
PAUSE[BIAS], PAUSE[MASS], PAUSE[DRAG] = 0.005, 0.005, 0.02
PAUSE[DELAY] = 0.001
LEVEL_PAUSE = 0.03  # common to all levels


@kernel
def restore_joint(params: Record, state: Record, learned: Record) -> None:
    """Restore learned states; use the prior where nothing was learned."""
    set_prior(params, state)
    x, p = state.x, state.p
    if learned.joint_known:
        prior = np.diag(p).copy()
        peak = prior[PEAK]
        place = 0
        for k in range(len(KEPT)):
            i = KEPT[k]
            x[i] = learned.joint[i]
            for m in range(k + 1):
                p[i, KEPT[m]] = p[KEPT[m], i] = learned.joint_covariance[place]
                place += 1
            p[i, i] += PAUSE[i] ** 2
        widen_levels(state, LEVEL_PAUSE**2, 0.0, 0.0)
        for i in KEPT:
            limit_variance(state, i, prior[i])
        clear_state(state, PEAK, peak)
    start_joint(state)


@kernel
def keep_joint(params: Record, state: Record, learned: Record) -> None:
    """Write the present states into `learned`."""
    learned.joint_known, state.unkept_s = 1, 0.0
    place = 0
    for k in range(len(KEPT)):
        i = KEPT[k]
        learned.joint[i] = state.x[i]
        if LEVEL <= i < LEVEL + 4:
            level = state.x[i] + state.x[MEAN + (i - LEVEL) // 2]  # as observed in this application so far
            learned.joint[i] = min(max(level, math.log(LEAST_RATIO)), math.log(GREATEST_RATIO))
        for m in range(k + 1):
            learned.joint_covariance[place] = state.p[i, KEPT[m]]
            place += 1
    for i in range(4):
        mu = params.mu_nominal[i] * math.exp(learned.joint[LEVEL + i])
        sigma = sigma_friction(params, state, i, math.exp(state.x[LEVEL + i]), False)
        learned.mu_b[i], learned.sigma_mu_b[i] = mu, mu * sigma


@kernel
def hand_over_level(estimate: Record, learned: Record) -> None:
    """At the end of a brake application: count the time it was observed for."""
    learned.brakings += 1
    for i in range(4):
        learned.observed_s[i] += estimate.observed_s[i]
        estimate.observed_s[i] = 0.0
