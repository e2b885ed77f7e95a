"""What came back from the rig beside what was asked of it (Figure 7.6).

Asked stops are found among those recorded in their order; drags, in which the speed is held, are none. Of
each, the speed asked falls at the deceleration asked, once the torque has built up: by then that both are in
the middle of the drop together, `BUILD_UP` after the first sample at the latest. nRMSE of a block is the root
mean square error of the speed over the mean of the speed asked; ΔE_b the work of the brake over that of the
flywheel asked, minus 1.
"""

from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Array
from brakelab.identify.friction.sequence import Sequence
from brakelab.identify.wear.applications import KMH
from brakelab.identify.wear.programme import Stop, stops_of
from brakelab.results.text_table import Table, cell
from brakelab.results.verdict import Goal, verdict

LARGEST_ERROR: Final = 6.0
"""%, of the speed's nRMSE (section 7.3.2) and of ΔE_b."""
NEAR: Final = 6.0 * KMH
"""m/s within which a recorded stop begins where one was asked to, or `NEAR_SHARE` of it."""
NEAR_SHARE: Final = 0.12
BUILD_UP: Final = 1.0
"""s"""
DRAG: Final = 0.3
"""Of the drop of speed asked: what loses less held its speed."""


class Reproduced(NamedTuple):
    """A block as run beside its programme."""

    block: str
    asked: int
    done: int
    """Stops asked that were run."""
    others: int
    """Stops recorded that nobody asked for, without drags."""
    speed: float
    """nRMSE, %."""
    energy: float
    """ΔE_b, %; NaN: the programme states no mass."""
    road: float
    """(7.21) minus (7.20) over (7.21), %; NaN: the manifest states no energy of the road."""
    heat: float
    """K, median of the disc at the start, over that asked."""

    @property
    def verdict(self) -> str:
        """Return "met", or what was missed and by how much."""
        energy = abs(self.energy) if np.isfinite(self.energy) else 0.0
        return verdict(
            Goal("speed", self.speed if np.isfinite(self.speed) else np.inf, LARGEST_ERROR),
            Goal("ΔE_b", energy, LARGEST_ERROR),
            Goal("stops", float(self.asked - self.done), 0.0),
            Goal("other stops", float(self.others), 0.0),
        )


def reproduced(
    name: str, programme: Sequence, stops: list[dict[str, Array]], radius: float, road: float
) -> Reproduced:
    """Return how well recorded `stops` (columns by name, omega [rad/s]) are those of a programme.

    `radius` of the tyre [m]; `road`: energy of the block on the road [MJ], NaN where not known.
    """
    asked = stops_of(programme)
    pairs, others = _pairs(asked, stops, radius)
    square = mean = work = wanted = 0.0
    starts = []
    for want, stop in pairs:
        t = stop["t"] - stop["t"][0]
        speed, middle = radius * np.abs(stop["omega"]), 0.5 * (want.speed + want.end_speed)
        late = float(t[np.argmax(speed < middle)]) - (want.speed - middle) / want.decel
        braked = np.maximum(t - min(max(late, 0.0), BUILD_UP), 0.0)
        shown = np.maximum(want.speed - want.decel * braked, want.end_speed)
        square += float(np.mean((speed - shown) ** 2)) * t[-1]
        mean += float(shown.mean()) * t[-1]
        work += float(np.trapezoid(np.abs(stop["brake_torque"] * stop["omega"]), t))
        wanted += 0.5 * (want.speed**2 - want.end_speed**2)
        starts.append(stop["disc_temperature"][0] - want.heat)
    seconds = sum(float(stop["t"][-1] - stop["t"][0]) for _, stop in pairs)
    none = float("nan")
    return Reproduced(
        name,
        len(asked),
        len(pairs),
        others,
        100.0 * float(np.sqrt(square / seconds)) / (mean / seconds) if pairs else none,
        100.0 * (work / (programme.mass * wanted) - 1.0) if pairs and programme.mass else none,
        100.0 * (1.0 - road * len(pairs) / len(asked) / (1e-6 * work)) if pairs and work > 0.0 else none,
        float(np.median(starts)) if pairs else none,
    )


def _pairs(
    asked: list[Stop], stops: list[dict[str, Array]], radius: float
) -> tuple[list[tuple[Stop, dict[str, Array]]], int]:
    """Return each stop asked with the one recorded for it, and how many recorded ones are nobody's.

    Most pairs that keep the order of both: a stop that is missing, or too many, does not shift the others.
    """
    least = DRAG * min(stop.speed - stop.end_speed for stop in asked)
    ends = radius * np.abs([(stop["omega"][0], stop["omega"][-1]) for stop in stops]).reshape(-1, 2)
    braked = np.flatnonzero(ends[:, 0] - ends[:, 1] >= least)
    speeds = np.array([stop.speed for stop in asked])[:, None]
    near = np.abs(speeds - ends[braked, 0]) < np.maximum(NEAR, NEAR_SHARE * speeds)
    best = np.zeros((len(asked) + 1, len(braked) + 1), np.int64)
    for i in range(len(asked) - 1, -1, -1):
        for j in range(len(braked) - 1, -1, -1):
            best[i, j] = best[i + 1, j + 1] + 1 if near[i, j] else max(best[i + 1, j], best[i, j + 1])
    pairs, i, j = [], 0, 0
    while i < len(asked) and j < len(braked):
        if near[i, j]:
            pairs.append((asked[i], stops[braked[j]]))
            i, j = i + 1, j + 1
        elif best[i + 1, j] >= best[i, j + 1]:
            i += 1
        else:
            j += 1
    return pairs, len(braked) - len(pairs)


def reproduced_table(blocks: list[Reproduced]) -> Table:
    """Return the blocks beside their programmes."""
    rows = [
        (
            one.block,
            f"{one.done} of {one.asked}",
            f"{one.others}",
            cell(one.speed, ".1f"),
            cell(one.energy, "+.1f"),
            cell(one.road, "+.1f"),
            cell(one.heat, "+.0f"),
            one.verdict,
        )
        for one in blocks
    ]
    return Table(
        "Rig beside programme (Figure 7.6)",
        ("block", "stops", "others", "speed, nRMSE [%]", "ΔE_b, asked [%]", "ΔE_b, road [%]",
         "disc before [K]", "verdict"),
        rows,
        "Goals: nRMSE of the speed and ΔE_b, against the flywheel asked, within "
        f"{LARGEST_ERROR:g} %, every stop and no other. ΔE_b of the road: (7.21) minus (7.20) over (7.21). "
        "Disc before: median over that asked; the law takes the temperatures as they were.",
    )  # fmt: skip
