"""The folder that a fleet leaves: `brakes/vehicle=…/<drive>.parquet`, with `--rows` `rows/` likewise, then
`drives.parquet` and `report.html`.

The file of brakings is what makes a drive done: it appears last and at once, and holds in its metadata the
drive's summary, what was learned, and the key of everything that it was made from.
"""

import base64
import hashlib
import json
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Final
from urllib.parse import quote

import pyarrow as pa
import pyarrow.parquet as pq

from brakelab.fleet.task import Job, Outcome
from ecu import __version__
from ecu.config import config_hash
from ecu.records import LEARNED

KEY: Final = b"fleet_key"


def brakes_file(out: Path, vehicle: str, drive: str) -> Path:
    """Return where the brakings of a drive are."""
    return out / "brakes" / f"vehicle={quote(vehicle, safe='')}" / f"{quote(drive, safe='')}.parquet"


def rows_file(out: Path, vehicle: str, drive: str) -> Path:
    """Return where the rows of a drive are."""
    return out / "rows" / f"vehicle={quote(vehicle, safe='')}" / f"{quote(drive, safe='')}.parquet"


def key_of(job: Job, mark: str) -> str:
    """Return a hash of all that the outcome follows from; `mark` stands for the content of the logs."""
    parts = (
        *(__version__, str(LEARNED.descr), mark, config_hash(job.config), job.source.database_hash),
        *(job.source.bus, hashlib.sha256(job.learned).hexdigest()),
    )
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


def standing(out: Path, job: Job, key: str) -> Outcome | None:
    """Return what an earlier run left of this very job, without its brakings; None: it is to be done."""
    if job.rows and not Path(job.rows).exists():
        return None
    try:
        metadata = pq.read_metadata(brakes_file(out, job.vehicle, job.drive)).metadata or {}
        if metadata.get(KEY) != key.encode():
            return None
        summary = json.loads(metadata[b"summary"])
        return Outcome(summary, b"", base64.b64decode(metadata[b"learned"]))
    except (OSError, pa.ArrowInvalid, KeyError, ValueError):
        return None


def keep(out: Path, outcome: Outcome, key: str) -> None:
    """Write what a drive gave; of one that failed nothing stays of an earlier run either."""
    names = outcome.summary["vehicle"], outcome.summary["drive"]
    path = brakes_file(out, *names)
    if outcome.summary["fault"]:
        path.unlink(missing_ok=True)
        rows_file(out, *names).unlink(missing_ok=True)
        return
    table = pq.read_table(BytesIO(outcome.brakes))
    metadata = {
        KEY: key.encode(),
        b"summary": json.dumps(outcome.summary).encode(),
        b"learned": base64.b64encode(outcome.learned),
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_name(f".{path.name}.unfinished")
    try:
        pq.write_table(table.replace_schema_metadata(metadata), unfinished, compression="zstd")
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)


def others(out: Path, wanted: set[Path]) -> Iterator[Path]:
    """Yield the files of brakings that are none of `wanted`."""
    yield from (path for path in sorted(out.glob("brakes/vehicle=*/*.parquet")) if path not in wanted)
