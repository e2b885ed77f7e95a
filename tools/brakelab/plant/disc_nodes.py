"""Disc of two nodes, ring and hat with hub, that no estimator's lump can follow exactly.

    c(T) m theta_r' = s P - G (theta_r - theta_h) - A_r(u) theta_r - e ((T_r + 273)^4 - (T_a + 273)^4)
        c_h theta_h' = G (theta_r - theta_h) - A_h theta_h

u is the speed of the air along the disc: the car's and a wind that turns and gusts. Forced convection goes by
u^0.8 (turbulent plate), rain adds a film that evaporates, as much as the disc is hotter than the air up to
100 degC. c rises with temperature as that of grey cast iron does (section 3.4: 450 to 550 J/(kg K)).

Source: the heat balance behind (3.7) without its simplifications. Assumption: all numbers of `DiscNodes`.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEP: Final = 0.25  # s
CUBE: Final = 273.15
HEAT_BY_KELVIN: Final = 6e-4  # 1/K, of c between 20 and 400 degC
BOLTZMANN: Final = 5.67e-8  # W/(m^2 K^4)
REFERENCE: Final = 20.0  # m/s, where forced convection equals that of the lump
EXPONENT: Final = 0.8
WIND_S: Final = 120.0  # over which the wind along the car changes


class DiscNodes(NamedTuple):
    """One disc."""

    capacity: float
    """Of ring and hat together at 20 degC, J/K."""
    hat: float
    """Its share that is the hat's and the hub's."""
    conductance: float
    """Between the two, W/K."""
    share: float
    """Of the friction power that goes into the disc."""
    still: float
    """Convection of the ring at standstill, W/K."""
    by_air: float
    """Forced convection at `REFERENCE`, W/K."""
    area: float
    """Emissivity times radiating area, m^2."""
    film: float
    """Wet: conductance of the water film at `REFERENCE` beside the air, W/K."""


def nodes_like(heating: float, still: float, by_speed: float, random: Generator) -> DiscNodes:
    """Return a disc whose lump would be that of xi [K/J], delta_0 [1/s], delta_1 [1/m]; the rest is drawn."""
    share = random.uniform(0.90, 0.98)
    capacity = share / heating
    return DiscNodes(
        capacity,
        random.uniform(0.12, 0.22),
        random.uniform(15.0, 35.0),
        share,
        0.7 * still * capacity,
        by_speed * REFERENCE * capacity,
        random.uniform(0.02, 0.05),
        random.uniform(0.6, 1.6) * by_speed * REFERENCE * capacity,
    )


def wind(rows: int, period: float, gust: float, random: Generator) -> Array:
    """Return the wind along the car [m/s], positive from ahead, shape (rows,), of deviation `gust` [m/s]."""
    stays = np.exp(-period / WIND_S)
    pushes = gust * np.sqrt(1.0 - stays**2) * random.standard_normal(rows)
    found, now = np.empty(rows), gust * random.standard_normal()
    for k in range(rows):
        now = stays * now + pushes[k]
        found[k] = now
    return found


def rates(
    disc: DiscNodes, ring: Array, hat: Array, power: Array, air_speed: float, air: float, wetness: float
) -> tuple[Array, Array]:
    """Return the slopes [K/s] of ring and hat [degC], shapes (k,); power [W], `air_speed` [m/s]."""
    forced = (max(air_speed, 0.0) / REFERENCE) ** EXPONENT
    over = ring - air
    exchanged = disc.conductance * (ring - hat)
    film = wetness * disc.film * forced * np.minimum(over, max(100.0 - air, 0.0))
    radiated = BOLTZMANN * disc.area * ((ring + CUBE) ** 4 - (air + CUBE) ** 4)
    lost = (disc.still + disc.by_air * forced) * over + film + radiated
    capacity = disc.capacity * (1.0 - disc.hat) * (1.0 + HEAT_BY_KELVIN * (ring - 20.0))
    slope = (disc.share * power - exchanged - lost) / capacity
    slope_hat = (exchanged - 0.3 * disc.still * (hat - air)) / (disc.capacity * disc.hat)
    return slope, slope_hat


def heat_discs(
    disc: DiscNodes, power: Array, air_speed: Array, air: float, wetness: Array, start: float, period: float
) -> Array:
    """Return the ring's temperature [degC] at the end of every row, shape (n, k).

    Args:
        disc: of all k brakes.
        power: of friction [W], shape (n, k), mean of a row.
        air_speed: m/s, shape (n,).
        air: degC.
        wetness: 0 dry to 1 rain, shape (n,).
        start: degC, of all nodes.
        period: s, of a row.
    """
    ring, hat = np.full(power.shape[1], start), np.full(power.shape[1], start)
    steps = max(round(period / STEP), 1)
    found = np.empty_like(power)
    for row in range(len(power)):
        for _ in range(steps):
            warm, warm_hat = rates(disc, ring, hat, power[row], air_speed[row], air, wetness[row])
            ring, hat = ring + period / steps * warm, hat + period / steps * warm_hat
        found[row] = ring
    return found
