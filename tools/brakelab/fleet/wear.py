"""Wear and dust of a fleet: who needs pads when, mg/km and particles/km, after each vehicle's last drive."""

import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from brakelab.fleet.manifest import FITTED
from brakelab.fleet.statistics import Summary
from brakelab.fleet.summary import known
from brakelab.results.brakes import BrakeRow
from brakelab.results.pads import PadState, filled, packed, pads_of
from brakelab.results.prediction import corners
from ecu.contract.records import RecordArray
from ecu.contract.signals import OUTPUT
from ecu.errors import UserError
from ecu.pads import fit_new, measure, parse_measured
from ecu.pads import pads as linings_of
from ecu.settings.config import Config

_TEXT, _NUMBER = pa.string(), pa.float64()
_COLUMNS: Final[tuple[tuple[str, pa.DataType, str], ...]] = (
    ("vehicle", _TEXT, "-"),
    ("corner", _TEXT, "-"),
    ("drive", _TEXT, "-"),
    ("thickness", _NUMBER, "mm"),
    ("sigma", _NUMBER, "mm"),
    ("mass", _NUMBER, "g"),
    ("driven", _NUMBER, "km"),
    ("remaining", _NUMBER, "km"),
    ("remaining_low", _NUMBER, "km"),
    ("remaining_high", _NUMBER, "km"),
    ("scale", _NUMBER, "-"),
    ("measurements", pa.int32(), "-"),
    ("told", pa.bool_(), "-"),
    ("thickness_worn", _NUMBER, "mm"),
    ("particle_mass_per_km", _NUMBER, "mg/km"),
    ("particles_per_km", _NUMBER, "1/km"),
)
PADS_SCHEMA: Final = pa.schema([pa.field(name, kind, metadata={"unit": u}) for name, kind, u in _COLUMNS])
"""Of `pads.parquet`, a row a vehicle and corner, after its last drive. The last two are the vehicle's."""


class Due(NamedTuple):
    """One vehicle and its pads that are due first; NaN: not known."""

    vehicle: str
    pad: PadState
    per_distance: float
    """Wear, mm per 1,000 km."""
    mass: float
    """Of particles, mg/km, all linings since they were fitted."""
    particles: float
    """Per km since the emission models count."""


def register_pads(learned: RecordArray, config: Config, text: str, where: str) -> None:
    """Write the work on the pads before a drive into `learned`, LEARNED of shape (1,).

    Raises:
        UserError: a measured lining is thicker than before.
    """
    wear = learned[0]["wear"]
    if text in FITTED:
        for axle in FITTED[text]:
            fit_new(wear, axle)
        return
    for i, thickness in parse_measured(text).items():
        try:
            measure(wear, linings_of(config)[i], i, thickness)
        except UserError as error:
            raise UserError(
                where, f"pads {error.place}", error.remedy.replace("--new-pads", "pads")
            ) from None


def wear_summary(
    params: RecordArray,
    learned: RecordArray,
    config: Config,
    last: NDArray[np.float64],
    brakings: Sequence[BrakeRow],
) -> dict[str, Any]:
    """Return a drive's part of the summary: `last` is its last row, shape (N_ROW,)."""
    worn = np.isfinite(corners(last, "pad_wear"))
    pads = [pad for pad, has in zip(pads_of(params, learned, config), worn, strict=True) if has]
    return {
        "pads": packed(pads),
        "pad_wear_mass": float(np.nansum([row.pad_wear_mass for row in brakings])) if pads else None,
        **{name: known(float(last[OUTPUT[name]])) for name in ("particle_mass_per_km", "particles_per_km")},
    }


def _last_drives(done: Sequence[Summary]) -> dict[str, Summary]:
    """Return the last drive of each vehicle that states its pads."""
    return {row["vehicle"]: row for row in done if row.get("pads")}


def pads_table(done: Sequence[Summary]) -> pa.Table:
    """Return a row for each vehicle and corner; `done` in the order of driving."""
    rows = [
        {name: (row | pad).get(name) for name, *_ in _COLUMNS}
        for row in map(dict, _last_drives(done).values())
        for pad in row["pads"]
    ]
    return pa.Table.from_pylist(rows, PADS_SCHEMA)


def pads_due(done: Sequence[Summary]) -> list[Due]:
    """Return the vehicles, the one that needs pads first at the front, those not known yet at the end."""
    found = []
    for vehicle, row in _last_drives(done).items():
        pad = min(filled(row["pads"]), key=_order)
        left = pad.thickness - pad.thickness_worn
        rate = 1e3 * left / pad.remaining if pad.remaining > 0.0 else math.nan
        mass, particles = (
            math.nan if row[name] is None else float(row[name])
            for name in ("particle_mass_per_km", "particles_per_km")
        )
        found.append(Due(vehicle, pad, rate, mass, particles))
    return sorted(found, key=lambda due: (_order(due.pad), due.vehicle))


def _order(pad: PadState) -> tuple[float, float]:
    return (pad.remaining if math.isfinite(pad.remaining) else math.inf, pad.thickness)
