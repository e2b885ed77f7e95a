"""Wear of the brake linings from friction work as estimated by the ECU.

Model. The two pads of a calliper lose the mass (7.15), corrected: |omega'|, since with the printed sign
deceleration would restore material

    m' = (g10 + g11 tau + g12 tau^2) T_b w + (g20 + g21 tau) T_b |w'| + (g30 + g31 tau) (T_b w)^2

with the brake torque T_b by the ECU's own friction, the wheel's speed w and the disc's temperature tau in
degC. (The thesis does not say K or degC. A wrong temperature hardly matters to its quasi-static law, Figure
7.10, which in K would shift by 2 % per 10 K; and in degC the regressors are much less alike.)

Stored are not m but the regressors, the integrals (7.16) that the coefficients multiply. Wear by any law
linear in them, including a later and better one, is their scalar product with its coefficients.

w' of a noisy speed would be rectified noise: it is the slope of a low-passed speed, low-passed again.

Error. Friction and temperature have one constant unknown error each, whose effects on a regressor add up
linearly; the sums are stored with the regressors. Together with the law's own spread they are the prior of
one factor on the law's wear, which measured thicknesses correct (7.6): `wear_belief.py`.

Source. Sections 7.2, 7.4, Table 7.1.
"""

from typing import Final

import numpy as np

from ecu.algorithm.inputs import usable
from ecu.algorithm.monitoring.wear_belief import BELIEF, believe, worn
from ecu.contract.params import MEGA
from ecu.contract.records import N_LEGS
from ecu.contract.signals import CALLIPER_PRESSURE
from ecu.jit import Record, kernel

REGRESSORS: Final = (
    ("wear_energy", "MJ"),
    ("wear_energy_t", "MJ K"),
    ("wear_energy_t2", "MJ K^2"),
    ("wear_torque_rate", "MW"),
    ("wear_torque_rate_t", "MW K"),
    ("wear_power2", "MJ^2/s"),
    ("wear_power2_t", "MJ^2 K/s"),
)
"""Name and unit of the integrals of (7.16), in the order of Table 7.1's coefficients."""
ENERGY, ENERGY_T, ENERGY_T2, RATE, RATE_T, POWER2, POWER2_T = range(7)

LOW_PASS = 0.1  # s, each of the two low-passes on wheel speed: 0.1 rad/s of noise leave 0.2 rad/s^2
LEAST_SPEED = 0.3  # rad/s: a wheel at standstill causes no wear
RENEWED_S = 1.0  # while braking; the period of PadWear
LEG = 250e3  # m
LOST = 1.0  # relative error of a torque whose pressure is lost

WEAR_STATE = np.dtype(
    [
        ("speed", "f8", (4,)),  # of the wheel, low-passed [rad/s]
        ("slowing", "f8", (4,)),  # minus its slope, low-passed [rad/s^2]
        ("counted", "f8", (7, 4)),  # regressors contained in the errors
        ("since_s", "f8"),  # distance since mass and thickness were updated
        ("belief", BELIEF),
        ("mass", "f8", (4,)),  # worn off, g
        ("wear", "f8", (4,)),  # mm
        ("sigma", "f8", (4,)),  # of the wear, mm
    ],
    align=True,
)


@kernel
def restore_wear(params: Record, state: Record, learned: Record) -> None:
    """Restore the stored regressors: the belief follows from them and the law alone."""
    wear = learned.wear
    for i in range(4):
        for j in range(7):
            state.counted[j, i] = wear.regressors[j, i]
        believe(params, state.belief, wear, i)
        _renew(params, state, wear, i)
    state.since_s = 0.0


@kernel
def update_wear(
    params: Record,
    state: Record,
    learned: Record,
    inputs: Record,
    estimate: Record,
    discs: Record,
    application: Record,
    dt: float,
) -> None:
    """Add the wear of a cycle of `dt` [s] to `learned.wear`."""
    wear = learned.wear
    wear.odometer += abs(estimate.speed) * dt
    gain = dt / (LOW_PASS + dt)
    for i in range(4):
        slope = (discs.omega[i] - state.speed[i]) / (LOW_PASS + dt)
        state.speed[i] += slope * dt
        state.slowing[i] -= gain * (slope + state.slowing[i])
    if application.braking:
        x = wear.regressors
        for i in range(4):
            omega, tau = discs.omega[i], discs.temperature[i]
            if omega < LEAST_SPEED:
                continue
            power = MEGA * discs.power[i]
            energy, rate = power * dt, power / omega * abs(state.slowing[i]) * dt
            x[ENERGY, i] += energy
            x[ENERGY_T, i] += energy * tau
            x[ENERGY_T2, i] += energy * tau * tau
            x[RATE, i] += rate
            x[RATE_T, i] += rate * tau
            x[POWER2, i] += power * energy
            x[POWER2_T, i] += power * energy * tau
        state.since_s += dt
    if application.ended or state.since_s >= RENEWED_S:
        state.since_s = 0.0
        _count_errors(state, wear, inputs, estimate, discs)
        for i in range(4):
            _renew(params, state, wear, i)
        if wear.odometer >= (wear.legs + 1) * LEG:
            place = wear.legs % N_LEGS
            for i in range(4):
                for j in range(7):
                    wear.leg_ends[place, j, i] = wear.regressors[j, i]
            wear.legs += 1


@kernel
def _count_errors(state: Record, wear: Record, inputs: Record, estimate: Record, discs: Record) -> None:
    """Add the errors of the wear since the last call, with the present deviations."""
    x, counted = wear.regressors, state.counted
    for i in range(4):
        known = usable(inputs, CALLIPER_PRESSURE + i)
        share = estimate.sigma[i] / estimate.mu[i] if known else LOST
        sigma, error = discs.sigma[i], wear.temperature_error
        error[ENERGY_T, i] += sigma * (x[ENERGY, i] - counted[ENERGY, i])
        error[ENERGY_T2, i] += 2.0 * sigma * abs(x[ENERGY_T, i] - counted[ENERGY_T, i])
        error[RATE_T, i] += sigma * (x[RATE, i] - counted[RATE, i])
        error[POWER2_T, i] += sigma * (x[POWER2, i] - counted[POWER2, i])
        for j in range(7):
            power = 2.0 if j >= POWER2 else 1.0
            wear.friction_error[j, i] += power * share * abs(x[j, i] - counted[j, i])
            counted[j, i] = x[j, i]


@kernel
def _renew(params: Record, state: Record, wear: Record, i: int) -> None:
    """Update mass, thickness and standard deviation of a corner."""
    state.mass[i], state.wear[i], state.sigma[i] = worn(params, state.belief, wear, i)
