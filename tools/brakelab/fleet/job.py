"""Job and outcome of a drive on a worker, and recognition of an earlier run's outcome."""

import base64
import hashlib
import json
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from brakelab.replay.source import Source
from ecu import __version__
from ecu.contract.records import LEARNED
from ecu.settings.config import Config, config_hash

KEY: Final = b"fleet_key"


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
    mark: str
    """Changes with the content of the logs."""
    rows: str
    """File of the rows, on a disk that client and workers share; empty: none."""
    page: str = ""
    """File of the drive's page, likewise."""
    pads: str = ""
    """Work on the pads before the drive, see `brakelab.fleet.manifest`."""


class Outcome(NamedTuple):
    """Result of a job."""

    summary: dict[str, Any]
    """By `SUMMARY_SCHEMA`; with a `fault` there are no applications, and learned values are unchanged."""
    file: bytes
    """Parquet: the applications, and in the metadata the data for the next run; empty with a `fault`."""
    learned: bytes


def failed(job: Job, fault: str) -> Outcome:
    """Return the outcome of a drive that could not be replayed."""
    return Outcome(provenance(job) | {"fault": " ".join(fault.split()), "notes": ""}, b"", job.learned)


def provenance(job: Job) -> dict[str, Any]:
    """Return the part of the summary known before the drive."""
    return {
        "vehicle": job.vehicle,
        "drive": job.drive,
        "logs": "\n".join(job.logs),
        "config_hash": config_hash(job.config),
        "database_hash": job.source.database_hash,
        "observer": job.config.observer.kind,
        "version": __version__,
    }


def key_of(job: Job) -> str:
    """Return a hash of all inputs of the outcome."""
    parts = (
        *(__version__, str(LEARNED.descr), job.mark, config_hash(job.config), job.source.database_hash),
        *(job.source.bus, hashlib.sha256(job.learned).hexdigest(), job.pads),
    )
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


def metadata_of(job: Job, outcome: Outcome) -> dict[bytes, bytes]:
    """Return the metadata of a drive's file."""
    return {
        KEY: key_of(job).encode(),
        b"summary": json.dumps(outcome.summary).encode(),
        b"learned": base64.b64encode(outcome.learned),
    }


def outcome_of(job: Job, metadata: dict[bytes, bytes]) -> Outcome | None:
    """Return the outcome in a file's metadata; None if it is not that of this very job."""
    if metadata.get(KEY) != key_of(job).encode():
        return None
    return Outcome(json.loads(metadata[b"summary"]), b"", base64.b64decode(metadata[b"learned"]))
