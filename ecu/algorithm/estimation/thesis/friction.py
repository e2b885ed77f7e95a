"""Friction between and during brake applications: observing, holding and handing over (4.4, 4.13).

A corner observes while its pressure acts, the car is fast enough (15 km/h) and decelerates enough for its
axle, the wheel stays in the tyre's linear range and every signal it needs is usable. It holds the last
estimate otherwise, always while `abs_active` or `esp_active` is set, while the driver accelerates or motors
drive against the brakes, and in reverse.

The friction of one application becomes the base of the next compensation only if it was observed for a second
or more with a standard deviation below 10 % (`learned`). Friction stays within 0.5–1.5 of nominal.

The last moments of observing are unreliable: pressure, slip and force fall with different lags when the
brakes are released, and a wheel beyond the linear range was assigned a wrong force. The estimate is restored
from a snapshot 0.2 to 0.4 s old, at all corners when a wheel left the range.
"""

import math

import numpy as np

from ecu.algorithm.estimate import GREATEST_RATIO, LEAST_RATIO, well_observed
from ecu.algorithm.estimation.friction import drives_against, resting_mode
from ecu.algorithm.estimation.thesis.observer2 import (
    correct_force,
    correct_omega,
    observer_sound,
    predict_observer,
    process_noise,
    start_observer,
)
from ecu.algorithm.estimation.thesis.tyre import slip_stiffness
from ecu.algorithm.inputs import (
    driver_accelerates,
    motor_torque,
    motor_torque_known,
    others_brake,
    requested_decel,
    usable,
)
from ecu.contract.signals import (
    ACCEL_X,
    CALLIPER_PRESSURE,
    HOLDING,
    NOMINAL,
    OBSERVING,
    REVERSE,
    WHEEL_SPEED,
)
from ecu.jit import Record, kernel

FRICTION_STATE = np.dtype(
    [
        ("mu", "f8", (4,)),
        ("sigma", "f8", (4,)),
        ("mode", "i8", (4,)),
        ("active", "u1", (4,)),
        ("settled_s", "f8", (4,)),  # time that the conditions have held [s]
        ("observed_s", "f8", (4,)),  # in this application [s]
        ("pressure", "f8", (4,)),  # above push-out, low-passed [Pa]
        ("torque", "f8", (4,)),  # brake torque [N m]
        ("kept_mu", "f8", (2, 4)),  # snapshots: the newer in row 0
        ("kept_sigma", "f8", (2, 4)),
        ("kept_s", "f8"),  # age of the newer one [s]
        ("held", "u1"),  # a signal has become implausible, or a pressure is: the last snapshot is restored
        ("slipping", "u1"),  # a wheel has left the linear range
        ("reset", "u1"),  # a filter met a value that is not finite
    ],
    align=True,
)

LINEAR_SLIP = 0.10  # beyond, the linear tyre model does not hold
POSITIVE_SLIP = 0.005  # excess of a braked wheel that seems to drive: slip is too uncertain
MIN_PRESSURE = 3e5  # Pa above push-out
RESIDUAL_LIMIT = 0.3  # relative: K_f varies this strongly where slip is too small to be measured (4.4)
SNAPSHOT = 0.2  # s between snapshots
SETTLE = 0.15  # s: at the start of an application load, pressure and slip lag differently
FORGET_WITHIN = 0.8  # a condition to continue is this share of the condition to start
TYRE_CURVE = 1.0  # relative error of the linear tyre per slip: 5 % at 5 % of slip
SLIP_FLOOR = 0.0004  # slip error that does not average out: radius, speed
TRANSDUCER_NOISE = 10.0  # N, of a wheel force transducer (Table 4.1)
HELD_GROWTH = 0.002  # growth of sigma while holding, 1/sqrt(s)


@kernel
def restore_friction(params: Record, state: Record, learned: Record) -> None:
    """Start with the learned friction, or with the nominal one where nothing was learned."""
    for i in range(4):
        if learned.observed_s[i] > 0.0:
            state.mu[i], state.sigma[i], state.mode[i] = learned.mu_b[i], learned.sigma_mu_b[i], HOLDING
        else:
            learned.mu_b[i] = params.mu_nominal[i]
            learned.sigma_mu_b[i] = params.sigma_mu_initial * params.mu_nominal[i]
            state.mu[i], state.sigma[i], state.mode[i] = learned.mu_b[i], learned.sigma_mu_b[i], NOMINAL


@kernel
def _keep(state: Record, row: int) -> None:
    for i in range(4):
        state.kept_mu[row, i], state.kept_sigma[row, i] = state.mu[i], state.sigma[i]


@kernel
def _guard_slip(state: Record, wheels: Record, application: Record, dt: float) -> None:
    """Save snapshots while slip is linear; restore the older one when a wheel leaves the range."""
    slipping = False
    for i in range(4):
        slipping = slipping or abs(wheels.slip[i]) > LINEAR_SLIP
    if slipping and not state.slipping and application.braking:
        for i in range(4):
            state.mu[i], state.sigma[i] = state.kept_mu[1, i], state.kept_sigma[1, i]
            state.observed_s[i] = max(state.observed_s[i] - 2.0 * SNAPSHOT, 0.0)
    state.slipping = 1 if slipping else 0
    state.kept_s += dt
    if application.started or not application.braking:
        _keep(state, 0)
        _keep(state, 1)
        state.kept_s = 0.0
    elif not slipping and state.kept_s >= SNAPSHOT:
        for i in range(4):
            state.kept_mu[1, i], state.kept_sigma[1, i] = state.kept_mu[0, i], state.kept_sigma[0, i]
        _keep(state, 0)
        state.kept_s = 0.0


@kernel
def _inputs_usable(inputs: Record, i: int) -> bool:
    wheel = usable(inputs, WHEEL_SPEED + i) and usable(inputs, CALLIPER_PRESSURE + i)
    return wheel and usable(inputs, ACCEL_X) and motor_torque_known(inputs, i)


@kernel
def _hold_all(inputs: Record, torque: Record) -> bool:
    motors, brakes = 0.0, 0.0
    for i in range(4):
        motors += motor_torque(inputs, i)
        brakes += torque[i]
    return (
        others_brake(inputs)
        or inputs.value[REVERSE] > 0.5
        or driver_accelerates(inputs)
        or drives_against(motors, brakes)
    )


@kernel
def update_friction(
    params: Record,
    state: Record,
    observer: Record,
    learned: Record,
    inputs: Record,
    motion: Record,
    wheels: Record,
    load: Record,
    force: Record,
    speed: Record,
    application: Record,
    dt: float,
) -> None:
    """Overwrite friction, its standard deviation and mode of every corner."""
    _guard_slip(state, wheels, application, dt)
    hold_all = _hold_all(inputs, state.torque) or state.slipping != 0 or state.held != 0
    state.reset = 0
    asked = requested_decel(params, inputs)
    noise = process_noise(asked if math.isfinite(asked) else -motion.accel_x, speed.speed)
    for i in range(4):
        above = state.pressure[i]
        scale = FORGET_WITHIN if state.active[i] else 1.0
        fit = (
            application.braking != 0
            and speed.started != 0
            and not hold_all
            and above > scale * MIN_PRESSURE
            and speed.speed > params.min_speed
            and (force.measured[i] != 0 or force.residual < RESIDUAL_LIMIT**2)
            and -motion.accel_x > scale * params.activation_decel[i]
            and wheels.slip[i] < POSITIVE_SLIP
        )
        good = _inputs_usable(inputs, i)
        state.settled_s[i] = state.settled_s[i] + dt if fit and good else 0.0
        if state.settled_s[i] < SETTLE:
            if state.active[i]:
                state.active[i] = 0
                state.mu[i], state.sigma[i] = state.kept_mu[1, i], state.kept_sigma[1, i]
        elif not state.active[i]:
            state.active[i] = 1
            start = (
                state.mu[i]
                if application.duration_s > SETTLE and state.observed_s[i] > 0.0
                else learned.mu_b[i]
            )
            sigma = max(state.sigma[i], 0.5 * params.sigma_mu_initial * params.mu_nominal[i])
            start_observer(observer, i, inputs.value[WHEEL_SPEED + i], force.virtual[i], start, sigma)
        if state.active[i]:
            _observe(params, state, observer, inputs, wheels, load, force, speed, noise, i, dt)
            state.mode[i] = OBSERVING
            state.observed_s[i] += dt
        else:
            state.mode[i] = resting_mode(params, state, learned, good, i)
        if not state.active[i]:
            ceiling = params.sigma_mu_initial * params.mu_nominal[i]
            grown = math.sqrt(state.sigma[i] ** 2 + (HELD_GROWTH * params.mu_nominal[i]) ** 2 * dt)
            state.sigma[i] = max(state.sigma[i], min(grown, ceiling))


@kernel
def _systematic(params: Record, wheels: Record, speed: Record, i: int) -> float:
    """Return the relative variance of friction that does not average out.

    Contributions: mass; front to rear stiffness; zero error of each slip; curvature of the tyre; and an error
    of speed, which shifts all slips alike: K_f absorbs its mean, the rest affects wheels that slip less than
    the mean.
    """
    mean = 0.0
    for j in range(4):
        mean += 0.25 * max(abs(wheels.expected_slip[j]), SLIP_FLOOR)
    own = max(abs(wheels.expected_slip[i]), SLIP_FLOOR)
    zero = SLIP_FLOOR / own
    shift = math.sqrt(speed.p_vv) / max(speed.speed, 1.0) * abs(1.0 / own - 1.0 / mean)
    curve = TYRE_CURVE * own
    constant = params.sigma_mass**2 + params.sigma_slip_stiffness_ratio**2
    return constant + zero**2 + shift**2 + curve**2


@kernel
def _observe(
    params: Record,
    state: Record,
    observer: Record,
    inputs: Record,
    wheels: Record,
    load: Record,
    force: Record,
    speed: Record,
    noise: float,
    i: int,
    dt: float,
) -> None:
    radius = wheels.radius[i]
    rolling = params.rolling_resistance * load[i] * radius
    outer = motor_torque(inputs, i) + rolling
    stiffness = force.k_f * force.stiffness * slip_stiffness(params, i, load[i], wheels.expected_force[i])
    slip_noise = params.sigma_wheel_speed * radius / max(speed.speed, 1.0)
    variance = TRANSDUCER_NOISE**2 if force.measured[i] else (stiffness * slip_noise) ** 2
    predict_observer(
        params, observer, i, max(state.pressure[i], 0.0), outer, force.virtual[i], variance, radius,
        load[i], speed.speed, params.mu_drift, noise, dt,
    )  # fmt: skip
    if wheels.fresh[i]:
        correct_omega(observer, i, inputs.value[WHEEL_SPEED + i], params.sigma_wheel_speed**2)
        correct_force(observer, i, force.virtual[i], params.time_correlation * variance)
    if not observer_sound(observer, i):
        start_observer(
            observer, i, inputs.value[WHEEL_SPEED + i], force.virtual[i], params.mu_nominal[i], 0.07
        )
        state.reset = 1
    least, greatest = LEAST_RATIO * params.mu_nominal[i], GREATEST_RATIO * params.mu_nominal[i]
    observer.mu[i] = min(max(observer.mu[i], least), greatest)
    mu = observer.mu[i]
    state.mu[i] = mu
    state.sigma[i] = math.sqrt(observer.p[i, 5] + mu * mu * _systematic(params, wheels, speed, i))
    if mu in (least, greatest):
        state.sigma[i] = max(state.sigma[i], params.sigma_mu_initial * params.mu_nominal[i])


@kernel
def hand_over(state: Record, learned: Record) -> None:
    """At the end of a brake application: store well observed friction as the base of the next."""
    learned.brakings += 1
    for i in range(4):
        if well_observed(state, i):
            learned.mu_b[i] = state.mu[i]
            learned.sigma_mu_b[i] = state.sigma[i]
            learned.observed_s[i] += state.observed_s[i]
        else:
            state.mu[i] = learned.mu_b[i]
            state.sigma[i] = learned.sigma_mu_b[i]
        state.observed_s[i] = 0.0
        state.settled_s[i] = 0.0
        state.active[i] = 0
