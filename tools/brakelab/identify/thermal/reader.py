"""Drives with measured disc temperatures, through the ECU: friction power, speed, rain, air and temperature.

The logs are run twice in their order: what the first run learns of friction, the second begins with, as the
car does that brings the logs. Torque and speed are the ECU's own.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Array
from brakelab.identify.thermal.model import ROW, Series
from brakelab.logs.physics.samples import KEPT
from brakelab.replay.engine import new_ecu
from brakelab.replay.log import log_size, replay_log
from brakelab.replay.quality import Findings
from brakelab.replay.source import announced, load_source
from brakelab.results.progress import progress_bar
from ecu.contract.records import RecordArray
from ecu.contract.signals import (
    AMBIENT_TEMPERATURE,
    CALLIPER_PRESSURE,
    CYCLE_NS,
    DISC_TEMPERATURE_MEASURED,
    OUTPUT,
    RAIN,
    WHEEL_SPEED,
)
from ecu.settings.config import Config, new_params

CYCLES: Final = round(1e9 * ROW / CYCLE_NS)
HELD: Final = 100  # cycles that a wheel speed or a pressure stays good for

USED: Final = (
    *(OUTPUT["vehicle_speed"], OUTPUT["braking"]),
    *range(OUTPUT["brake_torque_fl"], OUTPUT["brake_torque_fl"] + 4),
    *range(OUTPUT["mu_b_fl"], OUTPUT["mu_b_fl"] + 4),
    *range(OUTPUT["sigma_mu_b_fl"], OUTPUT["sigma_mu_b_fl"] + 4),
)
"""Outputs that are kept."""
_SPEED, _BRAKING, _TORQUE, _MU, _SIGMA = 0, 1, 2, 6, 10


class ThermalLog(NamedTuple):
    """One log."""

    path: Path
    series: Series
    friction_error: Array
    """Relative standard deviation of the ECU's friction, shape (n, 4)."""
    applications: int
    wheels_seen: Array
    """Share of the cycles with a wheel speed, shape (4,)."""
    pressures_seen: Array
    """Share of the cycles with a calliper pressure, shape (4,)."""
    rain_known: bool


def _held(values: Array, first: Array) -> Array:
    """Return columns whose NaN hold the last value, before the first one `first`, shape (n, k)."""
    known = np.isfinite(values)
    last = np.maximum.accumulate(np.where(known, np.arange(len(values))[:, None], -1), axis=0)
    found = np.take_along_axis(values, np.maximum(last, 0), axis=0)
    return np.where(last >= 0, found, first)


def _fresh(values: Array) -> NDArray[np.bool_]:
    """Return where a column has a value at most `HELD` cycles old, shape (n, k)."""
    places = np.arange(len(values))[:, None]
    last = np.maximum.accumulate(np.where(np.isfinite(values), places, -HELD - 1), axis=0)
    return np.asarray(places - last <= HELD)


def _means(values: Array) -> Array:
    """Return the means of rows of `CYCLES` cycles without NaN, shape (rows, …)."""
    whole = values[: len(values) // CYCLES * CYCLES]
    parts = whole.reshape(-1, CYCLES, *values.shape[1:])
    known = np.isfinite(parts)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(known, parts, 0.0).sum(axis=1) / known.sum(axis=1))


def _place(signal: int) -> int:
    return KEPT.index(signal)


def as_drive(path: Path, outputs: Array, samples: Array, air: float) -> ThermalLog:
    """Return a log from its cycles.

    Args:
        path: of the log.
        outputs: `USED`, shape (n, len(USED)).
        samples: of `KEPT`, NaN in a cycle without one, shape (n, len(KEPT)).
        air: degC, where none is measured.
    """

    def four(rows: Array, first: int) -> Array:
        return rows[:, first : first + 4]

    wheels = four(samples, _place(WHEEL_SPEED))
    braking = outputs[:, _BRAKING] == 1.0
    power = np.where(braking[:, None], four(outputs, _TORQUE) * np.abs(_held(wheels, np.zeros(4))), 0.0)
    around = samples[:, [_place(AMBIENT_TEMPERATURE), _place(RAIN)]]
    known = np.isfinite(around)
    first = [around[known[:, k], k][0] if known[:, k].any() else (air, 0.0)[k] for k in range(2)]
    around = _held(around, np.array(first))
    series = Series(
        path.name,
        _means(np.nan_to_num(power)),
        _means(np.abs(np.nan_to_num(outputs[:, _SPEED]))),
        _means(around[:, 1]) > 0.5,
        _means(around[:, 0]),
        bool(known[:, 0].any()),
        _means(four(samples, _place(DISC_TEMPERATURE_MEASURED))),
    )
    return ThermalLog(
        path,
        series,
        np.nan_to_num(_means(four(outputs, _SIGMA) / four(outputs, _MU))),
        int(np.count_nonzero(np.diff(braking.astype(np.int8)) > 0)),
        _fresh(wheels).mean(axis=0),
        _fresh(four(samples, _place(CALLIPER_PRESSURE))).mean(axis=0),
        bool(known[:, 1].any()),
    )


def read_drives(logs: Sequence[Path], config: Config, map: Path | None) -> list[ThermalLog]:
    """Return the drives of `logs`, whose frames `map` describes (None: the ECU's own database).

    Raises:
        UserError: a log or the map is not right.
    """
    source, params = announced(load_source(map)), new_params(config)
    learned: RecordArray | None = None
    drives: list[ThermalLog] = []
    with progress_bar("identify thermal", 2 * sum(log_size(path) for path in logs)) as advance:
        for learns in (True, False):
            for path in logs:
                ecu = new_ecu(params.copy(), learned)
                kept = [
                    (rows.values[:, USED].astype(np.float32), rows.samples.astype(np.float32))
                    for rows in replay_log(path, ecu, source, None, Findings(path), advance)
                    if not learns
                ]
                learned = ecu.state["learned"].copy()
                if not learns:
                    outputs, samples = (
                        np.concatenate(part).astype(np.float64) for part in zip(*kept, strict=True)
                    )
                    drives.append(as_drive(path, outputs, samples, config.vehicle.ambient_temperature))
    return drives
