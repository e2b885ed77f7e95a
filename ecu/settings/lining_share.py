"""Tables of `control.minimise`: the axles' share that emits or wears least, and what Annex 5 admits.

The share of the linings' torque is searched for one reference application at each pair of disc temperatures:
particles by the axles' emission models, or mass by their laws of wear (7.13). Its level hardly matters: the
least is where the next joule costs as much at either axle, and models of both have about the same power of
the torque in them. The minimum is flat: of all shares within `FLAT` of it the one nearest to the configured
distribution is taken. A model is asked within the range that it was trained on; below it emission goes with
the torque. Laws of wear are off by a factor each, and what they save is little: a share counts with `DOUBT`
sigma of what it moves, so only savings that the laws are sure of move it.

Motors that may brake take all that they can: f of (5.2) is 1 for them.

Source: chapter 8, outlook. Assumption: all constants below.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ecu.algorithm.brake import brake_gain
from ecu.algorithm.control.distribution import front_share
from ecu.algorithm.monitoring.emission_factor import emission_factors
from ecu.contract.dust import FEATURES
from ecu.contract.params import (
    BAR,
    GRAVITY,
    HEAT_NODES,
    HEAT_STEP,
    MEGA,
    MINIMISED,
    RATE_NODES,
    RATE_STEP,
)
from ecu.settings.annex5 import DEMANDED, Load, admissible

Array = NDArray[np.float64]

V_IN, V_END, DECEL = 14.0, 4.0, 1.3  # m/s, m/s, m/s^2, of the reference application
LEAST_EACH: Final = 0.10  # of the linings' torque: discs stay clean, friction stays known
SHARES: Final = np.linspace(LEAST_EACH, 1.0 - LEAST_EACH, 81)
FLAT: Final = 0.005
DOUBT: Final = 2.0  # sigma of the laws of wear
HEADROOM: Final = 40.0  # K that the next brakings may add, and that a temperature may be too low
UNKNOWN: Final = 30.0  # K in which emission is taken to grow e-fold, hotter than the model was trained on
ADMITTED: Final = np.linspace(0.0, 1.0, 201)
STEEPEST_SHARE: Final = 8.0  # rise of the least share per braking rate
EARLIER: Final = 3  # nodes, before what Annex 5 asks of the rear: linings may give more than is counted on
TORQUE, TEMPERATURE = FEATURES.index("torque"), FEATURES.index("temperature")
FRONT, REAR = 0, 2


def set_lining_share(row: Any, loads: tuple[Load, ...]) -> None:
    """Write the tables into `row`, one `PARAMS` that is complete but for them, and f of motors that brake."""
    predict = particles if row["minimised"] == MINIMISED.index("dust") else worn_mass
    heat = HEAT_STEP * np.arange(HEAT_NODES)
    half = 0.5 * float(row["mass"]) * DECEL
    configured = front_share(row, DECEL)
    shares = np.append(SHARES, configured)
    front, rear = (
        np.array([predict(row, at, half * row["wheel_radius"][at] * of, t) for t in heat])
        for at, of in ((FRONT, shares), (REAR, 1.0 - shares))
    )
    cost = front[:, None, :-1] + rear[None, :, :-1]
    if predict is worn_mass:
        moved = (axle[:, :-1] - axle[:, -1:] for axle in (front, rear))
        by_front, by_rear = (row["wear_sigma"][at] * m for at, m in zip((FRONT, REAR), moved, strict=True))
        cost += DOUBT * np.hypot(by_front[:, None], by_rear[None])
    far = np.abs(SHARES - configured)
    flat = cost <= (1.0 + FLAT) * cost.min(axis=-1, keepdims=True)
    row["wanted_share"] = SHARES[np.argmin(np.where(flat, far, np.inf), axis=-1)]
    row["least_share"], row["most_share"] = admitted_shares(row, loads)
    row["blending"] = np.where(row["blending"] > 0.0, 1.0, 0.0)


def particles(row: Any, corner: int, torque: Array, heat: float) -> Array:
    """Return particles of a corner's brake in the reference application; `torque` [N m], shape (n,)."""
    features = np.empty((len(torque), len(FEATURES)))
    pressure = torque / (brake_gain(row, corner) * row["mu_nominal"][corner]) / BAR
    hot = heat + HEADROOM
    for k, value in enumerate((V_IN, V_END, torque, hot, (V_IN - V_END) / DECEL, pressure)):
        features[:, k] = np.clip(value, row["dust_low"][corner, k], row["dust_high"][corner, k])
    factors = np.empty(len(torque))
    emission_factors(row["dust_model"][corner], row["dust_numbers"][corner], features, factors)
    beyond = np.exp((hot - features[:, TEMPERATURE]) / UNKNOWN)
    counted: Array = row["dust_factor"][corner] * 10.0**factors * torque / features[:, TORQUE] * beyond
    return counted


def worn_mass(row: Any, corner: int, torque: Array, heat: float) -> Array:
    """Return the mass [g] worn off a corner's linings a second of it (7.13); `torque` [N m], shape (n,)."""
    law, radius = row["wear_law"][:, corner], row["wheel_radius"][corner]
    power = MEGA * torque * 0.5 * (V_IN + V_END) / radius
    slowing = MEGA * torque * DECEL / radius
    by_heat = law[0] + law[1] * heat + law[2] * heat**2, law[3] + law[4] * heat, law[5] + law[6] * heat
    return np.asarray(by_heat[0] * power + by_heat[1] * slowing + by_heat[2] * power**2)


def admitted_shares(row: Any, loads: tuple[Load, ...]) -> tuple[Array, Array]:
    """Return least and most of the front axle's share of the force at each braking rate, shape (n,) each.

    Shares between them are admissible with a step to spare, for linings between the ends of 2 sigma, and the
    configured one is among them.
    """
    good = np.array([admissible(row, np.full(len(DEMANDED), share), loads) for share in ADMITTED])
    base = np.array([front_share(row, max(k, 1) * RATE_STEP * GRAVITY) for k in range(RATE_NODES)])
    least, most, step = np.empty(RATE_NODES), np.empty(RATE_NODES), ADMITTED[1]
    for node in range(RATE_NODES):
        bad = ADMITTED[~good[:, max(node - 1, 0)]]  # `DEMANDED` begins with a step
        above, below = bad[bad > base[node]], bad[bad < base[node]]
        least[node] = below.max() + 2.0 * step if len(below) else 0.0
        most[node] = above.min() - 2.0 * step if len(above) else 1.0
    least = np.array([least[node : node + EARLIER + 1].max() for node in range(RATE_NODES)])
    for node in range(RATE_NODES - 2, -1, -1):
        least[node] = max(least[node], least[node + 1] - STEEPEST_SHARE * RATE_STEP)
    return np.minimum(least, base), np.maximum(most, base)
