"""ECE R13-H, Annex 3, 2.1.1: what the service brake has to reach, checked when a configuration is read.

The end of the pedal asks for 6.43 m/s^2 at least (Type 0, engine disconnected), and the linings alone brake
the heaviest car that hard at nominal friction and within the greatest pressure:

    a = sum of min(s_i m a_pedal, 4 A_i r_eff,i mu_i (p_max - p_0,i) / r_i) / m

with the share s_i of axle i, front and rear. A load is compensated like rough linings. Motors do not count: a
full battery takes nothing.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ecu.algorithm.control.distribution import front_share
from ecu.contract.params import BAR
from ecu.settings.annex5 import Load

LEAST_DECEL: Final = 6.43  # m/s^2
GREATEST_PRESSURE: Final = 180.0  # bar, that a configuration may demand
AXLES: Final = ("front", "rear")


def full_braking(params: Any, load: Load) -> float:
    """Return the deceleration [m/s^2] at the end of the pedal, by the linings; `params` is one `PARAMS`."""
    return _reached(params, load, float(params["max_pressure"]))


def annex_3_violation(params: Any, loads: tuple[Load, ...]) -> tuple[str, str] | None:
    """Return the key of CONFIG that makes the service brake too weak, and the remedy; None if it is not.

    `loads` ends with the heaviest.
    """
    norm = f"ECE R13-H Annex 3, 2.1.1 asks for {LEAST_DECEL} m/s^2"
    asked = float(params["pedal_decel"][-1])
    if asked < LEAST_DECEL:
        return "control.pedal_decel", f"ends at {asked:g} m/s^2; {norm}"
    load = loads[-1]
    reached = full_braking(params, load)
    if reached >= LEAST_DECEL:
        return None
    weak = f"the linings brake the car, {load.name}, by {reached:.3g} m/s^2; {norm}"
    for pressure in np.arange(np.ceil(params["max_pressure"] / BAR), GREATEST_PRESSURE + 1.0):
        if _reached(params, load, BAR * pressure) >= LEAST_DECEL:
            return "control.max_pressure", f"{weak}: give {pressure:.0f} bar or more"
    wanted, able = _wanted(params, load), _able(params, float(params["max_pressure"]))
    worst = int(np.argmax(wanted / able))
    return f"{AXLES[worst]}.piston_diameter", (
        f"{weak}: this axle gives {able[worst]:.0f} of {wanted[worst]:.0f} N; correct its pistons,"
        " effective_radius or mu_nominal"
    )


def _reached(params: Any, load: Load, max_pressure: float) -> float:
    return float(np.minimum(_wanted(params, load), _able(params, max_pressure)).sum() / load.mass)


def _wanted(params: Any, load: Load) -> NDArray[np.float64]:
    """Return the forces [N] that the end of the pedal asks of the axles, shape (2,)."""
    decel = float(params["pedal_decel"][-1])
    share = float(front_share(params, decel))
    return np.array([share, 1.0 - share]) * decel * load.mass


def _able(params: Any, max_pressure: float) -> NDArray[np.float64]:
    """Return the greatest forces [N] of the linings of the axles at a pressure [Pa], shape (2,)."""
    gain = 4.0 * params["piston_area"] * params["effective_radius"] * params["mu_nominal"]
    pressure = np.maximum(max_pressure - params["push_out_pressure"], 0.0)
    return np.asarray(gain * pressure / params["wheel_radius"])[::2]
