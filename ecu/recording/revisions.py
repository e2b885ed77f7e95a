"""Revisions of records in a file: sqlite, WAL, synchronous FULL, a CRC and a revision per row.

A file has one writer. A row that fails its CRC, or that its reader refuses, is skipped for the previous
revision; a file that sqlite cannot read, or that holds another table, another schema or values of another
kind, is set aside and a new one made. Not for what is around it, such as a full disk, nor for what a later
version adds: columns and indices more are left alone, and a file of a later version that cannot be used is
not touched. The folder is its owner's alone.
"""

import shutil
import sqlite3
import time
import zlib
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, TypeVar

from ecu.errors import UserError
from ecu.recording.ring import ring_folder

Content = TypeVar("Content")

DAMAGED: Final = (sqlite3.Error, ValueError, OverflowError, TypeError)
"""Errors of sqlite3 over a damaged file: text that is no UTF-8 and impossible numbers among them."""
REVISIONS_KEPT: Final = 20

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


def open_file(path: Path) -> sqlite3.Connection:
    """Open the file at `path`, made with its folder if missing; one that is no valid database is set aside.

    Raises:
        UserError: the folder cannot be written, or a later version's store cannot be used.
    """
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
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
def open_file_to_read(path: Path) -> Iterator[sqlite3.Connection]:
    """Open the file at `path`, or a copy in memory where its folder cannot be written, as on a full disk.

    Raises:
        UserError: neither is possible.
    """
    try:
        store = open_file(path)
    except UserError as error:
        with TemporaryDirectory(dir=ring_folder()) as copy:
            try:
                for part in (path, *path.parent.glob(f"{path.name}-wal")):
                    shutil.copy(part, copy)
                store = open_file(Path(copy) / path.name)
            except (OSError, UserError):
                raise error from None
            with closing(store):
                yield store
        return
    with closing(store):
        yield store


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
        with transaction(store):
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
    import structlog  # takes a tenth of the start of a command that has nothing to log

    structlog.get_logger("store").error(
        "store_damaged",
        file=str(path),
        reason=reason,
        set_aside=str(aside),
        remedy="what it held starts anew",
    )


def _crc(key: str, revision: int, record: bytes) -> int:
    return zlib.crc32(f"{key}\0{revision}\0".encode() + record)


def add(store: sqlite3.Connection, key: str, record: bytes) -> int:
    """Add a record as the next revision of `key`, within a `transaction`; return that revision."""
    last = store.execute("SELECT max(revision) FROM learned WHERE key = ?", (key,)).fetchone()[0]
    revision = int(last or 0) + 1
    now = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
    crc = _crc(key, revision, record)
    store.execute(f"INSERT INTO learned ({_NAMES}) VALUES (?, ?, ?, ?, ?)", (key, revision, now, record, crc))
    store.execute("DELETE FROM learned WHERE key = ? AND revision <= ?", (key, revision - REVISIONS_KEPT))
    return revision


@contextmanager
def transaction(store: sqlite3.Connection) -> Iterator[None]:
    """Make what the block changes durable as one, or nothing of it."""
    store.execute("BEGIN IMMEDIATE")
    try:
        yield
    except BaseException:
        store.execute("ROLLBACK")
        raise
    store.execute("COMMIT")


def newest_good(
    store: sqlite3.Connection, key: str, read: Callable[[bytes], Content]
) -> tuple[int, Content] | None:
    """Return the newest revision of `key` whose CRC holds and that `read` takes, and what that returned.

    `read` raises ValueError with the reason for a record that it refuses.
    """
    rows = store.execute(
        "SELECT revision, record, crc FROM learned WHERE key = ? ORDER BY revision DESC", (key,)
    )
    for revision, record, crc in rows.fetchall():
        try:
            if not isinstance(record, bytes) or crc != _crc(key, revision, record):
                raise ValueError("CRC")
            return revision, read(record)
        except ValueError as error:
            import structlog

            structlog.get_logger("store").warning(
                "revision_refused", revision=revision, reason=str(error), remedy="the one before it is tried"
            )
    return None
