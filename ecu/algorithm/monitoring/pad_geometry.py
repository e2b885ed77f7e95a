"""Wear as mass and as thickness of the two pads of one calliper, which have chamfers.

Both pads lose `pad_mass` G [g/mm]. Chamfers remove the share s of the new surface and end at the depth c, so
that at depth h the area is 1 - s (1 - h/c) of the whole:

    m = G (h - s (h - h^2 / 2c))    h < c
    m = G (h - s c / 2)             h >= c
"""

import math

from ecu.jit import Record, kernel


@kernel
def mass_of(params: Record, i: int, wear: float) -> float:
    """Return the mass [g] that both pads of corner i have lost at `wear` [mm] below new."""
    depth, share = params.chamfer_depth[i], params.chamfer_share[i]
    if depth <= 0.0 or share <= 0.0:
        missing = 0.0
    elif wear < depth:
        missing = share * (wear - 0.5 * wear * wear / depth)
    else:
        missing = 0.5 * share * depth
    return params.pad_mass[i] * (wear - missing)


@kernel
def thickness_lost(params: Record, i: int, mass: float) -> float:
    """Return the wear [mm] of corner i that corresponds to `mass` [g] of both pads."""
    depth, share = params.chamfer_depth[i], params.chamfer_share[i]
    equal: float = mass / params.pad_mass[i]
    if depth <= 0.0 or share <= 0.0:
        return equal
    if equal >= depth * (1.0 - 0.5 * share):
        return equal + 0.5 * share * depth
    rest = 1.0 - share
    return depth / share * (math.sqrt(max(rest * rest + 2.0 * share * equal / depth, 0.0)) - rest)


@kernel
def area_share(params: Record, i: int, wear: float) -> float:
    """Return the area at `wear` [mm] over the full area."""
    depth, share = params.chamfer_depth[i], params.chamfer_share[i]
    if depth <= 0.0 or wear >= depth:
        return 1.0
    return 1.0 - share * (1.0 - max(wear, 0.0) / depth)
