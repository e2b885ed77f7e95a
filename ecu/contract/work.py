"""What a workshop does to what a running ECU has learned: a record for the loop, JSON for a recording."""

from collections.abc import Mapping
from enum import IntEnum
from typing import Any, Final, NamedTuple

import numpy as np

from ecu.contract.records import RecordArray, new_record
from ecu.contract.signals import CORNERS

WORK: Final = np.dtype(
    [
        ("kind", "i8"),  # 0: none
        ("wear", "f8", (4,)),  # of each corner's pads [mm], NaN: untouched
    ]
)


class Kind(IntEnum):
    """What is done."""

    NEW_PADS = 1
    MEASURED_PADS = 2
    FORGET = 3


class Work(NamedTuple):
    """What is done, and on which corners."""

    kind: Kind
    wear: Mapping[str, float] = {}
    """Wear of pads [mm] by corner, 0 of new ones."""


def to_record(work: Work | None) -> RecordArray:
    """Return `WORK`, shape (1,)."""
    record = new_record(WORK)
    if work is not None:
        record["kind"] = work.kind
        record["wear"] = [work.wear.get(corner, np.nan) for corner in CORNERS]
    return record


def from_record(record: RecordArray) -> Work | None:
    """Return what is in one `WORK`, None: nothing that is known."""
    if record["kind"] not in tuple(Kind):
        return None
    wear = zip(CORNERS, record["wear"].tolist(), strict=True)
    return Work(Kind(int(record["kind"])), {corner: lost for corner, lost in wear if np.isfinite(lost)})


def to_json(work: Work) -> dict[str, Any]:
    """Return it as a recording and the log name it."""
    return {"kind": work.kind.name.lower(), "wear": dict(work.wear)}


def from_json(found: dict[str, Any] | None) -> Work | None:
    """Return what `to_json` described. Raises KeyError, TypeError, ValueError."""
    if found is None:
        return None
    wear = {corner: float(lost) for corner, lost in found["wear"].items()}
    return Work(Kind[found["kind"].upper()], wear)
