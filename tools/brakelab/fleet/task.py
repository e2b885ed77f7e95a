"""What a worker does: one drive, from its logs to its brakings, its summary and what was learned."""

import io
import shutil
import time
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from brakelab.fleet.files import local_copies
from brakelab.fleet.summary import DriveBook
from brakelab.replay.drive import replay_drive
from brakelab.replay.log import log_hash
from brakelab.replay.needed import NEEDED, fault_lines, needed_lines, nothing_usable
from brakelab.replay.quality import Findings, quality_lines
from brakelab.replay.source import Source
from brakelab.results import ResultWriter, brakes_table
from ecu import __version__
from ecu.config import Config, config_hash, new_params
from ecu.diagnostics.store import out_of_range
from ecu.errors import RunFault, UserError
from ecu.records import LEARNED


@dataclass(frozen=True)
class Job:
    """One drive for a worker; it needs no file of the client but the logs."""

    vehicle: str
    drive: str
    logs: tuple[str, ...]
    config: Config
    source: Source
    learned: bytes
    """LEARNED from before the drive, empty: nothing was."""
    rows: str
    """File of the rows, on a disk that client and workers share; empty: none."""


class Outcome(NamedTuple):
    """What comes back."""

    summary: dict[str, Any]
    """By `SUMMARY_SCHEMA`; with a `fault` there are no brakings, and what was learned is as before."""
    brakes: bytes
    """A Parquet file."""
    learned: bytes


def replay_job(job: Job) -> Outcome:
    """Replay one drive. Whatever goes wrong with it is in the outcome: nothing is raised."""
    began = time.perf_counter()
    paths: list[Path] = []
    try:
        with local_copies(job.logs) as paths:
            outcome = _replay(job, paths)
    except (UserError, RunFault) as error:
        outcome = failed(job, str(error))
    except Exception as error:
        outcome = failed(job, f"{job.logs[0]}: unexpected {type(error).__name__}: {error} (please report it)")
    told = {name: _by_address(outcome.summary[name], paths, job.logs) for name in ("fault", "notes")}
    seconds = time.perf_counter() - began
    return outcome._replace(summary=outcome.summary | told | {"replay_seconds": seconds})


def failed(job: Job, fault: str) -> Outcome:
    """Return the outcome of a drive that could not be replayed."""
    return Outcome(_provenance(job) | {"fault": " ".join(fault.split()), "notes": ""}, b"", job.learned)


def _provenance(job: Job) -> dict[str, Any]:
    return {
        "vehicle": job.vehicle,
        "drive": job.drive,
        "logs": "\n".join(job.logs),
        "config_hash": config_hash(job.config),
        "database_hash": job.source.database_hash,
        "observer": job.config.observer.kind,
        "version": __version__,
    }


def _replay(job: Job, paths: Sequence[Path]) -> Outcome:
    params = new_params(job.config)
    learned = np.frombuffer(job.learned, LEARNED).copy() if job.learned else None
    findings = [Findings(path) for path in paths]
    for path in paths:
        if not path.exists():
            raise UserError(str(path), "", "no such file; give an existing log")
    book = DriveBook(params)
    with TemporaryDirectory(prefix="brake-ecu-fleet-") as folder:
        file = Path(folder, "rows.parquet")
        with ResultWriter(file, params) if job.rows else nullcontext() as writer:

            def write(t: NDArray[np.float64], rows: NDArray[np.float64]) -> None:
                book.add(t, rows)
                if writer is not None:
                    start = {"start_time_ns": str(findings[0].start_ns)}
                    writer.provenance = writer.provenance or _provenance(job) | start
                    writer.write(t, rows)

            after = replay_drive(
                findings, params, learned, job.source, write, book.brakes.end_log, lambda _: None
            )
        if nothing_usable(findings):
            names = ", ".join(group.name for group in NEEDED)
            raise RunFault(f"{paths[0]}: not one sample of the needed inputs was usable ({names})")
        if job.rows:
            _put(file, Path(job.rows))
    assert after is not None
    kept = job.learned if out_of_range(after, params[0]["mu_nominal"]) else after.tobytes()
    notes = [
        line
        for found in findings
        for line in (*quality_lines(found, job.source.plan), *needed_lines(found), *fault_lines(found))
    ]
    summary = _provenance(job) | book.summary(findings)
    summary |= {"fault": "", "notes": "\n".join(notes), "sha256": "\n".join(log_hash(path) for path in paths)}
    table = brakes_table(book.brakes.rows)
    drives = pa.array([job.drive] * len(table), pa.string())
    brakes = io.BytesIO()
    pq.write_table(table.add_column(0, "drive", drives), brakes, compression="zstd")
    return Outcome(summary, brakes.getvalue(), kept)


def _put(file: Path, target: Path) -> None:
    """Let `file` appear as `target` complete or not at all."""
    unfinished = target.with_name(f".{target.name}.unfinished")
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(file, unfinished)
    unfinished.replace(target)


def _by_address(text: str, paths: Sequence[Path], urls: Sequence[str]) -> str:
    """Return a message with the logs' own names instead of those of their copies."""
    for path, url in zip(paths, urls, strict=False):
        text = text.replace(str(path), url)
    return text
