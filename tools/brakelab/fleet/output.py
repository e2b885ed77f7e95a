"""The folder that a fleet leaves: `brakes/vehicle=…/<drive>.parquet`, with `--rows` `rows/` and `pages/`
likewise, then `drives.parquet` and `report.html`.

A drive is complete once its file of brake applications exists: it appears last and atomically, and its
metadata hold the drive's summary, the learned values, and the key of all inputs.
"""

from collections.abc import Iterator
from pathlib import Path
from urllib.parse import quote

import pyarrow as pa
import pyarrow.parquet as pq

from brakelab.fleet.job import Job, Outcome, outcome_of
from brakelab.results.outputs import whole


def brakes_file(out: Path, vehicle: str, drive: str) -> Path:
    """Return the path of a drive's brake applications."""
    return _file(out, "brakes", vehicle, f"{quote(drive, safe='')}.parquet")


def rows_file(out: Path, vehicle: str, drive: str) -> Path:
    """Return the path of a drive's rows."""
    return _file(out, "rows", vehicle, f"{quote(drive, safe='')}.parquet")


def page_file(out: Path, vehicle: str, drive: str) -> Path:
    """Return the path of a drive's page."""
    return _file(out, "pages", vehicle, f"{quote(drive, safe='')}.html")


def _file(out: Path, kind: str, vehicle: str, name: str) -> Path:
    return out / kind / f"vehicle={quote(vehicle, safe='')}" / name


def standing(out: Path, job: Job) -> Outcome | None:
    """Return the result of an earlier run of this very job, without its file; None: still to be done."""
    if job.rows and not Path(job.rows).exists():
        return None
    try:
        metadata = pq.read_metadata(brakes_file(out, job.vehicle, job.drive)).metadata
        return outcome_of(job, metadata or {})
    except (OSError, pa.ArrowInvalid):
        return None


def keep(out: Path, outcome: Outcome) -> None:
    """Write the results of a drive; of a failed one earlier results are removed too."""
    names = outcome.summary["vehicle"], outcome.summary["drive"]
    path = brakes_file(out, *names)
    if outcome.summary["fault"]:
        path.unlink(missing_ok=True)
        for written in (rows_file(out, *names), page_file(out, *names)):
            written.unlink(missing_ok=True)
        return
    with whole(path) as part:
        part.write_bytes(outcome.file)


def others(out: Path, wanted: set[Path]) -> Iterator[Path]:
    """Yield the files of brake applications that are none of `wanted`."""
    yield from (path for path in sorted(out.glob("brakes/vehicle=*/[!.]*.parquet")) if path not in wanted)
