"""Steady sliding friction of the LuGre model, without memory (2.4.1; [47, 48] of the thesis).

    mu_b = mu_C + (mu_S - mu_C) exp(-(v / v_S)^2) + sigma_2 v

of Coulomb, at standstill, Stribeck's speed, viscous; v held at the highest speed seen. It knows speed alone.
"""

import math
from collections.abc import Sequence
from typing import Literal

from brakelab.plant.friction.law import Law, NotNegative, Positive, RigBrake
from brakelab.plant.jit import Record, kernel

COULOMB, STATIC, STRIBECK, VISCOUS, HIGHEST_SPEED = range(1, 6)


class StaticLugre(Law):
    law: Literal["static_lugre"]
    coulomb: NotNegative
    static: NotNegative
    stribeck: Positive  # m/s, sliding
    viscous: float  # s/m
    highest_speed: Positive  # m/s, sliding

    def row(self, brake: RigBrake) -> Sequence[float]:
        return (1.0, self.coulomb, self.static, self.stribeck, self.viscous, self.highest_speed)


@kernel
def step(
    row: Record,
    memory: float,
    pressure: float,
    speed: float,
    slowing: float,
    temperature: float,
    dt: float,
) -> tuple[float, float]:
    """Return the memory unchanged, and friction."""
    v = min(speed, row[HIGHEST_SPEED])
    share = v / row[STRIBECK]
    falls = (row[STATIC] - row[COULOMB]) * math.exp(-share * share)
    return memory, row[COULOMB] + falls + row[VISCOUS] * v
