"""Downsampling that preserves appearance: each bucket keeps its extremes, in their order."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector

# A brake application is a small part of a drive and the part that readers zoom into.
BUSY_WEIGHT = 5.0


class Buckets(NamedTuple):
    """Consecutive rows drawn as two points: `first[i] … last[i]`, both inclusive."""

    first: NDArray[np.int64]
    last: NDArray[np.int64]


def buckets(busy: NDArray[np.bool_], limit: int) -> Buckets:
    """Divide the rows so that at most `limit` points result; busy rows get finer buckets.

    With no more rows than `limit` every row stands alone. `busy` has shape (n,).
    """
    rows = np.arange(len(busy))
    if len(busy) <= limit:
        return Buckets(rows, rows)
    weight = np.where(busy, BUSY_WEIGHT, 1.0)
    number = ((np.cumsum(weight) - weight) / weight.sum() * (limit // 2)).astype(np.int64)
    first = np.flatnonzero(np.diff(number, prepend=-1))
    return Buckets(first, np.append(first[1:] - 1, len(busy) - 1))


def _pairs(grid: Buckets, early: Vector, late: Vector) -> Vector:
    both = np.column_stack([early, late])
    keep = np.column_stack([np.ones(len(early), bool), grid.last > grid.first])
    return np.asarray(both[keep])


def times(grid: Buckets, t: Vector) -> Vector:
    """Return the time stamps of the points that `extremes` returns."""
    return _pairs(grid, t[grid.first], t[grid.last])


def extremes(grid: Buckets, values: Vector) -> Vector:
    """Return minimum and maximum of each bucket in order of occurrence; NaN only where all is NaN."""
    rows = np.arange(len(values))
    low = np.fmin.reduceat(values, grid.first)
    high = np.fmax.reduceat(values, grid.first)
    size = grid.last - grid.first + 1

    def first_row(extreme: Vector) -> NDArray[np.int64]:
        return np.asarray(
            np.minimum.reduceat(np.where(values == np.repeat(extreme, size), rows, len(values)), grid.first)
        )

    rising = first_row(low) <= first_row(high)
    return _pairs(grid, np.where(rising, low, high), np.where(rising, high, low))


def worst(grid: Buckets, levels: Vector) -> Vector:
    """Return the largest value of each bucket, of a mode the most severe one, shape (buckets,)."""
    return np.asarray(np.fmax.reduceat(levels, grid.first))


def drawn(grid: Buckets, t: Vector, lines: Iterable[tuple[str, Vector]]) -> dict[str, NDArray[Any]]:
    """Return `t` and the lines with at least one number at the points that are drawn."""
    points = {name: extremes(grid, line).astype("f4") for name, line in lines if np.isfinite(line).any()}
    return {"t": times(grid, t), **points}
