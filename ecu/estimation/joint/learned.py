"""What the joint observer gives to the rest of the ECU, and what it keeps between drives.

Kept are the states but speed, slope and rate, with their standard deviations; of the correlations only the
one that physics gives back: an error of mass is in every friction alike. What may have changed in between
(load, tyres, weather) is less sure after a restart."""

import math

import numpy as np

from ecu.estimation.friction import GREATEST_RATIO, LEAST_RATIO, resting_mode, well_observed
from ecu.estimation.joint.kalman import forget
from ecu.estimation.joint.layout import (
    BIAS,
    DELAY,
    DRAG,
    MASS,
    MU,
    OFFSET,
    PEAK,
    RADIUS,
    RATE,
    ROLLING,
    SLOPE,
    STIFFNESS,
    N,
    V,
)
from ecu.estimation.joint.observer import WINDOW_S, start_joint
from ecu.estimation.joint.pressure import follows
from ecu.estimation.joint.prior import set_prior
from ecu.estimation.motion import usable
from ecu.jit import Record, kernel
from ecu.signals import CALLIPER_PRESSURE, OBSERVING, WHEEL_SPEED

# Standard deviations that a pause of unknown length adds.
PAUSE = np.zeros(N)
PAUSE[STIFFNESS], PAUSE[PEAK] = 0.05, 0.10
PAUSE[RADIUS : RADIUS + 4] = PAUSE[ROLLING] = 0.0003
PAUSE[BIAS], PAUSE[MASS], PAUSE[DRAG] = 0.005, 0.005, 0.02
PAUSE[DELAY] = 0.001
MU_PAUSE = 0.03
SPREAD = 1.0 / 3.0  # variance of an even change over the square of its end
TRANSFER_ERROR = 0.06  # of a load's change over the load at rest, as error of friction


@kernel
def restore_joint(params: Record, state: Record, learned: Record) -> None:
    """Begin with what was learned; with the prior where nothing was."""
    set_prior(params, state)
    x, p = state.x, state.p
    if learned.joint_sigma[MASS] > 0.0:
        for i in range(N):
            if i in (V, SLOPE, RATE) or MU <= i < MU + 4 or OFFSET <= i < OFFSET + 2:
                continue
            x[i] = learned.joint[i]
            p[i, i] = min(learned.joint_sigma[i] ** 2 + PAUSE[i] ** 2, p[i, i])
    for i in range(4):
        if learned.observed_s[i] <= 0.0:
            continue
        x[MU + i] = math.log(learned.mu_b[i] / params.mu_nominal[i])
        relative = learned.sigma_mu_b[i] / learned.mu_b[i]
        p[MU + i, MU + i] = min(relative * relative + MU_PAUSE**2, p[MU + i, MU + i])
        p[MU + i, MASS] = p[MASS, MU + i] = min(p[MASS, MASS], 0.8 * relative * relative)
    for i in range(4):
        for j in range(4):
            both = learned.observed_s[i] > 0.0 and learned.observed_s[j] > 0.0
            if both and i != j:  # what both owe to the mass
                p[MU + i, MU + j] = p[MU + i, MASS] * p[MU + j, MASS] / p[MASS, MASS]
            elif (learned.observed_s[i] > 0.0) != (learned.observed_s[j] > 0.0):
                p[MU + i, MU + j] = 0.0
    start_joint(state)


@kernel
def keep_joint(state: Record, learned: Record) -> None:
    """Write what is known now into `learned`."""
    for i in range(N):
        if i in (V, SLOPE, RATE):
            continue
        learned.joint[i] = state.x[i]
        learned.joint_sigma[i] = math.sqrt(max(state.p[i, i], 0.0))


@kernel
def _at_bound(ratio: float) -> bool:
    return ratio < 1.001 * LEAST_RATIO or ratio > 0.999 * GREATEST_RATIO


@kernel
def begin_course(state: Record) -> None:
    """Begin to note the friction of a braking."""
    for i in range(4):
        state.way[i] = state.course[i] = 0.0


@kernel
def take_mean(params: Record, state: Record, friction: Record) -> None:
    """At the end of a braking let friction be its mean over the distance.

    Friction changes within a braking as the pads heat and comes back until the next: its mean says more of
    that one than its last value. How far it went stays in its variance. An estimate that is not sure stays:
    its errors balance those of the other wheels.
    """
    for i in range(4):
        if not well_observed(friction, i):
            return
    for i in range(4):
        mean = state.course[i] / state.way[i]
        change = math.log(friction.mu[i] / mean)
        state.x[MU + i] = math.log(mean / params.mu_nominal[i])
        state.p[MU + i, MU + i] += SPREAD * change * change
        friction.sigma[i] *= mean / friction.mu[i]
        friction.mu[i] = mean


@kernel
def settle_friction(params: Record, state: Record, learned: Record) -> None:
    """Let friction that a braking left at its bound go back, of all wheels, to what is the base of the next.

    An estimate that is only unsure stays: its errors balance those of the other axle.
    """
    credible = True
    for i in range(MU, MU + 4):
        credible = credible and not _at_bound(math.exp(state.x[i]))
    if credible:
        return
    for i in range(4):
        state.x[MU + i] = math.log(learned.mu_b[i] / params.mu_nominal[i])
        forget(state, MU + i, (learned.sigma_mu_b[i] / learned.mu_b[i]) ** 2 + MU_PAUSE**2)


@kernel
def friction_now(state: Record, i: int) -> float:
    """Return ln of friction over nominal: what the middle of the last window had, moved on by its rate."""
    moved: float = state.x[MU + i] + state.x[RATE] * (0.5 * WINDOW_S + state.window.time)
    return moved


@kernel
def _systematic(params: Record, state: Record, load: Record, i: int) -> float:
    """Return the variance of ln friction that does not average out.

    Load transfer is known to a few per cent; what sets left against right may be the road's as well.
    """
    transfer = TRANSFER_ERROR * (load[i] / params.static_load[i] - 1.0)
    side = 0.5 * (state.x[MU + i] - state.x[MU + (i ^ 1)])
    total: float = transfer * transfer + side * side
    return total


@kernel
def publish_friction(
    params: Record,
    state: Record,
    friction: Record,
    learned: Record,
    inputs: Record,
    load: Record,
    braking: bool,
    dt: float,
) -> None:
    """Overwrite friction, its standard deviation and mode of every corner from the joint observer."""
    friction.reset = state.reset
    for i in range(4):
        nominal = params.mu_nominal[i]
        ratio = math.exp(friction_now(state, i))
        mu = nominal * ratio
        variance = state.p[MU + i, MU + i] + _systematic(params, state, load, i)
        if state.observed[i] and follows(state.pressures, i):
            above = max(state.smooth_pressure[i], 1.0)
            variance += state.pressures.variance[i] / (above * above)
        if _at_bound(ratio):
            variance = max(variance, params.sigma_mu_initial**2)
        friction.mu[i], friction.sigma[i] = mu, mu * math.sqrt(variance)
        good = usable(inputs, WHEEL_SPEED + i) and usable(inputs, CALLIPER_PRESSURE + i)
        if braking and state.observed[i] and good:
            friction.observed_s[i] += dt
            state.way[i] += state.x[V] * dt
            state.course[i] += mu * state.x[V] * dt
            friction.mode[i] = OBSERVING
        else:
            friction.mode[i] = resting_mode(params, friction, learned, good, i)
