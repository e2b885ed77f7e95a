"""The folder that a fleet leaves: `brakes/vehicle=…/<drive>.parquet`, with `--rows` `rows/` likewise, then
`drives.parquet` and `report.html`.

The file of brakings is what makes a drive done: it appears last and at once, and holds in its metadata the
drive's summary, what was learned, and the key of everything that it was made from.
"""

from collections.abc import Iterator
from pathlib import Path
from urllib.parse import quote

import pyarrow as pa
import pyarrow.parquet as pq

from brakelab.fleet.job import Job, Outcome, outcome_of


def brakes_file(out: Path, vehicle: str, drive: str) -> Path:
    """Return where the brakings of a drive are."""
    return out / "brakes" / f"vehicle={quote(vehicle, safe='')}" / f"{quote(drive, safe='')}.parquet"


def rows_file(out: Path, vehicle: str, drive: str) -> Path:
    """Return where the rows of a drive are."""
    return out / "rows" / f"vehicle={quote(vehicle, safe='')}" / f"{quote(drive, safe='')}.parquet"


def standing(out: Path, job: Job) -> Outcome | None:
    """Return what an earlier run left of this very job, without its file; None: it is to be done."""
    if job.rows and not Path(job.rows).exists():
        return None
    try:
        metadata = pq.read_metadata(brakes_file(out, job.vehicle, job.drive)).metadata
        return outcome_of(job, metadata or {})
    except (OSError, pa.ArrowInvalid):
        return None


def keep(out: Path, outcome: Outcome) -> None:
    """Write what a drive gave; of one that failed nothing stays of an earlier run either."""
    names = outcome.summary["vehicle"], outcome.summary["drive"]
    path = brakes_file(out, *names)
    if outcome.summary["fault"]:
        path.unlink(missing_ok=True)
        rows_file(out, *names).unlink(missing_ok=True)
        return
    unfinished = path.with_name(f".{path.name}.unfinished")
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        unfinished.write_bytes(outcome.file)
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)


def others(out: Path, wanted: set[Path]) -> Iterator[Path]:
    """Yield the files of brakings that are none of `wanted`."""
    yield from (path for path in sorted(out.glob("brakes/vehicle=*/*.parquet")) if path not in wanted)
