"""Columns of a signal file as series, and the map of columns that is proposed from them."""

from itertools import chain, islice
from pathlib import Path
from typing import Final

import numpy as np

from brakelab.arrays import Vector, median
from brakelab.logs.column_map import LONGEST_LAG_S, TIMES, seconds_of
from brakelab.logs.log_quality import SignalQuality
from brakelab.logs.physics.lags import RADIUS, lags
from brakelab.logs.physics.samples import SAMPLED, Car, InputSeries
from brakelab.logs.row_order import in_order, numbers
from brakelab.logs.sample_block import refuse_one_instant
from brakelab.logs.signal_batches import Columns, columns_of, rows_of, time_of
from brakelab.logs.signal_file import check_seconds
from brakelab.mapping.map_text import input_lines, needs_radius, radius_line
from brakelab.mapping.motion import Found, Motion, contract_unit
from brakelab.mapping.names import converts
from brakelab.mapping.series import FEWEST_FRAMES, Series, the_first
from ecu.bus.units import CONVERSIONS
from ecu.contract.signals import INPUT, without_corner
from ecu.errors import UserError

FLAG: Final = {0.0, 1.0}
SHOWN: Final = 30  # characters of a cell


def read_column_series(log: Path, quality: SignalQuality) -> tuple[Columns, list[Series]]:
    """Return the columns of a signal file, and those of numbers as series.

    Raises:
        UserError: the file has no column of time or no row, or its time is too coarse for its rows.
    """
    columns = columns_of(log)
    time, seconds = time_of(log, columns)
    names = [name for name in columns.names if name != time]
    parts: dict[str, list[Vector]] = {name: [] for name in [time, *names]}
    rows = rows_of(log, columns, [time, *names], quality)
    begin = [*islice(rows, 1)]
    first = "".join(str(one) for batch in begin for one in batch.rows.column(time)[:1])
    batches = in_order(log, chain(begin, rows), time, seconds, quality)
    for batch, _ in the_first(batches, lambda one: len(parts) * one.rows.num_rows):
        for name, values in parts.items():
            values.append(numbers(batch.column(name)))
    read = {name: np.concatenate(parts.pop(name) or [np.empty(0)]) for name in [*parts]}
    t = read[time] * seconds
    if not np.isfinite(t).any():
        remedy = f"{first[:SHOWN]!r} is no time; give s, or the time of day as 14:23:05.12"
        raise UserError(str(log), time, remedy if len(t) else "holds no time; give a file with rows")
    known = t[np.isfinite(t)]
    check_seconds(log, time, known, f'; or write its unit behind the name, "{time} [us]"')
    refuse_one_instant(log, time, t, np.column_stack([t, *(read[name] for name in names)]))
    t = t - known[0]
    if ":" in first:
        columns.units[time] = "hh:mm:ss"
    series = [_series(name, columns.units.get(name, ""), t, read[name]) for name in names]
    return columns, [one for one in series if len(one.t) >= FEWEST_FRAMES]


def _series(name: str, unit: str, t: Vector, value: Vector) -> Series:
    known = np.isfinite(t) & np.isfinite(value)
    if not known.all() or not (np.diff(t) > 0.0).all():
        t, first = np.unique(t[known], return_index=True)
        value = value[known][first]
    period = median(np.diff(t)) if len(t) > 1 else np.nan
    flag = set(np.unique(value[:1000]).tolist()) <= FLAG and not converts(unit, "m/s")
    return Series("", name, unit, 0, period, flag, t, value)


def with_lags(found: list[Found], motion: Motion) -> list[Found]:
    """Return what was found, with the lags that the drive shows."""
    samples = np.full((len(motion.t), len(SAMPLED)), np.nan)
    for one in found:
        if (place := INPUT[one.target]) in SAMPLED:
            known = CONVERSIONS[contract_unit(one.target)]
            scale = known[one.unit][0] if one.unit in known else CONVERSIONS["m/s"][one.unit][0] / RADIUS
            values = (motion.values(one.series) * one.factor + one.offset) * scale
            samples[:, SAMPLED.index(place)] = np.where(motion.near(one.series), values, np.nan)
    late = {lag.name: lag for lag in lags(InputSeries(samples)) if abs(lag.seconds) <= LONGEST_LAG_S}

    def mended(one: Found) -> Found:
        lag = late.get(without_corner(one.target))
        return one if lag is None else one._replace(lag=lag.seconds, evidence=f"{one.evidence}; {lag.line}")

    return [mended(one) for one in found]


def column_map_text(
    log: Path, columns: Columns, found: list[Found], timeouts: dict[str, float | None], car: Car
) -> str:
    """Return a proposal as the text of a map of columns; `timeouts` [s] by input, None: the usual one."""
    lines = [
        f"# Proposed from {log.name}: check every line, above all the signs (ISO 8855).",
        "# docs/signal-maps.md explains the keys.",
        "",
    ]
    time = next((name for wanted in TIMES for name in columns.names if name.strip().lower() == wanted), None)
    if time is not None and columns.header is not None:
        known = seconds_of(columns.units.get(time, "")) is not None
        lines.append(
            f'time = "{time}"' + ("" if known else '\ntime_unit = "s"  # CHECK: the file does not say')
        )
    if needs_radius(found):
        lines.append(radius_line(car))
    lines += ["", "[inputs]"]
    for before, one in zip([None, *found], found, strict=False):
        source = f'column = "{one.series.signal}"'
        unit_known = bool(one.series.unit.strip())
        lines += input_lines(one, before, source, timeouts[one.target], unit_known)
    return "\n".join(lines) + "\n"
