"""`config check --picture`: the distribution of the brake force among the axles beside what Annex 5 forbids.

A row is a braking rate z that the driver asks for, a column a share of the front axle. A share is forbidden
where in any state of load, at nominal friction, the rear uses more adhesion than the front (3.1 A) or the
braking rate is too small for the adhesion used (3.1 B).
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ecu.algorithm.control.distribution import front_share
from ecu.contract.params import GRAVITY
from ecu.settings.annex5 import K_RULED, ROUNDING, Z_ORDERED, Load

ROWS: Final = np.arange(0.05, 1.0001, 0.05)
COLUMNS: Final = np.arange(0.30, 1.0001, 0.01)
FORBIDDEN, FREE, IDEAL, ACTUAL, BOTH = "░", " ", "o", "x", "@"


def forbidden(params: Any, asked: float, load: Load, share: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which front shares of the brake force Annex 5 forbids at a rate that the driver asks for.

    Args:
        params: one `PARAMS`.
        asked: braking rate that the driver asks for; the car reaches it with the mass of CONFIG.
        load: state of load.
        share: shape (n,).
    """
    z = asked * float(params["mass"]) / load.mass
    length = float(params["wheelbase"])
    on_front = (length - load.front_axle + z * load.cog_height) / length
    f_front = share * z / on_front
    f_rear = (1.0 - share) * z / max(1.0 - on_front, 1e-6)
    ordered = Z_ORDERED[0] - ROUNDING <= z <= Z_ORDERED[1] + ROUNDING
    k = np.maximum(f_front, f_rear)
    ruled = (k >= K_RULED[0] - ROUNDING) & (k <= K_RULED[1] + ROUNDING)
    wrong: NDArray[np.bool_] = ruled & (z < 0.1 + 0.7 * (k - 0.2) - ROUNDING)
    return wrong | (ordered & (f_rear > f_front + 1e-6))


def picture(params: Any, loads: tuple[Load, ...]) -> list[str]:
    """Return the picture as lines; `params` is one `PARAMS`."""
    names = " or ".join(load.name for load in loads)
    lines = [f"front share of the brake force over the braking rate asked for ({names}):"]
    for z in ROWS:
        wrong = np.any([forbidden(params, float(z), load, COLUMNS) for load in loads], axis=0)
        row = [FORBIDDEN if one else FREE for one in wrong]
        ideal = (float(params["rear_axle"]) + z * float(params["cog_height"])) / float(params["wheelbase"])
        at = [_column(ideal), _column(float(front_share(params, z * GRAVITY)))]
        row[at[0]], row[at[1]] = IDEAL, BOTH if at[0] == at[1] else ACTUAL
        lines.append(f"z = {z:4.2f} |{''.join(row)}|")
    scale = "".join(f"{100 * share:<10.0f}" for share in COLUMNS[:-1:10])
    return [
        *lines,
        f"          {scale}{100 * COLUMNS[-1]:.0f} %",
        f"{ACTUAL} this car, {IDEAL} ideal, {BOTH} both, {FORBIDDEN} forbidden by Annex 5, 3.1",
    ]


def _column(share: float) -> int:
    return int(np.clip(round((share - COLUMNS[0]) / 0.01), 0, len(COLUMNS) - 1))
