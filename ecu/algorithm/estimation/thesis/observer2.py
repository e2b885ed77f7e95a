"""Observer 2 of one wheel: extended Kalman filter for wheel speed, tyre force and lining friction (4.8–4.15).

States        omega [rad/s], F_L [N], mu_b [-]
Measurements  omega (wheel encoder), F_L^(VS) (virtual force sensor)
Inputs        calliper pressure p, motor torque T_m (positive regenerates), rolling resistance M_R

    I domega/dt = -T_b - T_m - M_R - r F_L      corrected 4.11a/4.14: F_L < 0 while braking, A_12 = -dt r / I
    tau dF_L/dt = F_L^(VS) - F_L                (A.13), tau = relaxation length / v (A.14)
    dmu_b/dt    = random walk                   (4.11c)
    T_b = 2 A_k mu_b (p - p_0)^+ r_eff          (A.19); corrected 4.14: A_13 holds p - p_0

Discretised exactly for F_L (10 ms is twice the relaxation time at 30 m/s: explicit Euler would diverge) and
with the mean of F_L over the step for omega. The tyre model enters already scaled by K_f, so model and
measurement agree. The pressure is low-passed at the slip's 16 Hz: all signals lag alike.

The process noise of omega and F_L is scheduled (section 4.4): its standard deviation grows linearly below 2
m/s^2 of demanded deceleration, to three times at zero, and likewise below 30 km/h, where the model predicts
the states badly. The speed breakpoint and the growth are assumptions.
"""

import math

import numpy as np

from ecu.algorithm.brake import brake_gain
from ecu.jit import Record, kernel

OBSERVER_STATE = np.dtype(
    [
        ("omega", "f8", (4,)),
        ("force", "f8", (4,)),
        ("mu", "f8", (4,)),
        ("p", "f8", (4, 6)),  # covariance: ww, wf, wm, ff, fm, mm
    ],
    align=True,
)

GATE = 4.0
LOW_DECEL, LOW_SPEED = 2.0, 30.0 / 3.6  # m/s^2, m/s
GROWTH = 2.0


@kernel
def process_noise(decel: float, speed: float) -> float:
    """Return the factor on process noise (standard deviation) at a deceleration [m/s^2] and speed [m/s]."""
    gentle = 1.0 - min(max(decel / LOW_DECEL, 0.0), 1.0)
    slow = 1.0 - min(max(speed / LOW_SPEED, 0.0), 1.0)
    return 1.0 + GROWTH * max(gentle, slow)


@kernel
def start_observer(state: Record, i: int, omega: float, force: float, mu: float, sigma_mu: float) -> None:
    """Set the initial state of wheel `i` upon activation (4.13)."""
    state.omega[i], state.force[i], state.mu[i] = omega, force, mu
    p = state.p[i]
    p[0], p[1], p[2], p[3], p[4], p[5] = 1.0, 0.0, 0.0, (0.5 * force) ** 2 + 1e4, 0.0, sigma_mu**2


@kernel
def predict_observer(
    params: Record,
    state: Record,
    i: int,
    pressure: float,
    outer_torque: float,
    force_input: float,
    force_variance: float,
    radius: float,
    load: float,
    speed: float,
    drift: float,
    noise: float,
    dt: float,
) -> None:
    """Advance wheel `i` by dt [s]; `pressure` above push-out [Pa], `outer_torque` T_m + M_R [N m].

    `force_input` is F_L^(VS) [N] with the variance of its noise [N^2]; `noise` from `process_noise`.
    """
    inertia = params.wheel_inertia[i]
    lever = brake_gain(params, i)
    torque_per_mu = lever * pressure
    keep = math.exp(-dt * max(speed, 1.0) / params.relaxation_length)
    before = state.force[i]
    after = keep * before + (1.0 - keep) * force_input
    torque = torque_per_mu * state.mu[i] + outer_torque + radius * 0.5 * (before + after)
    state.omega[i] -= dt / inertia * torque
    state.force[i] = after

    # x+ = A x with A = [[1, a, b], [0, keep, 0], [0, 0, 1]]
    a = -dt * radius / inertia * 0.5 * (1.0 + keep)
    b = -dt * torque_per_mu / inertia
    p = state.p[i]
    ww, wf, wm, ff, fm, mm = p[0], p[1], p[2], p[3], p[4], p[5]
    pressure_noise = dt / inertia * lever * state.mu[i] * params.sigma_pressure
    walk = (noise * params.omega_walk) ** 2 * dt + pressure_noise**2
    p[0] = ww + a * a * ff + b * b * mm + 2.0 * (a * wf + b * wm + a * b * fm) + walk
    p[1] = keep * (wf + a * ff + b * fm)
    p[2] = wm + a * fm + b * mm
    p[3] = (
        keep * keep * ff + (1.0 - keep) ** 2 * force_variance + (noise * params.force_walk * load) ** 2 * dt
    )
    p[4] = keep * fm
    p[5] = mm + drift * drift * dt


@kernel
def _correct(
    state: Record,
    i: int,
    innovation: float,
    total: float,
    with_omega: float,
    with_force: float,
    with_mu: float,
) -> None:
    """Fuse a measured state: `total` its innovation's variance, `with_…` its covariance with each state."""
    limit = GATE * math.sqrt(total)
    innovation = min(max(innovation, -limit), limit)
    kw, kf, km = with_omega / total, with_force / total, with_mu / total
    state.omega[i] += kw * innovation
    state.force[i] += kf * innovation
    state.mu[i] += km * innovation
    p = state.p[i]
    p[0] -= kw * with_omega
    p[1] -= kw * with_force
    p[2] -= kw * with_mu
    p[3] -= kf * with_force
    p[4] -= kf * with_mu
    p[5] -= km * with_mu


@kernel
def correct_omega(state: Record, i: int, omega: float, variance: float) -> None:
    """Fuse a wheel speed [rad/s]."""
    p = state.p[i]
    _correct(state, i, omega - state.omega[i], p[0] + variance, p[0], p[1], p[2])


@kernel
def correct_force(state: Record, i: int, force: float, variance: float) -> None:
    """Fuse a virtual (or measured) longitudinal tyre force [N]."""
    p = state.p[i]
    _correct(state, i, force - state.force[i], p[3] + variance, p[1], p[3], p[4])


@kernel
def observer_sound(state: Record, i: int) -> bool:
    """Return whether every value of wheel `i` is finite and its variances are positive."""
    total = state.omega[i] + state.force[i] + state.mu[i]
    p = state.p[i]
    for j in range(6):
        total += p[j]
    return math.isfinite(total) and p[0] > 0.0 and p[3] > 0.0 and p[5] > 0.0
