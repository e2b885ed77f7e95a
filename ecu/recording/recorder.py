"""Recording of a run: its files, written while the ECU runs, resumable by another process, and read back.

A folder holds the frames (candump text), the cycles (`RECORDED`, raw), their description (JSON), the state
before the first cycle, and, where parameters were calibrated meanwhile, since when by what (`calibration`).
"""

import json
import os
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple

import numpy as np

from ecu.contract.records import FRAME_EXTENDED, FRAME_FD, RecordArray
from ecu.errors import UserError
from ecu.recording.calibration import NOTES_FILE, Note, read_notes
from ecu.recording.ring import RECORDED, Batch

FRAMES_FILE, CYCLES_FILE, ABOUT_FILE, INITIAL_FILE = (
    "frames.log",
    "cycles.bin",
    "recording.json",
    "initial.bin",
)
FILES: Final = (FRAMES_FILE, CYCLES_FILE, INITIAL_FILE, NOTES_FILE, ABOUT_FILE)


def layout(dtype: np.dtype[Any]) -> dict[str, Any]:
    """Return a structured dtype as JSON: per field its format (or layout), offset and shape."""
    fields: dict[str, Any] = {}
    for name, (inner, offset, *_) in (dtype.fields or {}).items():
        base = inner.base
        fields[name] = [layout(base) if base.fields else base.str, offset, list(inner.shape)]
    return {"itemsize": dtype.itemsize, "fields": fields}


def dtype_of(described: dict[str, Any]) -> np.dtype[Any]:
    """Return the dtype described by `layout`."""
    fields = described["fields"]
    bases = [dtype_of(kind) if isinstance(kind, dict) else kind for kind, _, _ in fields.values()]
    return np.dtype(
        {
            "names": list(fields),
            "formats": [
                (base, tuple(shape)) for base, (_, _, shape) in zip(bases, fields.values(), strict=True)
            ],
            "offsets": [offset for _, offset, _ in fields.values()],
            "itemsize": described["itemsize"],
        }
    )


def interface_name(channel: str) -> str:
    """Return a channel's name as allowed in a candump log: at most 15 characters (IFNAMSIZ), no blanks."""
    return "".join(c if c.isalnum() or c in "._-" else "_" for c in channel)[:15]


def candump_lines(frames: RecordArray, channel: str) -> bytes:
    """Return frames as `candump -l` writes them, stamps in µs."""
    lines = []
    data = frames["data"].tobytes()
    columns = (frames[name].tolist() for name in ("stamp_ns", "can_id", "flags", "length"))
    for i, (stamp_ns, can_id, flags, length) in enumerate(zip(*columns, strict=True)):
        seconds, micros = divmod(stamp_ns // 1000, 1_000_000)
        number = f"{can_id:08X}" if flags & FRAME_EXTENDED else f"{can_id:03X}"
        mark = "##0" if flags & FRAME_FD else "#"
        payload = data[64 * i : 64 * i + length].hex().upper()
        lines.append(f"({seconds}.{micros:06d}) {channel} {number}{mark}{payload}\n")
    return "".join(lines).encode()


class RecordingFiles(NamedTuple):
    """The open files of a recording."""

    folder: Path
    frames: BinaryIO
    cycles: BinaryIO


def start_recording(parent: Path, description: dict[str, Any], initial: bytes) -> RecordingFiles:
    """Make a recording's folder in `parent`, named after the time of its start.

    Raises:
        UserError: the folder cannot be written.
    """
    stamp = time.strftime("%Y-%m-%dT%H-%M-%SZ", time.gmtime(description["start_ns"] / 1e9))
    folder = parent / stamp
    try:
        number = 1
        while folder.exists():
            number += 1
            folder = parent / f"{stamp}-{number}"
        folder.mkdir(parents=True)
        (folder / INITIAL_FILE).write_bytes(initial)
        about = {**description, "record": layout(RECORDED)}
        (folder / ABOUT_FILE).write_text(json.dumps(about, indent=1), encoding="utf-8")
        return RecordingFiles(
            folder,
            (folder / FRAMES_FILE).open("wb", buffering=0),
            (folder / CYCLES_FILE).open("wb", buffering=0),
        )
    except OSError as error:
        raise UserError(
            str(folder), "", f"cannot record here: {error.strerror}; free or choose a disk"
        ) from None


def resume_recording(
    parent: Path, description: dict[str, Any], frames_before: Callable[[int], int | None]
) -> tuple[RecordingFiles, int] | None:
    """Open the recording of the run with this `description` to continue it; None: there is none.

    Returns the files and the number of the last cycle in them, -1 for none. An incomplete last cycle is cut
    off; `frames_before(n)` says how many frames the cycles before n consumed. Raises OSError.
    """
    for about in sorted(parent.glob(f"*/{ABOUT_FILE}"), reverse=True):
        if json.loads(about.read_text(encoding="utf-8"))["start_ns"] == description["start_ns"]:
            break
    else:
        return None
    frames = (about.parent / FRAMES_FILE).open("r+b", buffering=0)
    cycles = (about.parent / CYCLES_FILE).open("r+b", buffering=0)
    whole = os.fstat(cycles.fileno()).st_size // RECORDED.itemsize
    cycles.truncate(cycles.seek(whole * RECORDED.itemsize))
    last = -1
    if whole:
        cycles.seek(-RECORDED.itemsize, os.SEEK_END)
        last = int(np.frombuffer(cycles.read(RECORDED.itemsize), RECORDED)["cycle"]["number"][0])
    frames.truncate(frames.seek(_end_of_lines(frames, frames_before(last + 1))))
    return RecordingFiles(about.parent, frames, cycles), last


def _end_of_lines(file: BinaryIO, count: int | None) -> int:
    """Return where the first `count` lines end; of fewer, or if it is None, where the last whole one ends."""
    seen = end = at = 0
    while block := file.read(1 << 20):
        ends = np.flatnonzero(np.frombuffer(block, np.uint8) == ord("\n")) + 1
        if count is not None and seen + len(ends) >= count:
            return at + int(ends[count - seen - 1]) if count > seen else end
        if len(ends):
            end = at + int(ends[-1])
        seen, at = seen + len(ends), at + len(block)
    return end


def make_room(folder: Path, limit_bytes: float) -> bool:
    """Remove the oldest other recordings beside `folder` until the total is within the limit.

    Returns False when this one alone is larger. Raises OSError.
    """
    recordings = sorted(about.parent for about in folder.parent.glob(f"*/{ABOUT_FILE}"))
    files = {one: [one / name for name in FILES if (one / name).exists()] for one in recordings}
    sizes = {one: sum(file.stat().st_size for file in files[one]) for one in recordings}
    total: int = sum(sizes.values())
    for one in recordings:
        if total <= limit_bytes:
            break
        if one != folder:
            for file in files[one]:
                file.unlink()
            with suppress(OSError):  # a foreign file
                one.rmdir()
            total -= sizes[one]
    return total <= limit_bytes


def write_batch(files: RecordingFiles, batch: Batch, channel: str) -> None:
    """Append one batch; frames first, so that every cycle in cycles.bin has its frames. Raises OSError."""
    _write_all(files.frames, candump_lines(batch.frames, channel))
    _write_all(files.cycles, batch.records.tobytes())


def _write_all(file: BinaryIO, data: bytes) -> None:
    rest = memoryview(data)
    while rest:
        rest = rest[file.write(rest) :]


class Recording(NamedTuple):
    """A recording, read back. Cycle k is row k of both arrays."""

    folder: Path
    about: dict[str, Any]
    cycles: RecordArray
    outputs: RecordArray
    initial: RecordArray
    """The state before the first cycle, shape (1,)."""
    frames: Path
    """candump text of the frames that were consumed, in order."""
    calibrations: list[Note]
    """Taken over meanwhile, in order."""


def read_recording(folder: Path) -> Recording:
    """Return the recording in `folder`, or the latest one below it, without an incomplete last cycle.

    Raises:
        UserError: there is no recording.
    """
    if not (folder / ABOUT_FILE).exists():
        inside = sorted(about.parent for about in folder.glob(f"*/{ABOUT_FILE}"))
        if not inside:
            raise UserError(str(folder), "", f"no recording here ({ABOUT_FILE} is missing); give a log")
        folder = inside[-1]
    try:
        about = json.loads((folder / ABOUT_FILE).read_text(encoding="utf-8"))
        kind = dtype_of(about["record"])
        content = (folder / CYCLES_FILE).read_bytes()
        records = np.frombuffer(content, kind, len(content) // kind.itemsize)
        cycles, outputs = records["cycle"], records["outputs"]
        initial = np.frombuffer((folder / INITIAL_FILE).read_bytes(), dtype_of(about["state"]))
        notes = read_notes(folder)
    except (OSError, ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        reason = " ".join(str(error).split())[:200]
        raise UserError(str(folder), "", f"not a complete recording: {reason}") from None
    return Recording(folder, about, cycles, outputs, initial, folder / FRAMES_FILE, notes)
