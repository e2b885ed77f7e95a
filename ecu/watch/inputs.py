"""What the others say of each input, as the last cycle of a ring has it."""

import math
from typing import NamedTuple

from ecu.contract.records import WATCHED, RecordArray
from ecu.contract.signals import INPUT_SIGNALS


class InputRow(NamedTuple):
    """One input, in its unit; NaN: it is not usable, or was never compared."""

    name: str
    unit: str
    value: float
    """As received."""
    innovation: float
    sigma: float
    ratio: float
    """Test ratio, 1 at the gate."""
    judged_s: float
    """Age of the comparison."""
    rejected: bool
    unused_s: float
    """Since it was used, inf: never."""


def input_rows(watched: RecordArray | None) -> list[InputRow]:
    """Return the watched inputs of `INPUT_WATCH`, shape (1,); those that never came are left out."""
    if watched is None:
        return []
    row = watched[0]
    rows = [
        InputRow(
            INPUT_SIGNALS[place].name,
            INPUT_SIGNALS[place].unit,
            value=float(row["value"][place]),
            innovation=float(row["innovation"][place]),
            sigma=float(row["sigma"][place]),
            ratio=float(row["ratio"][place]),
            judged_s=float(row["judged_s"][place]),
            rejected=bool(row["rejected"][place]),
            unused_s=float(row["unused_s"][place]),
        )
        for place in WATCHED
    ]
    return [row for row in rows if math.isfinite(row.value) or math.isfinite(row.unused_s)]
