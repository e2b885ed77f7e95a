"""Store of learned values: revisions (`revisions.py`), written by the side process alone.

A revision out of range is skipped for the one before it. Values learned by another version of the algorithm
stay in the file unused.

Wear of the linings and emission of the brakes are also stored in rows of their own, in the same transaction,
by the vehicle's name alone: they outlive a new version and a changed configuration.
"""

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.contract.records import DUST, LEARNED, WEAR, RecordArray
from ecu.errors import UserError
from ecu.recording.learned_range import dust_out_of_range, out_of_range, wear_out_of_range
from ecu.recording.lock import lock
from ecu.recording.revisions import add, newest_good, open_file, open_file_to_read, transaction

FILE: Final = "learned.sqlite"
LOCK: Final = "in-use"
SAVE_INTERVAL_S: Final = 60.0


def open_store(folder: Path) -> sqlite3.Connection:
    """Open the store in `folder`, created if missing; a file that is no valid sqlite database is set aside.

    Raises:
        UserError: the folder cannot be written, or a later version's store cannot be used.
    """
    return open_file(folder / FILE)


def open_to_read(folder: Path) -> AbstractContextManager[sqlite3.Connection]:
    """Open the store in `folder`, or a copy in memory where the folder cannot be written, as on a full disk.

    Raises:
        UserError: neither is possible.
    """
    return open_file_to_read(folder / FILE)


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


def save(store: sqlite3.Connection, key: str, learned: RecordArray) -> int:
    """Save `learned` (`LEARNED`, shape (1,)), durably, as the next revision of `key`; return that."""
    with transaction(store):
        for part in PARTS:
            add(store, part_key(key, part), learned[part].tobytes())
        return add(store, key, learned.tobytes())


def part_key(key: str, part: str) -> str:
    """Return the key of one of `PARTS`: the vehicle of `key` and the version of its layout."""
    return f"{key.rsplit('/', 2)[0]}/{part}/1"


def restore(
    store: sqlite3.Connection, key: str, mu_nominal: NDArray[np.float64]
) -> tuple[int, RecordArray] | None:
    """Return the newest good revision of `key` and its record (`LEARNED`, shape (1,)); None without one.

    `mu_nominal` has shape (4,). Good: the CRC holds and every value lies in its range. Wear and dust are the
    vehicle's where these are newer.
    """
    found = newest_good(store, key, _reading(LEARNED, lambda learned: out_of_range(learned, mu_nominal)))
    if not found:
        _tell_of_other_versions(store, key)
        return None
    for part, (_, _, distance) in PARTS.items():
        own = restore_part(store, key, part)
        if own is not None and own[distance][0] >= found[1][part][distance][0]:
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
    found = newest_good(store, part_key(key, part), _reading(dtype, wrong))
    return found[1] if found else None


def _reading(dtype: np.dtype[Any], wrong: Callable[[RecordArray], str]) -> Callable[[bytes], RecordArray]:
    def read(record: bytes) -> RecordArray:
        if len(record) != dtype.itemsize:
            raise ValueError("another layout")
        values = np.frombuffer(record, dtype).copy()
        if reason := wrong(values):
            raise ValueError(reason)
        return values

    return read


def _tell_of_other_versions(store: sqlite3.Connection, key: str) -> None:
    vehicle = key.rpartition("/")[0]
    keys = {row[0] for row in store.execute("SELECT DISTINCT key FROM learned")} - {key}
    others = sorted(other for other in keys if other.rpartition("/")[0] == vehicle)
    if others:
        import structlog

        structlog.get_logger("store").warning(
            "learned_by_another_version", key=others[-1], remedy="it stays in the store; learning begins anew"
        )


PARTS: Final = {
    "wear": (WEAR, wear_out_of_range, "odometer"),
    "dust": (DUST, dust_out_of_range, "way"),
}
"""Record of the vehicle and its pads: layout, check, and the field that holds its distance [m]."""


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
