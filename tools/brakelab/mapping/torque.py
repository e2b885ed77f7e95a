"""A brake torque in place of the calliper pressures that a car does not send.

    p = T · share / 2 / (2 A_k r_eff mu_nominal 1e5) + p_0

with the total torque T [N m] and pistons, radius and friction of CONFIG. `share` is the axle's part: CONFIG's
`front_share`, or where it has none that of equal pressures in all callipers. What is learned from such a
pressure is friction relative to the one the car's own estimate of its torque assumes.
"""

from typing import Any, Final

import numpy as np

from brakelab.arrays import Vector
from brakelab.logs.physics.line import BRAKING, Fit, fit
from brakelab.mapping.motion import Found, Motion
from brakelab.mapping.names import converts, words
from brakelab.mapping.series import Series
from ecu.bus.units import CONVERSIONS, spelled
from ecu.contract.params import BAR
from ecu.contract.signals import CORNERS
from ecu.settings.config import torque_per_bar

FOLLOWS: Final = 0.7  # correlation with the deceleration, from which a torque is one of the brakes
NEAR: Final = 0.02
MEASURED: Final = {"actl", "act", "actual", "meas", "ist", "est"}
FORMULA: Final = "pressure = torque · share / 2 / (2 · A_k · r_eff · mu_nominal · 1e5)"


def brake_torque(series: list[Series], motion: Motion) -> tuple[Series, Fit] | None:
    """Return the torque [N m] whose name speaks of brakes and that follows the deceleration best."""
    if not motion.drives or not np.any(motion.change < -BRAKING):
        return None
    decel = np.maximum(-motion.change, 0.0)
    found = []
    for one in series:
        parts = set(words(one.signal))
        if one.flag or not converts(one.unit, "N m") or not parts & {"brk", "brake", "brakes", "bremse"}:
            continue
        line = fit(motion.smoothed(one), decel, motion.faster(1.0) & motion.near(one))
        if line.correlation > FOLLOWS:
            found.append((line.correlation + (NEAR if parts & MEASURED else 0.0), one, line))
    return max(found, key=lambda candidate: candidate[0])[1:] if found else None


def pressure_per_torque(params: Any) -> tuple[Vector, Vector]:
    """Return factor [bar per N m of the total] and offset [bar] of every corner; `params` is one `PARAMS`."""
    per_bar = torque_per_bar(params)
    share = per_bar / per_bar.sum()
    if params["front_share"] > 0.0:
        front = 0.5 * float(params["front_share"])
        share = np.array([front, front, 0.5 - front, 0.5 - front])
    return share / per_bar, params["push_out_pressure"] / BAR


def stand_in(torque: tuple[Series, Fit], params: Any) -> list[Found]:
    """Return the four pressures that would give `torque` at nominal friction; `params` is one `PARAMS`."""
    one, line = torque
    scale = CONVERSIONS["N m"][spelled(one.unit)][0]
    factors, offsets = pressure_per_torque(params)
    share = float(params["front_share"])
    assumed = f"front share {share:.2f} of CONFIG" if share else "equal pressures assumed"
    evidence = f"brake torque, correlation {line.correlation:.2f} with deceleration; {FORMULA}; {assumed}"
    return [
        Found(f"calliper_pressure_{corner}", one, scale * factor, offset, "bar", evidence, True)
        for corner, factor, offset in zip(CORNERS, factors.tolist(), offsets.tolist(), strict=True)
    ]
