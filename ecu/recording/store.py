"""Store of learned values: sqlite, WAL, synchronous FULL, a CRC and a revision per row.

Only the side process writes. A row that fails its CRC or its ranges is skipped for the previous revision; a
file that sqlite cannot read, or that holds another table, another schema or values of another kind, is set
aside and a new one made. Not for what is around it, such as a full disk, nor for what a later version adds:
columns and indices more are left alone, and a file of a later version that cannot be used is not touched.
Values learned by another version of the algorithm stay in the file unused. The folder is its owner's alone.

Wear of the linings and emission of the brakes are also stored in rows of their own, in the same transaction,
by the vehicle's name alone: they outlive a new version and a changed configuration.
"""

import shutil
import sqlite3
import time
import zlib
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, NamedTuple

import numpy as np
import structlog
from numpy.typing import NDArray

from ecu.contract.records import DUST, LEARNED, WEAR, RecordArray
from ecu.errors import UserError
from ecu.recording.learned_range import dust_out_of_range, out_of_range, wear_out_of_range
from ecu.recording.lock import lock
from ecu.recording.ring import ring_folder

FILE: Final = "learned.sqlite"
DAMAGED: Final = (sqlite3.Error, ValueError, OverflowError, TypeError)
"""Errors of sqlite3 over a damaged file: text that is no UTF-8 and impossible numbers among them."""
LOCK: Final = "in-use"
REVISIONS_KEPT: Final = 20
SAVE_INTERVAL_S: Final = 60.0

_TABLE: Final = """CREATE TABLE learned (
    key TEXT NOT NULL, revision INTEGER NOT NULL, saved_at TEXT NOT NULL,
    record BLOB NOT NULL, crc INTEGER NOT NULL,
    PRIMARY KEY (key, revision)
)"""
_SCHEMA: Final = 1
"""Version of the table, in the file's `user_version`."""
_COLUMNS: Final = {
    "key": ("TEXT", 1),  # type, place in the primary key
    "revision": ("INTEGER", 2),
    "saved_at": ("TEXT", 0),
    "record": ("BLOB", 0),
    "crc": ("INTEGER", 0),
}
_NAMES: Final = ", ".join(_COLUMNS)
_DAMAGE: Final = (
    sqlite3.SQLITE_ERROR,
    sqlite3.SQLITE_IOERR_SHORT_READ,
    sqlite3.SQLITE_IOERR_DATA,
    sqlite3.SQLITE_IOERR_CORRUPTFS,
)
"""Errors of operation that tell of the file itself; all others of rights, a full disk, a lock."""
_FILE_FORMATS: Final = (b"\x01\x01", b"\x02\x02")  # bytes 18 and 19: rollback journal, WAL
_LARGEST_REVISION: Final = 1 << 53
_OF_ANOTHER_KIND: Final = f"""SELECT count(*) FROM learned WHERE typeof(key) != 'text'
    OR typeof(saved_at) != 'text' OR typeof(record) != 'blob' OR typeof(crc) != 'integer'
    OR typeof(revision) != 'integer' OR revision NOT BETWEEN 1 AND {_LARGEST_REVISION}"""


def open_store(folder: Path) -> sqlite3.Connection:
    """Open the store in `folder`, created if missing; a file that is no valid sqlite database is set aside.

    Raises:
        UserError: the folder cannot be written, or a later version's store cannot be used.
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


@contextmanager
def open_to_read(folder: Path) -> Iterator[sqlite3.Connection]:
    """Open the store in `folder`, or a copy in memory where the folder cannot be written, as on a full disk.

    Raises:
        UserError: neither is possible.
    """
    try:
        store = open_store(folder)
    except UserError as error:
        with TemporaryDirectory(dir=ring_folder()) as copy:
            try:
                for part in (folder / FILE, *folder.glob(f"{FILE}-wal")):
                    shutil.copy(part, copy)
                store = open_store(Path(copy))
            except (OSError, UserError):
                raise error from None
            with closing(store):
                yield store
        return
    with closing(store):
        yield store


def identity(folder: Path) -> tuple[int, int] | None:
    """Return device and number of the store's file in `folder`, None without one."""
    try:
        found = (folder / FILE).stat()
    except OSError:
        return None
    return found.st_dev, found.st_ino


@contextmanager
def in_use(folder: Path) -> Iterator[None]:
    """Hold the store in `folder` against changes by hand while a daemon uses it."""
    with (folder / LOCK).open("a") as file:
        lock(file.fileno(), shared=True, wait=True)
        yield


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Hold the store in `folder` for a change by hand.

    Raises:
        UserError: a daemon holds it, or the folder cannot be written.
    """
    try:
        with (folder / LOCK).open("a") as file:
            lock(file.fileno())
            yield
    except BlockingIOError:
        raise UserError(
            str(folder), "", "a daemon keeps it and would overwrite this; stop it first"
        ) from None
    except OSError as error:
        raise UserError(str(folder), "", f"cannot be written: {error.strerror}") from None


def _is_damaged(error: sqlite3.OperationalError) -> bool:
    """Return whether the file itself is damaged, not its surroundings."""
    # Python's own, over text, has no code.
    return getattr(error, "sqlite_errorcode", sqlite3.SQLITE_ERROR) in _DAMAGE


def _connect(path: Path) -> sqlite3.Connection:
    with suppress(FileNotFoundError), path.open("rb") as file:
        if file.read(20)[18:] not in (b"", *_FILE_FORMATS):  # sqlite would take it as read-only
            raise sqlite3.DatabaseError("its format is another's")
    store = sqlite3.connect(path, isolation_level=None, timeout=0.5)
    try:
        store.execute("PRAGMA journal_mode=WAL")
        store.execute("PRAGMA synchronous=FULL")
        with _transaction(store):
            kinds = [row[0] for row in store.execute("SELECT type FROM sqlite_schema WHERE sql IS NOT NULL")]
            if not kinds:
                store.execute(_TABLE)
            version = max(store.execute("PRAGMA user_version").fetchone()[0], _SCHEMA)
            usable = "trigger" not in kinds and _has_our_table(store)
            if not usable and version > _SCHEMA:
                raise UserError(
                    str(path), "", f"a later version wrote it (schema {version}); use that version"
                )
            store.execute(f"PRAGMA user_version = {version}")  # an unwritable one shows now
        if not usable:
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


def _has_our_table(store: sqlite3.Connection) -> bool:
    """Return whether `learned` has our columns, and beside them none that we would have to fill."""
    if store.execute("SELECT type FROM sqlite_schema WHERE name = 'learned'").fetchone() != ("table",):
        return False
    found = {name: row for _, name, *row in store.execute("PRAGMA table_info(learned)")}
    ours = {name: (kind, place) for name, (kind, _, _, place) in found.items() if name in _COLUMNS}
    others = [row for name, row in found.items() if name not in _COLUMNS]
    return ours == _COLUMNS and all(not needed or default is not None for _, needed, default, _ in others)


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
    """Save `learned` (`LEARNED`, shape (1,)), durably, as the next revision of `key`; return that."""
    with _transaction(store):
        for part in PARTS:
            _add(store, part_key(key, part), learned[part].tobytes())
        return _add(store, key, learned.tobytes())


def _add(store: sqlite3.Connection, key: str, record: bytes) -> int:
    last = store.execute("SELECT max(revision) FROM learned WHERE key = ?", (key,)).fetchone()[0]
    revision = int(last or 0) + 1
    now = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
    crc = _crc(key, revision, record)
    store.execute(f"INSERT INTO learned ({_NAMES}) VALUES (?, ?, ?, ?, ?)", (key, revision, now, record, crc))
    store.execute("DELETE FROM learned WHERE key = ? AND revision <= ?", (key, revision - REVISIONS_KEPT))
    return revision


def part_key(key: str, part: str) -> str:
    """Return the key of one of `PARTS`: the vehicle of `key` and the version of its layout."""
    return f"{key.rsplit('/', 2)[0]}/{part}/1"


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

    `mu_nominal` has shape (4,). Good: the CRC holds and every value lies in its range. Wear and dust are the
    vehicle's where these are newer.
    """
    found = _newest_good(store, key, LEARNED, lambda learned: out_of_range(learned, mu_nominal))
    if not found:
        _tell_of_other_versions(store, key)
        return None
    for part, (_, _, way) in PARTS.items():
        own = restore_part(store, key, part)
        if own is not None and own[way][0] >= found[1][part][way][0]:
            found[1][part] = own
    return found


def saved_at(store: sqlite3.Connection, key: str, revision: int) -> str:
    """Return when a revision was saved (UTC, ISO 8601), by the clock of that machine; empty: no such row."""
    row = store.execute("SELECT saved_at FROM learned WHERE key = ? AND revision = ?", (key, revision))
    found = row.fetchone()
    return str(found[0]) if found else ""


def restore_part(store: sqlite3.Connection, key: str, part: str) -> RecordArray | None:
    """Return the vehicle's wear or dust (`PARTS`, shape (1,)) by its newest good row, None without one."""
    dtype, wrong, _ = PARTS[part]
    found = _newest_good(store, part_key(key, part), dtype, wrong)
    return found[1] if found else None


def _newest_good(
    store: sqlite3.Connection, key: str, dtype: np.dtype[Any], wrong: Callable[[RecordArray], str]
) -> tuple[int, RecordArray] | None:
    rows = store.execute(
        "SELECT revision, record, crc FROM learned WHERE key = ? ORDER BY revision DESC", (key,)
    )
    for revision, record, crc in rows.fetchall():
        if not isinstance(record, bytes) or len(record) != dtype.itemsize:
            reason = "another layout"
        elif crc != _crc(key, revision, record):
            reason = "CRC"
        else:
            reason = wrong(np.frombuffer(record, dtype))
        if not reason:
            return revision, np.frombuffer(record, dtype).copy()
        structlog.get_logger("store").warning(
            "revision_refused", revision=revision, reason=reason, remedy="the one before it is tried"
        )
    return None


def _tell_of_other_versions(store: sqlite3.Connection, key: str) -> None:
    vehicle = key.rpartition("/")[0]
    keys = {row[0] for row in store.execute("SELECT DISTINCT key FROM learned")} - {key}
    others = sorted(other for other in keys if other.rpartition("/")[0] == vehicle)
    if others:
        structlog.get_logger("store").warning(
            "learned_by_another_version", key=others[-1], remedy="it stays in the store; learning begins anew"
        )


PARTS: Final = {
    "wear": (WEAR, wear_out_of_range, "odometer"),
    "dust": (DUST, dust_out_of_range, "way"),
}
"""Record of the vehicle and its pads: layout, check, and the distance [m] by which it went on."""


class Keeper(NamedTuple):
    """Schedule of saving: the last saved record and its time [s, monotonic]."""

    saved: bytes
    brakings: int
    at_s: float


def first_keeper(learned: RecordArray, now_s: float) -> Keeper:
    """Return the keeper of a record already stored, or not to be stored: the one the run started with."""
    return Keeper(learned.tobytes(), int(learned["brakings"][0]), now_s)


def is_due(keeper: Keeper, learned: RecordArray, now_s: float) -> bool:
    """Return whether to save: after a brake application at once, other changes within a minute."""
    if learned.tobytes() == keeper.saved:
        return False
    return int(learned["brakings"][0]) > keeper.brakings or now_s - keeper.at_s >= SAVE_INTERVAL_S
