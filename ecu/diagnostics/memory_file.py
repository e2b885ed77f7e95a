"""The fault memory in the state folder: faults.sqlite, of revisions (`ecu/recording/revisions.py`).

One process owns it, by a lock that ends with the process; each save is durable before the next and leaves
the one before it. A thread saves, for a disk may take longer than a response. What fails is said once, and
tried again with the next change.
"""

import json
import os
import threading
import time
from collections.abc import Mapping
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any, Final, NamedTuple

import structlog

from ecu.diagnostics.fault_memory import AVAILABLE, MOST_OCCURRENCES, Entry, FaultMemory
from ecu.errors import UserError
from ecu.recording.lock import lock
from ecu.recording.revisions import (
    DAMAGED,
    add,
    newest_good,
    open_file,
    open_file_to_read,
    transaction,
)
from ecu.recording.store import part_key

PATIENCE_S: Final = 5.0
LOOK_AGAIN_S: Final = 0.1
FILE: Final = "faults.sqlite"
LOCK: Final = "faults-in-use"


class Place(NamedTuple):
    """How far the fault memory has followed a run."""

    start_ns: int
    """Of the run."""
    cycle: int
    """The last one that is in it."""


class Kept(NamedTuple):
    """What a file holds."""

    place: Place
    entries: dict[int, Entry]


def to_record(memory: FaultMemory, place: Place) -> bytes:
    """Return the memory as it is stored: JSON, codes that were never tested left out."""
    entries = {
        f"{number:06X}": [entry.status, entry.occurrences, entry.ageing, entry.first.hex(), entry.last.hex()]
        for number, entry in memory.entries.items()
        if entry != Entry()
    }
    return json.dumps({"start_ns": place.start_ns, "cycle": place.cycle, "entries": entries}).encode()


def from_record(record: bytes) -> Kept:
    """Return what `to_record` stored. Raises ValueError for anything else."""
    try:
        found = json.loads(record)
        place = Place(int(found["start_ns"]), int(found["cycle"]))
        return Kept(place, {int(number, 16): _entry(row) for number, row in found["entries"].items()})
    except (TypeError, KeyError, AttributeError, RecursionError, OverflowError) as error:
        raise ValueError(f"no fault memory: {error}") from None


def _entry(row: Any) -> Entry:
    status, occurrences, ageing, first, last = row
    entry = Entry(int(status), int(occurrences), int(ageing), bytes.fromhex(first), bytes.fromhex(last))
    numbers = (entry.status, entry.occurrences, entry.ageing)
    if any(not 0 <= number <= MOST_OCCURRENCES for number in numbers) or entry.status & ~AVAILABLE:
        raise ValueError(f"out of range: {numbers}")
    return entry


def take_over(memory: FaultMemory, kept: Mapping[int, Entry]) -> None:
    """Put stored entries into the memory; of codes that are no more nothing is taken."""
    for number, entry in kept.items():
        if number in memory.entries:
            memory.entries[number] = entry


class MemoryFile:
    """The file of one vehicle's fault memory, and the thread that saves it."""

    def __init__(self, folder: Path, store_key: str) -> None:
        self._folder, self._key = folder, part_key(store_key, "faults")
        self._log = structlog.get_logger("diagnostics")
        self._held, self._refused = ExitStack(), ""
        self._turn = threading.Condition()
        self._wanted: bytes | None = None
        self._asked = self._done = 0
        self._good = False

    def load(self, patience_s: float = PATIENCE_S) -> Kept | None:
        """Return what was kept before, None: nothing, or it cannot be read; then nothing is saved over it.

        It waits for an owner that is about to end: this process's forerunner.
        """
        try:
            self._own(time.monotonic() + patience_s)
            with open_file_to_read(self._folder / FILE) as store:
                found = newest_good(store, self._key, from_record)
        except (OSError, UserError, *DAMAGED) as error:
            self._refuse(error)
            return None
        threading.Thread(target=self._save_what_comes, daemon=True).start()
        self._good = True
        return found[1] if found else None

    def _own(self, until_s: float) -> None:
        """Take the lock. Raises OSError or UserError."""
        self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        file = self._held.enter_context((self._folder / LOCK).open("a"))
        while True:
            try:
                lock(file.fileno())
            except BlockingIOError:
                if time.monotonic() >= until_s:
                    raise UserError(
                        str(self._folder), "", "another daemon keeps its fault memory there"
                    ) from None
                time.sleep(LOOK_AGAIN_S)
            else:
                return

    def _refuse(self, error: Exception) -> None:
        if not self._refused:
            self._log.error(
                "faults_not_kept",
                reason=str(error),
                remedy="they are known until this run ends; free the disk or give another --state",
            )
        self._refused = str(error)

    def save(self, record: bytes) -> None:
        """Have it saved, once it is loaded; a record that waits is replaced."""
        with self._turn:
            self._wanted = record
            self._asked += 1
            self._turn.notify_all()

    def is_saved(self, patience_s: float) -> bool:
        """Wait until all is saved, at most `patience_s`; return whether it is."""
        with self._turn:
            self._turn.wait_for(lambda: self._done == self._asked, patience_s)
            return self._good and self._done == self._asked

    def close(self, patience_s: float) -> None:
        """Wait for what is still to be saved, and let others have the file."""
        self.is_saved(patience_s)
        self._held.close()

    def _save_what_comes(self) -> None:
        os.nice(10)  # of this thread alone
        while True:
            with self._turn:
                self._turn.wait_for(lambda: self._wanted is not None)
                record, number = self._wanted, self._asked
                self._wanted = None
            assert record is not None
            good = self._save(record)
            with self._turn:
                self._done, self._good = number, good
                self._turn.notify_all()

    def _save(self, record: bytes) -> bool:
        try:
            with closing(open_file(self._folder / FILE)) as store, transaction(store):
                add(store, self._key, record)
        except (OSError, UserError, *DAMAGED) as error:
            self._refuse(error)
            return False
        self._refused = ""
        return True
