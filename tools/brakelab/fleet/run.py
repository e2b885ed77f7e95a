"""The drives of every vehicle in order, different vehicles side by side.

A vehicle has one drive with the workers at a time: the learned values of one go into the next. A failed drive
teaches nothing, and the next starts with the values before it. So the workers hold a few drives each at most,
independent of their number; vehicles with the longest remaining distance come first.
"""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field
from heapq import heapify, heappop, heappush
from pathlib import Path
from typing import Any, Final, NamedTuple

from brakelab.fleet.cluster import Workers
from brakelab.fleet.job import Job, Outcome, failed
from brakelab.fleet.manifest import VehicleDrive
from brakelab.fleet.output import keep, page_file, rows_file, standing
from brakelab.fleet.task import replay_job
from brakelab.replay.source import Source
from ecu.errors import RunFault
from ecu.settings.config import Config, store_key

TRIES: Final = 3
"""After so many lost workers the drive is held to be the cause."""
COUNT_S: Final = 2.0
"""Between looks at how many workers there are."""


Task = Callable[[Job], Outcome]


class Planned(NamedTuple):
    """A drive with the information available before its replay."""

    drive: VehicleDrive
    config: Config
    source: Source
    size: int
    """Of its logs, bytes."""
    mark: str
    """Changes with the content of its logs."""
    fault: str
    """Why it cannot be replayed, empty if nothing is known against it."""


@dataclass
class Chain:
    """The drives of one vehicle, in order, and the progress."""

    drives: list[Planned] = field(default_factory=list)
    left: int = 0
    """Bytes to go."""
    place: int = 0
    learned: dict[str, bytes] = field(default_factory=dict)
    """Learned values, by the brakes they belong to: other brakes start anew, as in the state store."""
    tries: int = 1

    def add(self, planned: Planned) -> None:
        """Append a drive."""
        self.drives.append(planned)
        self.left += planned.size

    def job(self, out: Path, rows: bool) -> Job:
        """Return the job of the next drive."""
        drive, config, source, _, mark, _ = self.drives[self.place]
        names = drive.vehicle, drive.name
        files = (str(rows_file(out, *names)), str(page_file(out, *names))) if rows else ("", "")
        learned = self.learned.get(store_key(config), b"")
        return Job(*names, drive.logs, config, source, learned, mark, *files, drive.pads)

    def finish(self, outcome: Outcome) -> dict[str, Any]:
        """Go to the next drive; return the summary of this one."""
        planned = self.drives[self.place]
        self.learned[store_key(planned.config)] = outcome.learned
        summary = outcome.summary | {"tries": outcome.summary.get("tries", self.tries)}
        self.place, self.tries, self.left = self.place + 1, 1, self.left - planned.size
        return summary


def run_fleet(
    workers: Workers,
    chains: Sequence[Chain],
    out: Path,
    rows: bool = False,
    task: Task = replay_job,
) -> Iterator[tuple[Planned, dict[str, Any], bool]]:
    """Yield each drive, its summary and whether it was replayed just now, as they are completed.

    Raises:
        RunFault: the scheduler was lost.
    """
    ready = [(-chain.left, number, chain) for number, chain in enumerate(chains)]
    heapify(ready)
    running: dict[Future[Outcome], tuple[int, Chain, Job]] = {}
    room, counted = 1, -math.inf
    while ready or running:
        if time.monotonic() > counted + COUNT_S:
            room, counted = workers.room(), time.monotonic()
        while ready and len(running) < room:
            _, number, chain = heappop(ready)
            for planned, summary in _skip(chain, out, rows):
                yield planned, summary, False
            if chain.place == len(chain.drives):
                continue
            job = chain.job(out, rows)
            running[workers.executor.submit(task, job)] = number, chain, job
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            number, chain, job = running.pop(future)
            outcome = _outcome(future, job, workers.died)
            if outcome is None and chain.tries < TRIES:
                chain.tries += 1
            else:
                planned = chain.drives[chain.place]
                outcome = outcome or failed(job, f"{job.logs[0]}: killed {TRIES} workers; is it too large?")
                outcome.summary["tries"] = chain.tries
                keep(out, outcome)
                yield planned, chain.finish(outcome), True
            heappush(ready, (-chain.left, number, chain))


def _skip(chain: Chain, out: Path, rows: bool) -> Iterator[tuple[Planned, dict[str, Any]]]:
    """Skip drives already complete, and those that cannot be replayed."""
    while chain.place < len(chain.drives):
        planned = chain.drives[chain.place]
        job = chain.job(out, rows)
        if planned.fault:
            outcome: Outcome | None
            outcome = failed(job, planned.fault)
            keep(out, outcome)
        else:
            outcome = standing(out, job)
        if outcome is None:
            return
        yield planned, chain.finish(outcome)


def _outcome(future: Future[Outcome], job: Job, died: type[Exception]) -> Outcome | None:
    """Return the outcome of a job, None: its worker died."""
    if future.cancelled():
        raise RunFault(
            "the Dask scheduler was lost; what is done stays, the same command goes on with the rest"
        )
    error = future.exception()
    if isinstance(error, died):
        return None
    if error is not None:
        return failed(job, f"{job.logs[0]}: {type(error).__name__}: {error}")
    return future.result()
