"""Vehicle speed from accelerometer, wheels and, where there is one, a speed reference (4.26–4.32).

States   v [m/s], b [m/s^2]: offset of the accelerometer from dv/dt (bias and road grade together)
Model    dv/dt = a_x - b + psi_dot v_y (corrected 4.27: grade, not banking), b a random walk
Inputs   a_x in road axes; wheels omega_i; vehicle_speed with its delay

The thesis's pair (a, v) with the acceleration measured is this filter with the measured acceleration as its
input. Corrected 4.31: v_k+1 = v_k + dt a_k. The thesis equates vehicle speed with four braked wheels, which
drives slip to zero: here each wheel's expected slip is removed first, and its variance grows with that slip.
An error of expected slip lasts as long as the braking, so its variance is multiplied by the number of samples
that share it. A wheel that slides or spins is excluded; with all four locked the accelerometer alone gives
the speed. In reverse the wheel speeds are used without correction.
"""

import math

import numpy as np

from ecu.algorithm.estimation.motion import speed_backwards
from ecu.algorithm.inputs import fresh, usable
from ecu.algorithm.vehicle import corner_speed
from ecu.contract.signals import ACCEL_X, VEHICLE_SPEED, VEHICLE_SPEED_VALID, WHEEL_SPEED
from ecu.jit import Record, kernel

SPEED_STATE = np.dtype(
    [
        ("speed", "f8"),
        ("bias", "f8"),
        ("p_vv", "f8"),
        ("p_vb", "f8"),
        ("p_bb", "f8"),
        ("started", "u1"),
        ("untrusted_s", "f8"),  # time since a wheel was last trusted [s]
        ("reference_s", "f8"),  # time since the speed reference was last used [s]
    ],
    align=True,
)

BIAS_START = 0.3  # standard deviation of bias and grade at the start [m/s^2]
BIAS_DRIFT = 0.02  # random walk of bias and grade while driving [m/s^2/sqrt(s)]
BIAS_DRIFT_BRAKING = 0.005
SPEED_WALK = 0.02  # errors of pitch correction and lateral terms, random walk of v [m/s/sqrt(s)]
TORQUE_ACCEL = 1.0  # error of an acceleration taken from the torques [m/s^2]
SLIP_UNCERTAINTY = 0.3  # of the expected slip, relative (stiffness, load, road)
SHARED_SAMPLES = 800.0  # samples of all wheels that share one error of expected slip
RADIUS_SAMPLES = 100.0  # samples that share one error of a radius
SLIDING = 0.10  # relative difference from vehicle speed at which a wheel slides or spins
SLIDING_FLOOR = 5.0  # m/s, least reference speed of SLIDING
SLIDING_DECEL = 0.3  # m/s^2, least deceleration of a braked car that slides
BELIEVED_AFTER = 3.0  # s without a trusted wheel, brakes released: then the estimate is wrong
GATE = 5.0  # innovations beyond this many standard deviations are clipped


@kernel
def _correct(state: Record, innovation: float, variance: float) -> None:
    total = state.p_vv + variance
    limit = GATE * math.sqrt(total)
    innovation = min(max(innovation, -limit), limit)
    gain_v, gain_b = state.p_vv / total, state.p_vb / total
    state.speed += gain_v * innovation
    state.bias += gain_b * innovation
    state.p_bb -= gain_b * state.p_vb
    state.p_vb -= gain_v * state.p_vb
    state.p_vv -= gain_v * state.p_vv


@kernel
def update_speed(
    params: Record,
    state: Record,
    motion: Record,
    wheels: Record,
    learned: Record,
    inputs: Record,
    braking: bool,
    dt: float,
) -> None:
    """Overwrite speed and bias. `wheels` gives radius [m] and expected slip of each wheel (see `slip.py`)."""
    value = inputs.value
    if not state.started:
        for i in range(4):
            if not usable(inputs, WHEEL_SPEED + i):
                return
        total = 0.0
        for i in range(4):
            total += value[WHEEL_SPEED + i] * params.wheel_radius[i]
        state.speed, state.bias = 0.25 * total, 0.0
        state.p_vv, state.p_vb, state.p_bb = 0.25, 0.0, BIAS_START**2
        state.started = 1
        state.reference_s = 1e3

    if motion.backwards:
        state.speed = speed_backwards(params, inputs, motion, state.speed, dt)
        state.p_vv, state.p_vb = 0.25, 0.0
        return
    accel = motion.accel_x + motion.yaw_rate * motion.lateral_speed
    noise = params.sigma_accel**2
    if not usable(inputs, ACCEL_X):
        # The torques replace the sensor; the bias is kept for its return.
        noise, state.p_vb = TORQUE_ACCEL**2, 0.0
    drift = BIAS_DRIFT_BRAKING if braking else BIAS_DRIFT
    state.speed += dt * (accel - state.bias)
    state.p_vv += dt * (dt * (state.p_bb + noise) - 2.0 * state.p_vb + SPEED_WALK**2)
    if usable(inputs, ACCEL_X):
        state.p_vb -= dt * state.p_bb
    state.p_bb += drift**2 * dt

    state.reference_s += dt
    if fresh(inputs, VEHICLE_SPEED) and (
        value[VEHICLE_SPEED_VALID] > 0.5 or not params.mapped[VEHICLE_SPEED_VALID]
    ):
        delay = params.vehicle_speed_delay + 1e-9 * inputs.age_ns[VEHICLE_SPEED]
        innovation = value[VEHICLE_SPEED] - (state.speed - delay * (accel - state.bias))
        _correct(state, innovation, params.sigma_vehicle_speed**2)
        state.reference_s = 0.0

    state.untrusted_s += dt
    hard = braking and abs(accel - state.bias) > SLIDING_DECEL
    for i in range(4):
        if not fresh(inputs, WHEEL_SPEED + i):
            continue
        omega, radius, slip = value[WHEEL_SPEED + i], wheels.radius[i], wheels.expected_slip[i]
        age = 1e-9 * inputs.age_ns[WHEEL_SPEED + i]
        predicted = corner_speed(params, motion, state.speed - age * (accel - state.bias), i)
        rolled = omega * radius / max(1.0 + slip, 0.3) if slip < 0.0 else omega * radius * (1.0 - slip)
        mismatch = abs(rolled - predicted) / max(state.speed, SLIDING_FLOOR)
        if mismatch > SLIDING and (hard or state.untrusted_s < BELIEVED_AFTER):
            continue
        state.untrusted_s = 0.0
        sigma_slip = SLIP_UNCERTAINTY * slip * state.speed
        sigma_radius = learned.radius_sigma[i] * state.speed
        variance = (
            (params.sigma_wheel_speed * radius) ** 2
            + SHARED_SAMPLES * sigma_slip**2
            + RADIUS_SAMPLES * sigma_radius**2
        )
        _correct(state, rolled - predicted, variance)

    if state.speed < 0.0:
        state.speed = 0.0
