"""Memory of a watcher: rows to look at, events, lateness, and whole cycles to keep.

A row is the state after every `EVERY`th cycle; its lateness is the worst of the cycles since the row before.
"""

import time
from collections import deque
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.contract.faults import WORDS
from ecu.contract.records import CYCLE, E2E_COUNTS, RecordArray, e2e_counts
from ecu.contract.signals import CORNERS
from ecu.recording.events import EventLog
from ecu.recording.log import Throttle
from ecu.recording.ring import Batch, RingReader
from ecu.watch.inputs import InputRow, input_rows

EVERY: Final = 4  # cycles: 25 rows a second
SHOWN_S: Final = 60.0
REMEMBERED_S: Final = 120.0
"""Of rows: those shown, and as many before them to scroll back to."""
KEPT_S: Final = 300.0
"""Of whole cycles with their frames: 27 MB, and up to 110 MB of frames on a saturated bus."""
EVENTS: Final = 200
LATENESS_US: Final = (20, 50, 100, 200, 500, 1000, 2000, 5000, 10000)
"""Upper edges of the histogram of lateness; later ones are counted behind the last."""

GRIP: Final = ("grip_limit", "sigma_grip_limit")
PLAIN: Final = ("mode", *WORDS, "vehicle_speed", "decel_demand_total", "accel_x_road", *GRIP)
OF_CORNERS: Final = (
    "mu_b",
    "sigma_mu_b",
    "mode_mu_b",
    "pressure_demand",
    "calliper_pressure",
    "disc_temperature",
    "pad_wear",
    "pad_remaining",
)
COLUMNS: Final = (
    "t",  # s on the monotonic clock
    "clock",  # s since 1970
    "lateness",  # us
    "speaks",
    *PLAIN,
    *(f"{name}_{corner}" for name in OF_CORNERS for corner in CORNERS),
)
COLUMN: Final = {name: place for place, name in enumerate(COLUMNS)}

Row = NDArray[np.float64]
"""In the order of `COLUMNS`; NaN: not available."""


class Event(NamedTuple):
    """Something that happened, as in the daemon's log."""

    clock: float
    """Seconds since 1970."""
    text: str
    serious: bool


class _Teller:
    """The log to which `EventLog` writes; `tell` takes a text, whether it is serious, its cycle if known."""

    def __init__(self, tell: Callable[[str, bool, int | None], None]) -> None:
        self._tell = tell

    def info(self, event: str, **content: Any) -> None:
        self._tell(_sentence(event, content), False, content.get("cycle"))

    def warning(self, event: str, **content: Any) -> None:
        self._tell(_sentence(event, content), True, content.get("cycle"))


def frames_text(frames: dict[str, int]) -> str:
    """Return the troubles of protected frames as text."""
    return ", ".join(f"{count} {name}" for name, count in frames.items())


def _counted(content: dict[str, Any]) -> str:
    return f" ({frames_text(content['frames'])})" if "frames" in content else ""


def _sentence(event: str, content: dict[str, Any]) -> str:
    match event:
        case "mode":
            return f"{content['was']} → {content['now']}"
        case "fault":
            return f"{content['fault']}{_counted(content)}: {content['remedy']}"
        case "fault_gone":
            return f"{content['fault']}{_counted(content)}: gone"
        case "missed":
            return f"periods missed: {content['missed']}, in all {content['total']}"
        case "slow":
            took = f"{content['stage']} took {content['took_ms']:.1f} ms"
            return f"slow: {took}, its share is {content['share_ms']:g} ms"
        case "clock_set":
            return f"the machine's clock was set by {content['by_s']:+g} s"
        case "frames_dropped":
            return f"{content['dropped']} frames dropped by the kernel"
        case "ring_overtaken":
            lost = f"{content['lost_cycles']} cycles and {content['lost_frames']} frames"
            return f"this watcher was too slow: {lost} not seen in all"
        case _:
            return event.replace("_", " ")


class History:
    """Memory of one watcher; a run after another goes on in the same rows."""

    def __init__(self) -> None:
        self.rows: deque[Row] = deque(maxlen=round(REMEMBERED_S * 100 / EVERY))
        self.events: deque[Event] = deque(maxlen=EVENTS)
        self.lateness = np.zeros(len(LATENESS_US) + 1, np.int64)
        self.added = 0
        """Rows so far, also those forgotten."""
        self.cycles = self.missed = 0
        self.frames = dict.fromkeys(E2E_COUNTS, 0)
        """Of the run, as its last cycle has them."""
        self.inputs: list[InputRow] = []
        """Likewise."""
        self.batches: deque[Batch] = deque()
        self._held = 0
        self._log: EventLog | None = None
        self._worst_us = 0.0
        self._clock = time.time()
        self._looked = np.empty(0, CYCLE)

    def begin_run(self) -> None:
        """Forget the cycles to keep: a recording is of one run."""
        self.batches.clear()
        self._held = 0
        self._log = None
        self.lateness[:] = 0

    @property
    def kept_s(self) -> float:
        """Return how many seconds could be kept as a recording."""
        return self._held / 100

    def tell(self, text: str, serious: bool = False, cycle: int | None = None) -> None:
        """Note an event now, or in a cycle of those that are looked at."""
        clock = self._clock
        if cycle is not None:
            place = int(np.searchsorted(self._looked["number"], cycle))
            clock = float(_clock_s(self._looked)[place])
        self.events.append(Event(clock, text, serious))

    def take(self, batch: Batch, reader: RingReader) -> None:
        """Add the cycles of `batch`, just read by `reader`."""
        records = batch.records
        if not len(records):
            return
        self._clock = float(_clock_s(records["cycle"])[-1])
        self.cycles = int(records["cycle"]["number"][-1]) + 1
        self.missed = int(records["cycle"]["overruns"][-1])
        self.frames = e2e_counts(records["cycle"][-1:])
        self.inputs = input_rows(reader.latest("watched"))
        self._looked = records["cycle"]
        if self._log is None:
            throttle = Throttle(lambda: 1e-9 * float(self._looked["t_mono_ns"][-1]))
            self._log = EventLog(throttle, _Teller(self.tell), reader.description.get("messages"))
            self._log.begin_after(records[:1], reader.lost_cycles + reader.lost_frames)
        self._log.look(records, reader.lost_cycles, reader.lost_frames)
        late_us = records["cycle"]["lateness_ns"] * 1e-3
        places = np.searchsorted(LATENESS_US, late_us)
        self.lateness += np.bincount(places, minlength=len(self.lateness))
        self._add_rows(records, late_us)
        self.batches.append(batch)
        self._held += len(records)
        while self._held - len(self.batches[0].records) >= 100 * KEPT_S:
            self._held -= len(self.batches.popleft().records)

    def _add_rows(self, records: RecordArray, late_us: Row) -> None:
        begin = 0
        for end in np.flatnonzero(records["cycle"]["number"] % EVERY == EVERY - 1):
            worst = max(self._worst_us, float(late_us[begin : end + 1].max()))
            self.rows.append(_row(records[end : end + 1], worst))
            self.added += 1
            self._worst_us, begin = 0.0, int(end) + 1
        if begin < len(records):
            self._worst_us = max(self._worst_us, float(late_us[begin:].max()))


def _clock_s(cycles: RecordArray) -> Row:
    """Return the machine's clock [s since 1970] at T_k."""
    return 1e-9 * (cycles["t_ns"] + cycles["clock_set_ns"])


def _row(record: RecordArray, worst_us: float) -> Row:
    cycle, outputs = record["cycle"], record["outputs"]
    return np.concatenate(
        [
            cycle["t_mono_ns"] * 1e-9,
            _clock_s(cycle),
            [worst_us],
            cycle["speaks"],
            *(outputs[name] for name in PLAIN),
            *(outputs[name][0] for name in OF_CORNERS),
        ]
    )
