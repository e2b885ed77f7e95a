"""Recording of a dynamometer: CSV or Parquet, with a file of columns beside it."""

from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Vector
from brakelab.identify.friction.columns import Columns, Uncertainty, columns_text
from brakelab.plant.linings import Lining
from ecu.errors import UserError

RATE: Final = 200.0  # Hz (3.2)
THRESHOLD: Final = 0.5e5  # Pa: pressure below which the pads do not touch. SAE J2522, as 3.5 has it
NAMES: Final = ("time", "pressure", "torque", "speed", "temperature")
HEADER: Final = ("time_s", "pressure_bar", "torque_Nm", "speed_km_h", "disc_temperature_C")


class Recording(NamedTuple):
    """Samples in the order of time; equal shapes (samples,)."""

    time: Vector  # s
    pressure: Vector  # Pa, of the line
    torque: Vector  # N m, of both pads, positive
    speed: Vector  # rad/s, of the disc, positive
    temperature: Vector  # degC, of the disc


def joined(parts: list[Recording]) -> Recording:
    """Return recordings one after the other."""
    return Recording(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def check_name(path: Path) -> None:
    """Refuse a `path` that `write_recording` cannot write. Raises UserError."""
    if path.suffix not in (".csv", ".parquet"):
        raise UserError(str(path), "", "give a name that ends in .csv or .parquet")


def write_recording(
    path: Path,
    recording: Recording,
    lining: Lining,
    inertia: float,
    uncertainty: Uncertainty | None = None,
) -> Path:
    """Write `path` (.csv or .parquet), and beside it PATH.toml, which names columns, units and the brake.

    `inertia` [kg m^2] is that of the flywheel, `uncertainty` that of its sensors. Returns the second file.

    Raises:
        UserError: the ending of `path` is neither.
    """
    check_name(path)
    factors = (1.0, 1e-5, 1.0, 3.6 * lining.brake.tyre_radius, 1.0)
    digits = (3, 3, 1, 3, 2)
    columns = [
        np.round(values * factor, places)
        for values, factor, places in zip(recording, factors, digits, strict=True)
    ]
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".csv":
        formats = ",".join(f"%.{places}f" for places in digits)
        text = "\n".join(formats % row for row in zip(*(c.tolist() for c in columns), strict=True))
        path.write_text(f"{','.join(HEADER)}\n{text}\n", encoding="utf-8")
    else:
        import pyarrow as pa
        import pyarrow.parquet as pq

        pq.write_table(pa.table(dict(zip(HEADER, columns, strict=True))), path, compression="zstd")
    beside = path.with_suffix(".toml")
    beside.write_text(columns_text(Columns.own(lining, inertia, uncertainty)), encoding="utf-8")
    return beside
