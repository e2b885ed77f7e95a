"""Decoded signals in MDF4: channels with the contract's input names, in groups with rates of their own.

The groups are merged by time; an input has no sample in the rows of the other groups. `t` is the file's own
time [s] since its start.
"""

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from brakelab.logs.log_quality import Damage
from brakelab.logs.mdf import Column, Measurement, in_step
from brakelab.logs.sample_block import refuse_one_instant
from ecu.contract.records import RecordArray
from ecu.contract.signals import INPUT
from ecu.errors import UserError


class Channels(NamedTuple):
    """The channels of a file that are inputs."""

    measurement: Measurement
    groups: dict[int, dict[str, int]]
    """By group: place of each input."""
    unknown: list[str]


def open_channels(path: Path, wanted: Collection[str] = INPUT) -> Channels:
    """Return what an MDF4 file has of `wanted` names. Raises UserError for one that stands there twice."""
    measurement = Measurement(path)
    groups: dict[int, dict[str, int]] = {}
    unknown = []
    known: set[str] = set()
    for name, group, index in measurement.channels():
        name = name.partition("\\")[0]  # measurement programs put the device behind it
        if index == measurement.master(group):
            continue
        if name not in wanted:
            unknown.append(name)
        elif name in known:
            raise UserError(str(path), name, "stands in this file twice; keep one channel of this name")
        else:
            known.add(name)
            groups.setdefault(group, {})[name] = index
    return Channels(measurement, groups, unknown)


def channel_units(path: Path) -> dict[str, str]:
    """Return the units of all channels but time, by name."""
    measurement = Measurement(path)
    try:
        return {
            name.partition("\\")[0]: measurement.unit(group, index)
            for name, group, index in measurement.channels()
            if index != measurement.master(group)
        }
    finally:
        measurement.close()


def read_channels(
    path: Path, channels: Channels, damage: Damage, window: int = 1 << 16
) -> Iterator[pa.RecordBatch]:
    """Yield rows with `t` [s] and every input, NaN: no sample; at most `window` records of a group at once.

    Of records of one group at one instant the last counts. What cannot be read goes into `damage`.

    Raises:
        UserError: time falls within a group, or its first record cannot be read.
    """
    measurement, groups, _ = channels
    names = [name for places in groups.values() for name in places]
    sources = [_samples(path, measurement, group, places, damage, window) for group, places in groups.items()]
    firsts = np.cumsum([0, *(len(places) for places in groups.values())])
    last = -np.inf
    for ready in in_step(sources, lambda block: block["t"]):
        micros = np.concatenate([np.rint(block["t"] * 1e6) for _, block in ready])
        _, rows, inverse = np.unique(micros, return_index=True, return_inverse=True)
        t = np.concatenate([block["t"] for _, block in ready])[rows]
        values = np.full((len(rows), len(names)), np.nan)
        done = 0
        for source, block in ready:
            here = inverse[done : done + len(block)]
            values[here, firsts[source] : firsts[source + 1]] = block["values"]
            done += len(block)
        kept = t > last
        last = float(t[-1])
        arrays = [pa.array(column[kept]) for column in (t, *values.T)]
        yield pa.RecordBatch.from_arrays(arrays, names=["t", *names])


def _samples(
    path: Path,
    measurement: Measurement,
    group: int,
    places: dict[str, int],
    damage: Damage,
    window: int,
) -> Iterator[RecordArray]:
    rows, last = measurement.rows(group), -np.inf
    dtype = np.dtype([("t", "f8"), ("values", "f8", (len(places),))])
    for first in range(0, rows, window):
        try:
            columns = [_numeric(measurement, group, index, first, window) for index in places.values()]
            block = np.zeros(len(columns[0].timestamps), dtype)
            block["t"] = columns[0].timestamps
            for place, column in enumerate(columns):
                block["values"][:, place] = _valid(column)
        except Exception as error:  # a damaged file makes asammdf raise anything
            where = f"group {group}, record {first}"
            if first:
                damage.cut = f"{where}: cannot be read ({error}), the rest of this group is missing"
                return
            remedy = f"cannot be read ({error}); save the file again where it was recorded"
            raise UserError(str(path), where, remedy) from None
        here = min(window, rows - first)
        if len(block) < here:
            missing = rows - first - len(block)
            damage.cut = f"group {group}, record {first + len(block)}: {missing} records are missing"
        lost = np.flatnonzero(~np.isfinite(block["t"]))
        if len(lost):
            damage.note_damage(len(lost), f"group {group}, record {first + int(lost[0])} (no time)")
            block = block[np.isfinite(block["t"])]
        refuse_one_instant(path, f"group {group}, record {first}", block["t"], block["values"])
        steps = np.diff(block["t"], prepend=last)
        damage.stamps_repeated += int(np.count_nonzero(steps == 0))
        falling = np.flatnonzero(steps < 0)
        if len(falling):
            raise UserError(
                str(path),
                f"group {group}, record {first + int(falling[0])}",
                f"time falls to {block['t'][falling[0]]:g} s; sort the records",
            )
        if len(block):
            last = float(block["t"][-1])
            yield block
        if damage.cut:
            return


def _numeric(measurement: Measurement, group: int, index: int, first: int, window: int) -> Column:
    column = measurement.column(group, index, first, window, raw=False)
    if column.samples.dtype.kind in "biuf":
        return column
    return measurement.column(group, index, first, window, raw=True)  # a table turns numbers into words


def _valid(column: Column) -> "np.ndarray[tuple[int], np.dtype[np.float64]]":
    values = column.samples.astype(np.float64)
    if column.invalidation_bits is not None:
        values[np.asarray(column.invalidation_bits, np.bool_)] = np.nan
    return values
