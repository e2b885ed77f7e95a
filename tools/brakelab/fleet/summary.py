"""Summary of a drive, a line of `drives.parquet`, collected while its rows are written."""

import math
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any, Final

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from brakelab.replay.quality import Findings
from brakelab.replay.summary import errors_of, judged
from brakelab.results.brakes import LEARNED, BrakeBook
from brakelab.results.prediction import corners
from ecu.contract.records import RecordArray
from ecu.contract.signals import CORNERS, CYCLE_NS, HOLDING, OBSERVING, OUTPUT

_PERIOD: Final = 1e-9 * CYCLE_NS  # s

_TEXT: Final = pa.string()
_COLUMNS: Final[tuple[tuple[str, pa.DataType, str], ...]] = (
    ("vehicle", _TEXT, "-"),
    ("drive", _TEXT, "-"),
    ("fault", _TEXT, "-"),
    ("start_time", pa.timestamp("ns", "UTC"), "-"),
    ("duration", pa.float64(), "s"),
    ("distance", pa.float64(), "m"),
    ("brakings", pa.int32(), "-"),
    ("learned", pa.int32(), "-"),
    ("predicted", pa.int32(), "-"),
    ("prediction_error", pa.float64(), "-"),
    ("prediction_bias", pa.float64(), "-"),
    ("brake_energy", pa.float64(), "J"),
    ("mu_b_front", pa.float64(), "-"),
    ("sigma_mu_b_front", pa.float64(), "-"),
    ("mu_b_rear", pa.float64(), "-"),
    ("sigma_mu_b_rear", pa.float64(), "-"),
    ("pad_wear_mass", pa.float64(), "g"),
    ("particle_mass_per_km", pa.float64(), "mg/km"),
    ("particles_per_km", pa.float64(), "1/km"),
    ("degraded", pa.float64(), "s"),
    ("notes", _TEXT, "-"),
    ("logs", _TEXT, "-"),
    ("sha256", _TEXT, "-"),
    ("config_hash", _TEXT, "-"),
    ("database_hash", _TEXT, "-"),
    ("observer", _TEXT, "-"),
    ("version", _TEXT, "-"),
    ("tries", pa.int32(), "-"),
    ("replay_seconds", pa.float64(), "s"),
)
SUMMARY_SCHEMA: Final = pa.schema(
    [pa.field(name, kind, metadata={"unit": unit}) for name, kind, unit in _COLUMNS]
)
"""Of `drives.parquet`. `fault` is empty for a drive that is done; `learned` counts applications that taught
at least one corner, `predicted` those whose prediction counts; friction is that at the end of the drive.
Emissions per km are of the life of the pads, and since the models count; `pad_wear_mass` is the drive's."""


class DriveBook:
    """Collector of the brake applications of a drive and other data for the summary."""

    def __init__(self, params: RecordArray) -> None:
        self.brakes = BrakeBook(params)
        self._rows = 0
        self._metres = 0.0
        self.last: NDArray[np.float64] = np.empty(0)
        """The last row, shape (N_ROW,)."""

    def add(self, t: NDArray[np.float64], rows: NDArray[np.float64]) -> None:
        """Add rows: `t` [s], shape (n,), and shape (n, N_ROW)."""
        self.brakes.add(t, rows)
        self._rows += len(t)
        self._metres += float(np.nan_to_num(rows[:, OUTPUT["vehicle_speed"]]).sum()) * _PERIOD
        self.last = rows[-1].copy()

    def summary(self, findings: Sequence[Findings]) -> dict[str, Any]:
        """Return the columns derived from the rows and the logs."""
        brakings = self.brakes.rows
        applications = [brakings[k : k + 4] for k in range(0, len(brakings), len(CORNERS))]
        found = errors_of(judged(brakings))
        return {
            "start_time": findings[0].began_ns,
            "duration": self._rows * _PERIOD,
            "distance": self._metres,
            "brakings": len(applications),
            "learned": sum(any(row.learning == LEARNED for row in four) for four in applications),
            "predicted": found.counted,
            "prediction_error": known(found.median),
            "prediction_bias": known(found.bias),
            "brake_energy": float(np.nansum([row.brake_energy for row in brakings])),
            **self._friction(),
            "degraded": sum(found.faulty_rows for found in findings) * _PERIOD,
        }

    def _friction(self) -> dict[str, float | None]:
        columns: dict[str, float | None] = {}
        mode = corners(self.last, "mode")
        for axle, wheels in (("front", slice(0, 2)), ("rear", slice(2, 4))):
            learned = np.isin(mode[wheels], (OBSERVING, HOLDING)).all()
            for name in ("mu_b", "sigma_mu_b"):
                mean = float(corners(self.last, name)[wheels].mean())
                columns[f"{name}_{axle}"] = known(mean) if learned else None
        return columns


def known(value: float) -> float | None:
    """Return a number, None for NaN: null in Parquet."""
    return None if math.isnan(value) else value


def summary_table(rows: Sequence[dict[str, Any]]) -> pa.Table:
    """Return summaries as a table; missing values are null."""
    return pa.Table.from_pylist(
        [{name: row.get(name) for name, *_ in _COLUMNS} for row in rows], SUMMARY_SCHEMA
    )


def when(start_ns: int) -> str:
    """Return a time as text."""
    return datetime.fromtimestamp(start_ns // 10**9, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
