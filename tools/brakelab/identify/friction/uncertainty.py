"""Standard uncertainty of measured friction, by the law of propagation (GUM, JCGM 100:2008, 5.1).

    mu = T / (2 A_k r_eff (p - p_0))
    (u_mu / mu)^2 = (u_T / T)^2 + (u_p^2 + u_p0^2) / (p - p_0)^2 + (u_A / A_k)^2 + (u_r / r_eff)^2

with T and p - p_0 means of an application where friction counts. What the file of columns states is the same
in all applications: the uncertainty of a section's mean is that of one application, however many it has, and
it cancels where two linings are compared on one rig.
"""

from typing import Final

import numpy as np

from brakelab.arrays import Vector
from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.stops import Stops

COVERAGE: Final = 2.0
"""k of the expanded uncertainty: 95 % of a normal distribution."""


def standard_uncertainty(stops: Stops, columns: Columns) -> Vector | None:
    """Return u of the mean friction of every stop, shape (stops,); None where the file states none."""
    given = columns.uncertainty
    if given is None:
        return None
    pressure = 1e-5 * stops.held_pressure  # bar, above the push-out pressure
    torque = stops.lever * stops.held_pressure * stops.mean
    at_sensor = pressure + columns.rig.push_out_pressure
    shares = (
        np.hypot(given.torque / torque, given.torque_gain),
        np.hypot(given.pressure, given.pressure_gain * at_sensor) / pressure,
        given.push_out_pressure / pressure,
        given.piston_area,
        given.effective_radius,
    )
    return np.asarray(stops.mean * np.sqrt(sum(np.square(share) for share in shares)))
