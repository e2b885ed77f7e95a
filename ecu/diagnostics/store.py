"""What was learned, kept like money: sqlite, WAL, synchronous FULL, a CRC and a revision per row.

Only the side process writes. A row that fails its CRC or its ranges is passed over for the revision before
it; a file that sqlite cannot read, or that holds another table, another schema or values of another kind, is
set aside and a new one made. What another version of the algorithm has learned stays in the file and is not
used. The folder is its owner's alone.
"""

import math
import sqlite3
import time
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import structlog
from numpy.typing import NDArray

from ecu.errors import UserError
from ecu.records import LEARNED, RecordArray

FILE: Final = "learned.sqlite"
DAMAGED: Final = (sqlite3.Error, ValueError, OverflowError, TypeError)
"""What sqlite3 raises over a damaged file: text that is no UTF-8, and numbers that cannot be, among them."""
REVISIONS_KEPT: Final = 20
SAVE_INTERVAL_S: Final = 60.0
MU_RANGE: Final = (0.5, 1.5)  # of nominal
RADIUS_ERROR_LIMIT: Final = 0.03
DISC_EXCESS_LIMIT: Final = 2000.0  # K above the air, with its error
JOINT_LIMIT: Final = 1.5
"""Of any state of the joint observer: logarithms, and the rest is smaller still."""
LEAST_EIGENVALUE: Final = 1e-6  # of a correlation matrix, below zero: rounding

_TABLE: Final = """CREATE TABLE learned (
    key TEXT NOT NULL, revision INTEGER NOT NULL, saved_at TEXT NOT NULL,
    record BLOB NOT NULL, crc INTEGER NOT NULL,
    PRIMARY KEY (key, revision)
)"""
_FILE_FORMATS: Final = (b"\x01\x01", b"\x02\x02")  # bytes 18 and 19: rollback journal, WAL
_LARGEST_REVISION: Final = 1 << 53
_OF_ANOTHER_KIND: Final = f"""SELECT count(*) FROM learned WHERE typeof(key) != 'text'
    OR typeof(saved_at) != 'text' OR typeof(record) != 'blob' OR typeof(crc) != 'integer'
    OR typeof(revision) != 'integer' OR revision NOT BETWEEN 1 AND {_LARGEST_REVISION}"""


def open_store(folder: Path) -> sqlite3.Connection:
    """Open the store in `folder`, made if missing; a file that is no sqlite database any more is set aside.

    Raises:
        UserError: the folder cannot be written.
    """
    path = folder / FILE
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        try:
            return _connect(path)
        except DAMAGED as error:
            if isinstance(error, sqlite3.OperationalError) and not _is_damaged(error):
                raise
            _set_aside(path, str(error))
            return _connect(path)
    except (OSError, *DAMAGED) as error:
        raise UserError(
            str(path), "", f"cannot be opened: {error}; give a folder that can be written"
        ) from None


def _is_damaged(error: sqlite3.OperationalError) -> bool:
    """Whether the file is at fault and not its surroundings (rights, a full disk, a lock)."""
    code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_ERROR)  # Python's own, over text, has none
    return code & 0xFF in (sqlite3.SQLITE_IOERR, sqlite3.SQLITE_ERROR)


def _connect(path: Path) -> sqlite3.Connection:
    with suppress(FileNotFoundError), path.open("rb") as file:
        if file.read(20)[18:] not in (b"", *_FILE_FORMATS):  # sqlite would take it as read-only
            raise sqlite3.DatabaseError("its format is another's")
    store = sqlite3.connect(path, isolation_level=None, timeout=0.5)
    try:
        store.execute("PRAGMA journal_mode=WAL")
        store.execute("PRAGMA synchronous=FULL")
        with _transaction(store):
            schema = store.execute(
                "SELECT type, name, sql FROM sqlite_schema WHERE sql IS NOT NULL"
            ).fetchall()
            if not schema:
                store.execute(_TABLE)
            store.execute("PRAGMA user_version = 1")  # one that cannot be written shows now
        if schema and schema != [("table", "learned", _TABLE)]:
            raise sqlite3.DatabaseError("it holds another schema")
        verdict = store.execute("PRAGMA integrity_check(1)").fetchone()[0]
        if verdict != "ok":
            raise sqlite3.DatabaseError(verdict)
        if store.execute(_OF_ANOTHER_KIND).fetchone()[0]:
            raise sqlite3.DatabaseError("it holds values of another kind")
    except BaseException:
        store.close()
        raise
    return store


def _set_aside(path: Path, reason: str) -> None:
    aside = path.with_name(f"{path.name}.damaged-{time.time_ns()}")
    for suffix in ("", "-wal", "-shm"):
        part = path.with_name(path.name + suffix)
        if part.exists():
            part.rename(aside.with_name(aside.name + suffix))
    structlog.get_logger("store").error(
        "store_damaged",
        file=str(path),
        reason=reason,
        set_aside=str(aside),
        remedy="learned values start anew",
    )


def _crc(key: str, revision: int, record: bytes) -> int:
    return zlib.crc32(f"{key}\0{revision}\0".encode() + record)


def save(store: sqlite3.Connection, key: str, learned: RecordArray) -> int:
    """Add `learned` (`LEARNED`, shape (1,)) as the next revision of `key`, durable on return; returns it."""
    record = learned.tobytes()
    with _transaction(store):
        last = store.execute("SELECT max(revision) FROM learned WHERE key = ?", (key,)).fetchone()[0]
        revision = (last or 0) + 1
        now = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
        crc = _crc(key, revision, record)
        store.execute("INSERT INTO learned VALUES (?, ?, ?, ?, ?)", (key, revision, now, record, crc))
        store.execute("DELETE FROM learned WHERE key = ? AND revision <= ?", (key, revision - REVISIONS_KEPT))
    return int(revision)


@contextmanager
def _transaction(store: sqlite3.Connection) -> Iterator[None]:
    store.execute("BEGIN IMMEDIATE")
    try:
        yield
    except BaseException:
        store.execute("ROLLBACK")
        raise
    store.execute("COMMIT")


def restore(
    store: sqlite3.Connection, key: str, mu_nominal: NDArray[np.float64]
) -> tuple[int, RecordArray] | None:
    """Return the newest good revision of `key` and its record (`LEARNED`, shape (1,)); None without one.

    `mu_nominal` has shape (4,). Good: the CRC holds and every value lies in its range.
    """
    rows = store.execute(
        "SELECT revision, record, crc FROM learned WHERE key = ? ORDER BY revision DESC", (key,)
    )
    for revision, record, crc in rows.fetchall():
        reason = _why_not(key, revision, record, crc, mu_nominal)
        if not reason:
            return revision, np.frombuffer(record, LEARNED).copy()
        structlog.get_logger("store").warning(
            "revision_refused", revision=revision, reason=reason, remedy="the one before it is tried"
        )
    _tell_of_other_versions(store, key)
    return None


def _tell_of_other_versions(store: sqlite3.Connection, key: str) -> None:
    vehicle = key.rpartition("/")[0]
    keys = {row[0] for row in store.execute("SELECT DISTINCT key FROM learned")} - {key}
    others = sorted(other for other in keys if other.rpartition("/")[0] == vehicle)
    if others:
        structlog.get_logger("store").warning(
            "learned_by_another_version", key=others[-1], remedy="it stays in the store; learning begins anew"
        )


def _why_not(key: str, revision: int, record: object, crc: int, mu_nominal: NDArray[np.float64]) -> str:
    if not isinstance(record, bytes) or len(record) != LEARNED.itemsize:
        return "another layout"
    if crc != _crc(key, revision, record):
        return "CRC"
    return out_of_range(np.frombuffer(record, LEARNED), mu_nominal)


def out_of_range(learned: RecordArray, mu_nominal: NDArray[np.float64]) -> str:
    """Return the name of the first value of `learned` (shape (1,)) that cannot be, empty if there is none."""
    row = learned[0]
    known = row["observed_s"] > 0  # of a corner that was never observed the friction says nothing
    share = row["mu_b"] / mu_nominal
    sigma = row["sigma_mu_b"]
    p = covariance_of(row["joint_covariance"])
    checks = {
        "observed_s": np.isfinite(row["observed_s"]) & (row["observed_s"] >= 0),
        "mu_b": ~known | ((share >= MU_RANGE[0]) & (share <= MU_RANGE[1])),
        "sigma_mu_b": ~known | (np.isfinite(sigma) & (sigma > 0)),
        "radius_error": np.abs(row["radius_error"]) <= RADIUS_ERROR_LIMIT,
        "radius_sigma": np.isfinite(row["radius_sigma"]) & (row["radius_sigma"] > 0),
        "joint": np.abs(row["joint"]) <= JOINT_LIMIT,
        "joint_covariance": np.asarray(not row["joint_known"] or is_covariance(p)),
        "disc_excess": (row["disc_excess"] >= 0) & (row["disc_excess"] <= DISC_EXCESS_LIMIT),
        "brakings": np.asarray(row["brakings"] >= 0),
    }
    return next((name for name, good in checks.items() if not good.all()), "")


def covariance_of(triangle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the symmetric matrix whose lower triangle, by rows, is `triangle`."""
    n = int(math.sqrt(2 * len(triangle)))
    matrix = np.zeros((n, n))
    matrix[np.tril_indices(n)] = triangle
    return matrix + np.tril(matrix, -1).T


def is_covariance(matrix: NDArray[np.float64]) -> bool:
    """Whether a symmetric matrix, shape (n, n), can be one: finite, no variance or eigenvalue below 0."""
    if not np.isfinite(matrix).all() or (np.diag(matrix) < 0).any():
        return False
    sigma = np.sqrt(np.maximum(np.diag(matrix), 1e-30))
    return bool(np.linalg.eigvalsh(matrix / np.outer(sigma, sigma)).min() > -LEAST_EIGENVALUE)


class Keeper(NamedTuple):
    """When to save: the last saved record and when that was [s, monotonic]."""

    saved: bytes
    brakings: int
    at_s: float


def first_keeper(learned: RecordArray, now_s: float) -> Keeper:
    """Return the keeper of a record that stands in the store, or need not: what the run started with."""
    return Keeper(learned.tobytes(), int(learned["brakings"][0]), now_s)


def is_due(keeper: Keeper, learned: RecordArray, now_s: float) -> bool:
    """Whether to save now: after a braking at once, any other change after at most a minute."""
    if learned.tobytes() == keeper.saved:
        return False
    return int(learned["brakings"][0]) > keeper.brakings or now_s - keeper.at_s >= SAVE_INTERVAL_S
