"""Task of a worker: one drive, from its logs to its brake applications, summary and learned values."""

import io
import shutil
import time
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from brakelab.fleet.files import local_copies
from brakelab.fleet.job import Job, Outcome, failed, metadata_of, provenance
from brakelab.fleet.summary import DriveBook
from brakelab.fleet.wear import register_pads, wear_summary
from brakelab.replay.contradictions import contradiction_lines, runs
from brakelab.replay.drive import replay_drive
from brakelab.replay.log import log_hash
from brakelab.replay.needed import NEEDED, fault_lines, needed_lines, nothing_usable, transducer_line
from brakelab.replay.quality import quality_lines
from brakelab.results.car import KEY as CAR
from brakelab.results.car import car_of
from brakelab.results.files import ResultWriter, brakes_table
from brakelab.results.outputs import whole
from brakelab.results.pads import pads_of
from ecu.algorithm.step import new_state
from ecu.contract.records import LEARNED
from ecu.errors import RunFault, UserError
from ecu.recording.learned_range import out_of_range
from ecu.settings.config import new_params


def replay_job(job: Job) -> Outcome:
    """Replay one drive. Any error is part of the outcome: nothing is raised."""
    began = time.perf_counter()
    paths: list[Path] = []
    brakes = None
    try:
        with local_copies(job.logs) as paths:
            outcome, brakes = _replay(job, paths)
    except (UserError, RunFault) as error:
        outcome = failed(job, str(error))
    except Exception as error:
        outcome = failed(job, f"{job.logs[0]}: unexpected {type(error).__name__}: {error} (please report it)")
    for name in ("fault", "notes"):
        outcome.summary[name] = _by_address(outcome.summary[name], paths, job.logs)
    outcome.summary["replay_seconds"] = time.perf_counter() - began
    return outcome if brakes is None else outcome._replace(file=_file(job, outcome, brakes))


def _file(job: Job, outcome: Outcome, brakes: pa.Table) -> bytes:
    """Return the Parquet file of a drive's brake applications, with the metadata that identify the run."""
    file = io.BytesIO()
    pq.write_table(brakes.replace_schema_metadata(metadata_of(job, outcome)), file, compression="zstd")
    return file.getvalue()


def _replay(job: Job, paths: Sequence[Path]) -> tuple[Outcome, pa.Table]:
    params = new_params(job.config)
    learned = np.frombuffer(job.learned, LEARNED).copy() if job.learned else None
    if job.pads:
        learned = new_state(params)["learned"].copy() if learned is None else learned
        register_pads(learned, job.config, job.pads, f"vehicle {job.vehicle}, {job.drive}")
    for path in paths:
        if not path.exists():
            raise UserError(str(path), "", "no such file; give an existing log")
    with TemporaryDirectory(prefix="brake-ecu-fleet-") as folder:
        file = Path(folder, Path(job.rows).name or "rows.parquet")
        with ResultWriter(file, params) if job.rows else nullcontext() as writer:

            def write(t: NDArray[np.float64], rows: NDArray[np.float64]) -> None:
                book.add(t, rows)
                if writer is not None:
                    began_ns = findings[0].began_ns
                    start = {} if began_ns is None else {"start_time_ns": str(began_ns)}
                    writer.provenance = writer.provenance or provenance(job) | start | {
                        CAR: car_of(job.config)
                    }
                    writer.write(t, rows)

            for findings in runs(paths, params, learns=False):
                book = DriveBook(params)
                if writer is not None:
                    writer.restart()
                ended = book.brakes.end_log
                after = replay_drive(findings, params, learned, job.source, write, ended, lambda _: None)
            wrong = contradiction_lines(findings)
            if writer is not None and after is not None:
                writer.pads = pads_of(params, after, job.config)
        if nothing_usable(findings):
            names = ", ".join(group.name for group in NEEDED)
            raise RunFault(f"{paths[0]}: not one sample of the needed inputs was usable ({names})")
        if job.rows:
            if job.page:
                _draw_page(file, Path(job.page))
            _put(file, Path(job.rows))
    assert after is not None
    kept = job.learned if out_of_range(after, params[0]["mu_nominal"]) else after.tobytes()
    if wrong:
        kept = b"" if learned is None else learned.tobytes()
        wrong = [*wrong, "friction stays as it was before this drive, until the map is mended"]
    notes = wrong + [
        line
        for found in findings
        for line in (
            *(*quality_lines(found, job.source.plan), *needed_lines(found)),
            *(*transducer_line(found, job.config.observer.kind), *fault_lines(found)),
        )
    ]
    summary = provenance(job) | book.summary(findings)
    summary |= wear_summary(params, after, job.config, book.last, book.brakes.rows)
    summary |= {"fault": "", "notes": "\n".join(notes), "sha256": "\n".join(log_hash(path) for path in paths)}
    table = brakes_table(book.brakes.rows)
    drives = pa.array([job.drive] * len(table), pa.string())
    return Outcome(summary, b"", kept), table.add_column(0, "drive", drives)


def _draw_page(rows: Path, target: Path) -> None:
    from brakelab.report.command import report  # Bokeh, which no other drive needs

    page = rows.with_suffix(".html")
    try:
        report(rows, None, page)
    except UserError:  # too short: its summary is all there is to say
        target.unlink(missing_ok=True)
    else:
        _put(page, target)


def _put(file: Path, target: Path) -> None:
    """Write `file` to `target` atomically."""
    with whole(target) as part:
        shutil.copyfile(file, part)


def _by_address(text: str, paths: Sequence[Path], urls: Sequence[str]) -> str:
    """Return a message with the logs' own names instead of those of their copies."""
    for path, url in zip(paths, urls, strict=False):
        text = text.replace(str(path), url)
    return text
