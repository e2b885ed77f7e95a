"""ECE R13-H, Annex 5: the distribution of braking among the axles, checked when a configuration is read.

Adhesion utilised by an axle: the force of its brakes over the normal force of the road while braking,

    f_front = T_1 / N_1,  N_1 = P (l_r + z h) / L        f_rear = T_2 / N_2,  N_2 = P (l_f - z h) / L

with the braking rate z = (T_1 + T_2) / P, P the weight, unladen and laden. The ECU does not know the load: it
distributes by the mass and centre of gravity of the configuration.

- 3.1 (A): f_rear <= f_front for z from 0.15 to 0.8. Asked with the friction that the ECU counts on, and with
  any friction within 2 sigma after `watch_trailing` has taken back what it may: then the rear must not be
  ahead.
- 3.1 (B): z >= 0.1 + 0.7 (k - 0.2) for k from 0.2 to 0.8, k being the greater of f_front and f_rear. Asked
  with any friction within 2 sigma.

The share is that of the control path itself (`front_share`); loads and utilisations are worked out here.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.algorithm.control.distribution import LEAST_TRAILING, front_share
from ecu.contract.params import GRAVITY

Row = NDArray[np.float64]

Z_ORDERED: Final = (0.15, 0.8)
K_RULED: Final = (0.2, 0.8)
DEMANDED: Final = np.arange(0.01, 2.0, 0.01)
"""Braking rates that the driver asks for; a laden car reaches less, one with rough linings more."""
ROUNDING: Final = 1e-9


class Load(NamedTuple):
    """A state of load."""

    name: str
    mass: float
    """kg"""
    front_axle: float
    """Centre of gravity to front axle, m."""
    cog_height: float
    """m"""


class Utilisation(NamedTuple):
    """The adhesion that each axle uses over the braking rate, each of shape (n,)."""

    z: Row
    front: Row
    rear: Row


def shares(params: Any) -> Row:
    """Return the front axle's share of the brake force at each of `DEMANDED`; `params` is one `PARAMS`."""
    return np.array([front_share(params, z * GRAVITY) for z in DEMANDED])


def utilisation(params: Any, share: Row, load: Load, front: float = 1.0, rear: float = 1.0) -> Utilisation:
    """Return the adhesion that the axles use at each of `DEMANDED`.

    Args:
        params: one `PARAMS`.
        share: its `shares`.
        load: state of load.
        front: brake force of the axle over the one that the ECU counts on.
        rear: likewise.
    """
    force = DEMANDED * float(params["mass"]) / load.mass
    forces = front * share * force, rear * (1.0 - share) * force
    z, length = forces[0] + forces[1], float(params["wheelbase"])
    on_front = (length - load.front_axle + z * load.cog_height) / length
    # Beyond z = l_f / h the rear wheels are off the road; no road brakes a car that hard.
    on_rear = np.maximum((load.front_axle - z * load.cog_height) / length, 1e-6)
    return Utilisation(z, forces[0] / on_front, forces[1] / on_rear)


def annex_5_violation(params: Any, loads: tuple[Load, ...]) -> str | None:
    """Return where the distribution violates Annex 5 and the remedy, None if it does not."""
    doubt = 2.0 * float(params["sigma_mu_initial"])
    low, high, share = 1.0 - doubt, 1.0 + doubt, shares(params)
    for load in loads:
        found = _rear_ahead(utilisation(params, share, load))
        if found:
            return f"{load.name}, {found}; shift brake force to the front"
        found = _rear_ahead(utilisation(params, share, load, low, LEAST_TRAILING * high))
        if found:
            return f"{load.name}, friction 2 sigma off, rear taken back, {found}; lower sigma_mu_initial"
        for front in (low, high):
            for rear in (low, high):
                found = _too_little(utilisation(params, share, load, front, rear))
                if found:
                    return f"{load.name}, friction in front x{front:.2g}, rear x{rear:.2g}: {found}"
    return None


def admissible(params: Any, share: Row, loads: tuple[Load, ...]) -> NDArray[np.bool_]:
    """Return at which of `DEMANDED` a front share of `share` there is within Annex 5, shape (n,).

    (B) is asked beyond k = 0.8 too: friction less far off may rule there.
    """
    doubt = 2.0 * float(params["sigma_mu_initial"])
    low, high = 1.0 - doubt, 1.0 + doubt
    good = np.ones(len(DEMANDED), dtype=np.bool_)
    for load in loads:
        for curve in (
            utilisation(params, share, load),
            utilisation(params, share, load, low, LEAST_TRAILING * high),
        ):
            good &= _ahead(curve) <= ROUNDING
        for front in (low, high):
            for rear in (low, high):
                curve = utilisation(params, share, load, front, rear)
                good &= _missing(curve, np.inf) <= ROUNDING
    return good


def _ahead(curve: Utilisation) -> Row:
    """Return how much more the rear uses than the front, where (A) rules."""
    ordered = (curve.z >= Z_ORDERED[0] - ROUNDING) & (curve.z <= Z_ORDERED[1] + ROUNDING)
    return np.where(ordered, curve.rear - curve.front, -np.inf)


def _missing(curve: Utilisation, greatest: float = K_RULED[1]) -> Row:
    """Return by how much the braking rate is too small, where (B) rules; up to `greatest` of k."""
    k = np.maximum(curve.front, curve.rear)
    ruled = (k >= K_RULED[0] - ROUNDING) & (k <= greatest + ROUNDING)
    return np.where(ruled, _least_rate(k) - curve.z, -np.inf)


def _least_rate(k: Row) -> Row:
    return np.asarray(0.1 + 0.7 * (k - 0.2))


def _rear_ahead(curve: Utilisation) -> str:
    """Find the braking rate of (A) at which the rear uses most more than the front."""
    ahead = _ahead(curve)
    worst = int(np.argmax(ahead))
    if ahead[worst] <= ROUNDING:
        return ""
    z, front, rear = (float(row[worst]) for row in curve)
    return f"z = {z:.2f}: f_front {front:.3f} < f_rear {rear:.3f} (ECE R13-H Annex 5, 3.1 A)"


def _too_little(curve: Utilisation) -> str:
    """Find the adhesion of (B) at which the braking rate is most too small."""
    missing = _missing(curve)
    k = np.maximum(curve.front, curve.rear)
    least = _least_rate(k)
    worst = int(np.argmax(missing))
    if missing[worst] <= ROUNDING:
        return ""
    z, front, rear = (float(row[worst]) for row in curve)
    return (
        f"k = {k[worst]:.2f}: z = {z:.3f} < {least[worst]:.3f} with f_front {front:.3f}, f_rear {rear:.3f}"
        " (ECE R13-H Annex 5, 3.1 B)"
    )
