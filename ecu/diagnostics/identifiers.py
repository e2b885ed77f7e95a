"""Data identifiers (ISO 14229-1, service 0x22): what a tester can read, and how it is written in bytes.

A measured quantity is the raw code of a signal of dbc/brake_ecu.dbc, with its factor, offset, range and
code for "not available", in whole bytes, most significant first; four of them, fl fr rl rr, where the
quantity has corners. The same numbers and bytes make a snapshot.
"""

from collections.abc import Mapping
from functools import cache
from typing import Final, NamedTuple

import numpy as np

from ecu.bus.bits import SIGNED
from ecu.bus.database import load_database
from ecu.bus.plan import not_available_code, signal_row
from ecu.contract.records import RecordArray
from ecu.contract.signals import CORNERS, OUTPUT_SIGNALS
from ecu.settings.resources import resource


class Scaling(NamedTuple):
    """How a number becomes bytes: value = scale · raw + offset."""

    scale: float
    offset: float
    low: int
    high: int
    bytes: int
    signed: bool = False
    not_available: int | None = None


class Identifier(NamedTuple):
    """A quantity that can be read."""

    number: int
    name: str
    """Field of OUTPUTS, or of what `measured` adds."""
    like: str = ""
    """Signal of the database whose scaling it has; of corner quantities without the corner."""
    scaling: Scaling | None = None
    """Where the database has none."""


PAD_THICKNESS: Final = Identifier(
    0x0118, "pad_thickness", scaling=Scaling(0.01, 0.0, 0, 0xFFFE, 2, not_available=0xFFFF)
)
"""Of the linings; it is written, too: what a workshop measured, "not available" where it did not."""
_COUNT: Final = Scaling(1.0, 0.0, 0, (1 << 32) - 1, 4)
MEASURED: Final = (
    Identifier(0x0100, "mode", "mode"),
    Identifier(0x0101, "active_faults", "active_faults"),
    Identifier(0x0102, "active_faults_2", "active_faults_2"),
    Identifier(0x0103, "vehicle_speed", "vehicle_speed"),
    Identifier(0x0104, "decel_demand_total", "decel_demand"),
    Identifier(0x0105, "accel_x_road", "accel_x"),
    Identifier(0x0106, "grip_limit", "decel_demand"),
    Identifier(0x0107, "sigma_grip_limit", "decel_demand"),
    Identifier(0x0108, "overruns", "overruns"),
    Identifier(0x0109, "worst_lateness_us", "worst_lateness_us"),
    Identifier(0x0110, "mu_b", "mu_b"),
    Identifier(0x0111, "sigma_mu_b", "sigma_mu_b"),
    Identifier(0x0112, "mode_mu_b", "mode"),
    Identifier(0x0113, "pressure_demand", "pressure_demand"),
    Identifier(0x0114, "calliper_pressure", "calliper_pressure"),
    Identifier(0x0115, "disc_temperature", "disc_temperature"),
    Identifier(0x0116, "pad_wear", "pad_wear"),
    Identifier(0x0117, "pad_remaining", "pad_remaining"),
    PAD_THICKNESS,
    Identifier(0x0120, "clock", scaling=Scaling(0.001, 0.0, 0, (1 << 48) - 1, 6)),
    Identifier(0x0121, "t", scaling=Scaling(0.001, 0.0, 0, (1 << 48) - 1, 6)),
    Identifier(0x0122, "lateness", scaling=_COUNT),
    Identifier(0x0123, "speaks", scaling=Scaling(1.0, 0.0, 0, 1, 1)),
    Identifier(0x0124, "cycles", scaling=_COUNT),
)
BY_NAME: Final = {one.name: one for one in MEASURED}
BY_NUMBER: Final = {one.number: one for one in MEASURED}
UNITS: Final = {
    **{signal.name: signal.unit for signal in OUTPUT_SIGNALS},
    "pad_thickness": "mm",
    "clock": "s since 1970",
    "t": "s",
    "lateness": "us",
    "speaks": "-",
    "cycles": "-",
}

SESSION: Final = 0xF186
"""ActiveDiagnosticSession; the others of 0xF1… are text."""
TEXTS: Final = {
    0xF189: "software",
    0xF197: "system",
    0xF1A0: "configuration",
    0xF1A1: "vehicle",
}
"""Software version, system name; of the manufacturer's range: hash and vehicle of the configuration."""

OF_SNAPSHOT: Final = tuple(
    BY_NAME[name]
    for name in ("clock", "vehicle_speed", "decel_demand_total", "mode", "calliper_pressure", "mu_b")
)

_OF_CORNERS: Final = {signal.name for signal in OUTPUT_SIGNALS if signal.corners} | {PAD_THICKNESS.name}


def has_corners(one: Identifier) -> bool:
    """Return whether a quantity has four values."""
    return one.name in _OF_CORNERS


@cache
def _signals() -> dict[str, Scaling]:
    """Return the scaling of every signal of the database."""
    found = {}
    for message in load_database(resource("dbc/brake_ecu.dbc")).messages:
        for signal in message.signals:
            row = signal_row(signal)[0]
            found[signal.name] = Scaling(
                float(row["scale"]),
                float(row["offset"]),
                int(row["raw_low"]),
                int(row["raw_high"]),
                -(-int(row["length"]) // 8),
                bool(row["kind"] == SIGNED),
                not_available_code(signal),
            )
    return found


def scaling_of(one: Identifier) -> Scaling:
    """Return how a quantity is written."""
    return one.scaling or _signals()[f"{one.like}_{CORNERS[0]}" if has_corners(one) else one.like]


def length_of(one: Identifier) -> int:
    """Return the bytes of a quantity."""
    return scaling_of(one).bytes * (len(CORNERS) if has_corners(one) else 1)


def to_bytes(one: Identifier, values: Mapping[str, "np.ndarray | float"]) -> bytes:
    """Return a quantity as bytes; NaN as "not available", or 0 where there is no code for it."""
    scaling, text = scaling_of(one), b""
    for value in np.atleast_1d(values[one.name]).tolist():
        if np.isfinite(value):
            raw = min(max(round((value - scaling.offset) / scaling.scale), scaling.low), scaling.high)
        else:
            raw = scaling.not_available or 0
        text += raw.to_bytes(scaling.bytes, "big", signed=scaling.signed)
    return text


def to_values(one: Identifier, text: bytes) -> list[float | None]:
    """Return the values in bytes of `to_bytes`, None: not available."""
    scaling, values = scaling_of(one), []
    for begin in range(0, len(text), scaling.bytes):
        raw = int.from_bytes(text[begin : begin + scaling.bytes], "big", signed=scaling.signed)
        known = raw != scaling.not_available
        values.append(round(scaling.scale * raw + scaling.offset, 9) if known else None)
    return values


def measured(
    record: RecordArray, new_pads: "np.ndarray | float" = np.nan
) -> Mapping[str, "np.ndarray | float"]:
    """Return the quantities of one cycle (`RECORDED`, shape (1,)) by name; `new_pads`: thickness [mm]."""
    cycle, outputs = record["cycle"][0], record["outputs"][0]
    return {
        **{one.name: outputs[one.name] for one in MEASURED if one.name in outputs.dtype.names},
        PAD_THICKNESS.name: new_pads - outputs["pad_wear"],
        "clock": 1e-9 * float(cycle["t_ns"] + cycle["clock_set_ns"]),
        "t": 1e-9 * float(cycle["t_mono_ns"]),
        "lateness": 1e-3 * float(cycle["lateness_ns"]),
        "speaks": float(cycle["speaks"]),
        "cycles": float(cycle["number"] + 1),
    }


def snapshot(record: RecordArray) -> bytes:
    """Return what is stored with a trouble code: of each of `OF_SNAPSHOT` its number and its bytes."""
    values = measured(record)
    return b"".join(one.number.to_bytes(2, "big") + to_bytes(one, values) for one in OF_SNAPSHOT)


def snapshot_values(text: bytes) -> dict[str, list[float | None]]:
    """Return the quantities in a snapshot by name, as far as they are known here."""
    found, at = {}, 0
    while at + 2 <= len(text):
        one = BY_NUMBER.get(int.from_bytes(text[at : at + 2], "big"))
        if one is None:
            break
        end = at + 2 + length_of(one)
        found[one.name] = to_values(one, text[at + 2 : end])
        at = end
    return found
