"""The side process of `run`: it reads the ring, writes the recording, keeps the state store and logs events.

`python -m ecu.recorder --ring RING --parent PID [--record DIR] [--state DIR]`. It ends when the ring is
closed or its parent is gone, after everything in the ring is written; signals to the group are left to
the parent. It begins when a line comes on its standard input: the ring is there. A disk that is full ends
the recording, nothing else.
"""

import argparse
import json
import os
import signal
import sqlite3
import sys
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple

import numpy as np
import structlog

from ecu.diagnostics import store as state_store
from ecu.diagnostics.events import EventLog
from ecu.diagnostics.log import configure_logging
from ecu.errors import UserError
from ecu.records import FRAME_EXTENDED, FRAME_FD, RecordArray
from ecu.ring import RECORDED, Batch, RingReader, remove_ring
from ecu.start import like_others

PERIOD_S: Final = 0.1
FRAMES_FILE, CYCLES_FILE, ABOUT_FILE, INITIAL_FILE = (
    "frames.log",
    "cycles.bin",
    "recording.json",
    "initial.bin",
)


def layout(dtype: np.dtype[Any]) -> dict[str, Any]:
    """Return a structured dtype as JSON: per field its format (or layout), offset and shape."""
    fields: dict[str, Any] = {}
    for name, (inner, offset, *_) in (dtype.fields or {}).items():
        base = inner.base
        fields[name] = [layout(base) if base.fields else base.str, offset, list(inner.shape)]
    return {"itemsize": dtype.itemsize, "fields": fields}


def dtype_of(described: dict[str, Any]) -> np.dtype[Any]:
    """Return the dtype that `layout` described."""
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
    """Return a channel's name as a candump log can bear it: at most 15 characters (IFNAMSIZ), no blanks."""
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


def write_batch(files: RecordingFiles, batch: Batch, channel: str) -> None:
    """Append one batch; frames first, so that a cycle in cycles.bin has its frames. Raises OSError."""
    _write_all(files.frames, candump_lines(batch.frames, channel))
    _write_all(files.cycles, batch.records.tobytes())


def _write_all(file: BinaryIO, data: bytes) -> None:
    rest = memoryview(data)
    while rest:
        rest = rest[file.write(rest) :]


class Recording(NamedTuple):
    """A recording, read back. Cycle k stands in row k of both arrays."""

    folder: Path
    about: dict[str, Any]
    cycles: RecordArray
    outputs: RecordArray
    initial: RecordArray
    """The state before the first cycle, shape (1,)."""
    frames: Path
    """candump text of the frames that were consumed, in order."""


def read_recording(folder: Path) -> Recording:
    """Read the recording in `folder`, or the latest of those in it; a torn last cycle is left out.

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
        initial = np.frombuffer((folder / INITIAL_FILE).read_bytes(), dtype_of(about["state"]))
    except (OSError, ValueError, KeyError) as error:
        raise UserError(str(folder), "", f"not a complete recording: {error}") from None
    return Recording(folder, about, records["cycle"], records["outputs"], initial, folder / FRAMES_FILE)


class Recorder:
    """Everything the side process does with one ring."""

    def __init__(self, reader: RingReader, record: Path | None, state: Path | None) -> None:
        about = reader.description
        self.reader, self.log = reader, structlog.get_logger("recorder")
        self.events = EventLog()
        self.channel, self.key = str(about["channel"]), str(about["store_key"])
        self.files = start_recording(record, about, reader.initial) if record else None
        self.store = state_store.open_store(state) if state else None
        self.kept_open = ExitStack()
        if state:
            self.kept_open.enter_context(state_store.in_use(state))
        initial = np.frombuffer(reader.initial, dtype_of(about["state"]))
        self.keeper = state_store.first_keeper(initial["learned"], time.monotonic())
        self._store_refused = False

    def turn(self) -> int:
        """Handle what came since the last turn; return how many cycles that was."""
        batch = self.reader.read()
        if len(batch.records):
            if self.files:
                self._record(self.files, batch)
            self.events.look(batch.records, self.reader.lost_cycles, self.reader.lost_frames)
            self._keep()
        return len(batch.records)

    def _record(self, files: RecordingFiles, batch: Batch) -> None:
        try:
            write_batch(files, batch, self.channel)
        except OSError as error:
            self.log.error(
                "recording_stopped",
                folder=str(files.folder),
                reason=error.strerror,
                remedy="free the disk and start anew",
            )
            self.files = None

    def _keep(self) -> None:
        """Save after a braking, or a minute after another change."""
        now_s, learned = time.monotonic(), self.reader.learned()
        if learned is not None and state_store.is_due(self.keeper, learned, now_s):
            self._save(learned, now_s)

    def _save(self, learned: RecordArray, now_s: float) -> None:
        if self.store is None:
            return
        try:
            state_store.save(self.store, self.key, learned)
            self._store_refused = False
            self.keeper = state_store.first_keeper(learned, now_s)
        except sqlite3.Error as error:
            if not self._store_refused:
                self.log.error("not_saved", reason=str(error), remedy="free the disk; it is tried again")
            self._store_refused = True

    def finish(self) -> None:
        """Write out the rest: the ring, then what was learned since the last save."""
        while self.turn():
            pass
        learned = self.reader.learned()
        if learned is not None and learned.tobytes() != self.keeper.saved:
            self._save(learned, time.monotonic())
        if self.files:
            for file in (self.files.frames, self.files.cycles):
                os.fsync(file.fileno())
                file.close()
        if self.store:
            self.store.close()
        self.kept_open.close()


def main() -> int:
    """Follow the ring until its writer is done or gone."""
    parser = argparse.ArgumentParser(prog="python -m ecu.recorder", description="The side process of run.")
    parser.add_argument("--ring", type=Path, required=True)
    parser.add_argument("--parent", type=int, required=True)
    parser.add_argument("--record", type=Path)
    parser.add_argument("--state", type=Path)
    options = parser.parse_args()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    configure_logging()
    if not sys.stdin.readline():  # the parent makes the ring, then says so; it went instead
        return 1
    try:
        recorder = Recorder(RingReader(options.ring), options.record, options.state)
    except UserError as error:
        print(error, flush=True)
        return 2
    print("ready", flush=True)
    like_others()
    while os.getppid() == options.parent and not recorder.reader.closed:
        recorder.turn()
        time.sleep(PERIOD_S)
    recorder.finish()
    remove_ring(options.ring)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
