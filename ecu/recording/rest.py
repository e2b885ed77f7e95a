"""Disc temperatures after a rest of known length.

The store knows when it was last written, which is after the last braking. Heat decays by delta_0 at least;
half of it is assumed, since a warm garage is not in the model. A clock that was set back, or not yet set,
tells nothing.
"""

import math
from datetime import UTC, datetime
from typing import Final

from ecu.contract.records import RecordArray

SLOWER: Final = 0.5
"""Of the cooling rate at standstill."""
CLOCK_SET: Final = 1.7e9
"""Unix time [s], November 2023: a clock before that was never set."""
STAMP: Final = "%Y-%m-%dT%H:%M:%SZ"


def rest_of(saved_at: str, now: float) -> float:
    """Return the time [s] since the store was written, 0 if one of the clocks was not right.

    `saved_at` as the store writes it, `now` Unix time [s].
    """
    try:
        then = datetime.strptime(saved_at, STAMP).replace(tzinfo=UTC).timestamp()
    except ValueError:
        return 0.0
    return max(now - then, 0.0) if then > CLOCK_SET else 0.0


def cool_discs(learned: RecordArray, params: RecordArray, rest: float) -> None:
    """Lower the greatest excess of the discs over the air by a rest of `rest` [s]."""
    for i in range(4):
        rate = SLOWER * float(params[0]["disc_cooling"][i])
        learned[0]["disc_excess"][i] *= math.exp(-rate * rest)
