"""Samples of a signal file, and each at the time that it is of: those of an input with a lag are moved."""

from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np

from brakelab.logs.sample_block import SampleBlock

MICROSECOND: Final = 1000


def without_lags(blocks: Iterator[SampleBlock], lags: Mapping[int, float]) -> Iterator[SampleBlock]:
    """Yield the rows with every sample `lags` [s] earlier, by place of the input, negative: later.

    What would come to lie before the first or after the last row is left out.
    """
    first: int | None = None
    held: SampleBlock | None = None
    last = 0
    longest = round(1e6 * max([0.0, *lags.values()])) * MICROSECOND
    for block in blocks:
        first = int(block.t_ns[0]) if first is None else first
        last = int(block.t_ns[-1])
        moved = _moved(block, lags)
        together = moved if held is None else _joined([held, moved])
        ordered = together.rows(np.argsort(together.t_ns, kind="stable"))
        ready = ordered.t_ns < last - longest
        held = ordered.rows(~ready)
        out = ordered.rows(np.logical_and(ready, ordered.t_ns >= first))
        if len(out.t_ns):
            yield out
    if held is not None:
        yield held.rows(np.logical_and(held.t_ns >= (first or 0), held.t_ns <= last))


def _moved(block: SampleBlock, lags: Mapping[int, float]) -> SampleBlock:
    late = np.array([round(1e6 * lags.get(int(place), 0.0)) * MICROSECOND for place in block.places])
    parts = []
    for lag in np.unique([0, *late]):
        values = np.where(late == lag, block.values, np.nan)
        part = SampleBlock(np.round(block.t - 1e-9 * lag, 9), block.t_ns - lag, block.places, values)
        parts.append(part.rows(np.flatnonzero(np.isfinite(values).any(axis=1))) if lag else part)
    return _joined(parts)


def _joined(parts: list[SampleBlock]) -> SampleBlock:
    return SampleBlock(
        np.concatenate([part.t for part in parts]),
        np.concatenate([part.t_ns for part in parts]),
        parts[0].places,
        np.concatenate([part.values for part in parts]),
    )
