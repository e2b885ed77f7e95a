"""Ring in shared memory: written by the cycle without waiting (`publish.py`), read by any process.

The file holds a header, parameters that another process asks the loop for (`calibration.py`), a description
(JSON), the state before the first cycle, a slot per cycle, the learned values and what was found of the
inputs (of the last two cycles, in turn) and a ring of frames. A slot holds what a recording keeps of a cycle,
and its inputs and estimate. It carries its number before and after its content is written (-1 between), so an
overtaken reader notices and counts its losses. Frames are claimed before they are overwritten.

The file is its owner's alone: made anew (O_EXCL, O_NOFOLLOW), mode 0600, and read only if it belongs to the
reader's user. Its writer holds a lock on it for its lifetime, across namespaces.
"""

import json
import mmap
import os
import secrets
import stat
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.algorithm.estimate import ESTIMATE
from ecu.contract.params import PARAMS
from ecu.contract.records import CYCLE, FRAME, INPUT_WATCH, INPUTS, LEARNED, OUTPUTS, RecordArray
from ecu.contract.work import WORK
from ecu.errors import UserError
from ecu.recording.lock import lock

SLOTS: Final = 2400  # 24 s of cycles
FRAMES: Final = 131072  # 29 s of a classical bus at 45 frames per cycle

# One cycle as stored in the ring's slots and in a recording's cycles.bin.
RECORDED: Final = np.dtype([("cycle", CYCLE), ("outputs", OUTPUTS)], align=True)
# What is measured of a cycle beside it: what step read, and what it estimated.
BESIDE: Final = np.dtype([("inputs", INPUTS), ("estimate", ESTIMATE)], align=True)
_SLOT: Final = np.dtype(
    [("number", "i8"), ("first_frame", "i8"), ("recorded", RECORDED), ("beside", BESIDE)], align=True
)
_LATEST_VALUES: Final = np.dtype([("learned", LEARNED), ("watched", INPUT_WATCH)], align=True)
_LAST_WORDS_BYTES: Final = 3072
TABLES_BYTES: Final = 16384
# What another process asks for; its number is written last.
ASKED: Final = np.dtype(
    [
        ("number", "i8"),
        ("page", "i8"),  # of those below
        ("until_ns", "i8"),  # on the monotonic clock: refused later
        ("check", "i8"),  # CRC-32 of the page
    ]
)
# Parameters, the tables of CONFIG that they are made of (JSON), and what is done once as they are taken over.
PAGE: Final = np.dtype(
    [("number", "i8"), ("params", PARAMS), ("tables", f"S{TABLES_BYTES}"), ("work", WORK)], align=True
)
_CALIBRATION: Final = np.dtype([("asked", ASKED), ("pages", PAGE, (2,))], align=True)
_HEADER: Final = np.dtype(
    [
        ("magic", "u8"),
        ("slots", "i8"),
        ("frames", "i8"),
        ("description_bytes", "i8"),
        ("initial_bytes", "i8"),
        ("written", "i8"),  # cycles so far
        ("frames_claimed", "i8"),
        ("frames_written", "i8"),
        ("closed", "i8"),
        ("followed", "i8"),  # last cycle that the side process reported as handled, -1: none
        ("answered", "i8"),  # number of the last question for a calibration that was answered
        ("calibration", "i8"),  # number of the calibration that the loop goes by, 0: CONFIG
        ("page", "i8"),  # in which it is
        ("calibrated_from", "i8"),  # its first cycle
        ("last_words", f"S{_LAST_WORDS_BYTES}"),  # JSON
    ]
)
_MAGIC: Final = int.from_bytes(b"ecuring7", "little")
_PAGE: Final = 4096
_NO_OBJECT: Final = (ValueError, TypeError, RecursionError)  # of JSON


class Ring(NamedTuple):
    """The mapped parts of a ring."""

    path: Path
    memory: mmap.mmap
    header: RecordArray
    slots: RecordArray
    latest: RecordArray
    """Shape (2,): after cycle k in row k % 2."""
    frames: RecordArray
    asked: RecordArray
    """ASKED, shape (1,)."""
    pages: RecordArray
    """PAGE, shape (2,)."""


def ring_folder() -> Path:
    """Return the folder of rings: in memory, not on a disk, where the machine has one."""
    shared = Path("/dev/shm")
    return shared if os.access(shared, os.W_OK) else Path(tempfile.gettempdir())


def living_rings() -> list[Path]:
    """Return our user's rings whose writers live; remove those of dead ones."""
    folder, rings = ring_folder(), []
    for path in sorted([*folder.glob("brake-ecu.*.ring"), *folder.glob("brake-ecu.*.new")]):
        try:
            handle = open_own(path)
        except OSError:  # another user's, or removed meanwhile
            continue
        try:
            lock(handle, shared=True)
            remove_ring(path)
        except BlockingIOError:
            rings += [path] if path.suffix == ".ring" else []
        finally:
            os.close(handle)
    return rings


def open_own(path: Path, access: int = os.O_RDONLY) -> int:
    """Open a regular file that is ours and writable by nobody else. Raises OSError for any other."""
    handle = os.open(path, access | os.O_NOFOLLOW | os.O_NONBLOCK)
    found = os.fstat(handle)
    others = stat.S_IWGRP | stat.S_IWOTH
    if stat.S_ISREG(found.st_mode) and found.st_uid == os.geteuid() and not found.st_mode & others:
        return handle
    os.close(handle)
    raise PermissionError(1, "not a file of this user alone")


def ring_path(pid: int) -> Path:
    """Return the path of the ring of process `pid`. Containers sharing the folder have pids of their own."""
    living_rings()
    try:
        namespace = os.stat("/proc/self/ns/pid").st_ino
    except OSError:
        namespace = 0
    return ring_folder() / f"brake-ecu.{namespace}.{pid}.ring"


def _round_up(size: int) -> int:
    return -(-size // _PAGE) * _PAGE


_HEAD: Final = _round_up(_HEADER.itemsize) + _round_up(_CALIBRATION.itemsize)


def _is_ring(memory: mmap.mmap) -> bool:
    """Return whether header and size agree."""
    if len(memory) < _PAGE:
        return False
    row = np.frombuffer(memory, _HEADER, 1)[0]
    sizes = [int(row[name]) for name in ("slots", "frames", "description_bytes", "initial_bytes")]
    if int(row["magic"]) != _MAGIC or min(sizes[:2]) < 1 or min(sizes[2:]) < 0:
        return False
    parts = (
        sum(sizes[2:]),
        sizes[0] * _SLOT.itemsize,
        2 * _LATEST_VALUES.itemsize,
        sizes[1] * FRAME.itemsize,
    )
    return _HEAD + sum(map(_round_up, parts)) == len(memory)


def _map(path: Path, memory: mmap.mmap) -> Ring:
    header = np.frombuffer(memory, _HEADER, 1)
    row = header[0]
    calibration = np.frombuffer(memory, _CALIBRATION, 1, _round_up(_HEADER.itemsize))
    at = _HEAD + _round_up(int(row["description_bytes"]) + int(row["initial_bytes"]))
    slots = np.frombuffer(memory, _SLOT, int(row["slots"]), at)
    at += _round_up(slots.nbytes)
    latest = np.frombuffer(memory, _LATEST_VALUES, 2, at)
    frames = np.frombuffer(memory, FRAME, int(row["frames"]), at + _round_up(latest.nbytes))
    return Ring(path, memory, header, slots, latest, frames, calibration["asked"], calibration["pages"][0])


def create_ring(
    path: Path, description: dict[str, Any], initial: bytes, *, slots: int = SLOTS, frames: int = FRAMES
) -> Ring:
    """Create the ring with all its pages in memory; it appears at `path` when complete.

    `description` defines the records for readers; `initial` is the state before the first cycle.

    Raises:
        UserError: no room for it.
    """
    text = json.dumps(description).encode()
    head = _HEAD + _round_up(len(text) + len(initial))
    parts = (slots * _SLOT.itemsize, 2 * _LATEST_VALUES.itemsize, frames * FRAME.itemsize)
    size = head + sum(map(_round_up, parts))
    unfinished = path.with_name(f"{path.name}.{secrets.token_hex(4)}.new")
    try:
        handle = os.open(unfinished, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o600)
        try:
            lock(handle)  # the mapping keeps it
            os.posix_fallocate(handle, 0, size)
            memory = mmap.mmap(handle, size, mmap.MAP_SHARED | mmap.MAP_POPULATE)
        finally:
            os.close(handle)
    except OSError as error:
        remove_ring(unfinished)
        raise UserError(
            str(path), "", f"cannot make a ring of {size >> 20} MB there: {error.strerror}"
        ) from None
    row = np.frombuffer(memory, _HEADER, 1)[0]
    row["slots"], row["frames"], row["followed"] = slots, frames, -1
    row["description_bytes"], row["initial_bytes"] = len(text), len(initial)
    memory[_HEAD : _HEAD + len(text) + len(initial)] = text + initial
    ring = _map(path, memory)
    ring.slots["number"] = -1
    row["magic"] = _MAGIC
    try:
        unfinished.rename(path)
    except OSError as error:
        remove_ring(unfinished)
        raise UserError(str(path), "", f"cannot be replaced: {error.strerror}; remove it") from None
    return ring


def close_ring(ring: Ring, last_words: dict[str, Any] | None = None) -> None:
    """Tell readers that the stream has ended; the file is freed when the last of them closes it."""
    ring.header[0]["last_words"] = json.dumps(last_words or {}).encode()
    ring.header[0]["closed"] = 1


class Batch(NamedTuple):
    """Cycles read from a ring, in order."""

    records: RecordArray
    """RECORDED, shape (n,)."""
    frames: RecordArray
    """FRAME, the frames of these cycles in the order they were consumed."""
    beside: RecordArray
    """BESIDE, shape (n,)."""


class RingReader:
    """Reader of a ring behind its writer, from the oldest cycle still present."""

    def __init__(self, path: Path, *, asks: bool = False) -> None:
        """`asks`: it may write, to ask for a calibration. Raises UserError: there is no ring."""
        access, protection = (os.O_RDWR, mmap.PROT_WRITE) if asks else (os.O_RDONLY, 0)
        try:
            handle = open_own(path, access)
            try:
                memory = mmap.mmap(handle, 0, prot=mmap.PROT_READ | protection)
            finally:
                os.close(handle)
        except (OSError, ValueError) as error:
            raise UserError(str(path), "", f"no ring to read here: {error}") from None
        if not _is_ring(memory):
            raise UserError(str(path), "", "not a ring of this version; start the service anew")
        self.ring = _map(path, memory)
        row = self.ring.header[0]
        end = _HEAD + int(row["description_bytes"])
        try:
            self.description: dict[str, Any] = dict(json.loads(memory[_HEAD:end]))
        except _NO_OBJECT:
            raise UserError(str(path), "", "not a ring: its description cannot be read") from None
        self.initial: bytes = memory[end : end + int(row["initial_bytes"])]
        self.lost_cycles = self.lost_frames = 0
        self._next = max(0, int(row["written"]) - len(self.ring.slots))

    @property
    def closed(self) -> bool:
        """True once the writer has ended the stream of cycles."""
        return bool(self.ring.header[0]["closed"])

    @property
    def last_read(self) -> int:
        """The number of the last cycle that was read, -1 before the first."""
        return self._next - 1

    @property
    def last_words(self) -> dict[str, Any]:
        """Last message of the writer, from when it closed the ring; empty: none that can be read."""
        try:
            return dict(json.loads(bytes(self.ring.header[0]["last_words"])))
        except _NO_OBJECT:
            return {}

    def go_on_after(self, number: int) -> RecordArray | None:
        """Continue after cycle `number`; return that cycle (`RECORDED`, shape (1,)) if it is present."""
        self._next = number + 1
        return self._cycle(number)

    def newest(self) -> RecordArray | None:
        """Return the last cycle (`RECORDED`, shape (1,)), None before the first, or overtaken."""
        return self._cycle(int(self.ring.header[0]["written"]) - 1)

    def _cycle(self, number: int) -> RecordArray | None:
        place = number % len(self.ring.slots)
        slot = self.ring.slots[place : place + 1].copy()
        return slot["recorded"] if slot["number"][0] == number >= 0 else None

    def frames_before(self, number: int) -> int | None:
        """Return the number of frames consumed by all cycles before `number`; None: no longer known."""
        header = self.ring.header[0]
        slot = self.ring.slots[number % len(self.ring.slots)].copy()
        if slot["number"] == number:
            return int(slot["first_frame"])
        total = int(header["frames_written"])
        return total if header["written"] == number else None

    def latest(self, name: str) -> RecordArray | None:
        """Return `learned` (LEARNED) or `watched` (INPUT_WATCH) of the last cycle, shape (1,), or None."""
        for _ in range(10):  # the writer may overtake us
            written = int(self.ring.header[0]["written"])
            row = (written - 1) % 2
            copied = self.ring.latest[name][row : row + 1].copy()
            if written and written == int(self.ring.header[0]["written"]):
                return copied
        return None

    def read(self, limit: int = 256) -> Batch:
        """Return up to `limit` unread cycles; overwritten ones are counted as lost."""
        header, slots = self.ring.header[0], self.ring.slots
        written = int(header["written"])
        oldest = written - len(slots)
        if self._next < oldest:
            self.lost_cycles += oldest - self._next
            self._next = oldest
        wanted = np.arange(self._next, min(written, self._next + limit))
        copied = slots[wanted % len(slots)]
        intact = (copied["number"] == wanted) & (slots["number"][wanted % len(slots)] == wanted)
        self.lost_cycles += int(len(wanted) - intact.sum())
        self._next += len(wanted)
        copied = copied[intact]
        return Batch(copied["recorded"], self._frames(copied), copied["beside"])

    def _frames(self, slots: RecordArray) -> RecordArray:
        ring = self.ring.frames
        counts = slots["recorded"]["cycle"]["frames"].astype(np.int64)
        total = int(counts.sum())
        starts = np.repeat(slots["first_frame"] - (np.cumsum(counts) - counts), counts)
        places: NDArray[np.int64] = starts + np.arange(total)
        copied = ring[places % len(ring)]
        intact = places >= int(self.ring.header[0]["frames_claimed"]) - len(ring)
        self.lost_frames += int(total - intact.sum())
        return copied[intact]


def remove_ring(path: Path) -> None:
    """Unlink the ring; processes that have it mapped keep it."""
    with suppress(OSError):
        path.unlink()
