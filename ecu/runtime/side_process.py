"""Side process of `run`: reads the ring, writes the recording, keeps the state store and logs events.

`python -m ecu.runtime.side_process --ring RING --leash SOCKET --parent PID [--record DIR [--record-limit
GB]] [--state DIR] [--standby True] [--metrics ADDRESS:PORT] [--diagnostics SETTINGS] [--xcp SETTINGS]
[--again]`, started by `ecu/runtime/supervisor.py`. It ends when the ring is closed or the loop has died,
after everything in the ring is written; signals to the group are left to the loop. A full disk ends the
recording, nothing else; an unwritable store is tried again at the next change. `--again`: continue after an
earlier one that died.
"""

import argparse
import math
import os
import select
import socket
import sqlite3
import sys
import time
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Final

import numpy as np
import structlog

from ecu.contract.records import RecordArray
from ecu.contract.work import to_json
from ecu.errors import UserError
from ecu.recording import store as state_store
from ecu.recording.calibration import add_note, in_force, read_notes
from ecu.recording.events import EventLog
from ecu.recording.log import configure_logging
from ecu.recording.recorder import (
    RecordingFiles,
    dtype_of,
    make_room,
    resume_recording,
    start_recording,
    write_batch,
)
from ecu.recording.revisions import DAMAGED
from ecu.recording.ring import Batch, RingReader, remove_ring
from ecu.recording.sink import free_output
from ecu.runtime.side import KEPT, NOT_KEPT, READY, REFUSED, word
from ecu.runtime.start import leave_signals, lower_priority
from ecu.runtime.supervisor import become

PERIOD_S: Final = 0.1
LOOK_FOR_RING_S: Final = 0.005
LOOK_AT_SIZE_S: Final = 10.0  # a megabyte


class Recorder:
    """Side process of one ring: recording, state store and events."""

    def __init__(
        self,
        reader: RingReader,
        record: Path | None,
        state: Path | None,
        *,
        limit_bytes: float = math.inf,
        again: bool = False,
    ) -> None:
        about = reader.description
        self.reader, self.log = reader, structlog.get_logger("recorder")
        self.events = EventLog(messages=about.get("messages"))
        self.channel, self.key = str(about["channel"]), str(about["store_key"])
        self.files: RecordingFiles | None = None
        self._limit_bytes, self._looked_s = limit_bytes, -math.inf
        self._noted, self._worked = 0, -1
        if again:
            self._go_on(record)
        elif record:
            self.files = start_recording(record, about, reader.initial)
        initial = np.frombuffer(reader.initial, dtype_of(about["state"]))
        self.keeper = state_store.first_keeper(initial["learned"], time.monotonic())
        self.store: sqlite3.Connection | None = None
        self._kept_open = ExitStack()
        self.state, self._refused = state, ""
        self._file: tuple[int, int] | None = None
        if state:
            self._open_store(state)

    def _go_on(self, record: Path | None) -> None:
        last = int(self.reader.ring.header[0]["followed"])
        try:
            found = (
                resume_recording(record, self.reader.description, self.reader.frames_before)
                if record
                else None
            )
        except (OSError, ValueError, KeyError) as error:
            self._stop_recording(str(record), str(error))
            found = None
        if found:
            self.files, last = found
            self._noted = max((one.number for one in read_notes(self.files.folder)), default=0)
        seen = self.reader.go_on_after(last)
        if seen is not None:
            self.events.begin_after(seen)

    def _open_store(self, state: Path) -> None:
        try:
            self.store = state_store.open_store(state)
            self._file = state_store.identity(state)
            self._kept_open.enter_context(state_store.in_use(state))
        except (UserError, OSError) as error:
            self._refuse(str(error))

    def _refuse(self, reason: str) -> None:
        if not self._refused:
            self.log.error(
                "not_kept", reason=reason, remedy="what is learned ends with the run unless this is mended"
            )
        self._refused = reason

    @property
    def kept(self) -> bool:
        """True while learned values are stored, or need not be."""
        return not self._refused

    def turn(self) -> int:
        """Process the cycles since the last turn; return their number."""
        batch = self.reader.read()
        if len(batch.records):
            if self.files:
                self._record(self.files, batch)
            self._note_calibration()
            self.events.look(batch.records, self.reader.lost_cycles, self.reader.lost_frames)
            self._keep()
        return len(batch.records)

    def _record(self, files: RecordingFiles, batch: Batch) -> None:
        try:
            write_batch(files, batch, self.channel)
            if time.monotonic() - self._looked_s >= LOOK_AT_SIZE_S and self._limit_bytes < math.inf:
                self._looked_s = time.monotonic()
                if not make_room(files.folder, self._limit_bytes):
                    self._stop_recording(str(files.folder), "this recording alone is at --record-limit")
        except OSError as error:
            self._stop_recording(str(files.folder), str(error.strerror))

    def _note_calibration(self) -> None:
        """Log a calibration or work and note it in the recording, before its cycles count as handled."""
        if int(self.reader.ring.header["calibration"][0]) == self._noted:
            return
        found = in_force(self.reader.ring)
        if found is None:
            return
        self._noted = found.number
        if found.work is None:
            self.log.info("calibrated", number=found.number, cycle=found.cycle)
        else:
            self._worked = found.cycle
            self.log.info("serviced", number=found.number, cycle=found.cycle, **to_json(found.work))
        if self.files:
            try:
                add_note(self.files.folder, found)
            except OSError as error:
                self._stop_recording(str(self.files.folder), str(error.strerror))

    def _stop_recording(self, folder: str, reason: str) -> None:
        self.log.error(
            "recording_stopped", folder=folder, reason=reason, remedy="free the disk and start anew"
        )
        self.files = None

    def _keep(self) -> None:
        """Save after work on the learned values or a brake application, or a minute after another change."""
        now_s, learned = time.monotonic(), self.reader.latest("learned")
        if learned is None:
            return
        worked = 0 <= self._worked <= self.reader.last_read
        if worked or self._is_removed() or state_store.is_due(self.keeper, learned, now_s):
            self._worked = -1 if worked else self._worked
            self._save(learned, now_s)

    def _is_removed(self) -> bool:
        """Close and report a store whose file was removed or replaced: what is saved to it is lost."""
        if self.store is None or self.state is None or state_store.identity(self.state) == self._file:
            return False
        self.log.error(
            "store_removed", folder=str(self.state), remedy="it is made anew by what this run has learned"
        )
        self.store.close()
        self.store = None
        return True

    def _save(self, learned: RecordArray, now_s: float) -> None:
        if self.state and self.store is None:
            self._open_store(self.state)
        if self.store is None:
            return
        try:
            state_store.save(self.store, self.key, learned)
            self._refused = ""
            self.keeper = state_store.first_keeper(learned, now_s)
        except DAMAGED as error:
            self._refuse(str(error))
            self.store.close()
            self.store = None  # reopened, and set aside if damaged, at the next change

    def finish(self) -> None:
        """Write the rest: the ring, then the values learned since the last save."""
        while self.turn():
            pass
        learned = self.reader.latest("learned")
        if learned is not None and (self._is_removed() or learned.tobytes() != self.keeper.saved):
            self._save(learned, time.monotonic())
        if self.files:
            for file in (self.files.frames, self.files.cycles):
                os.fsync(file.fileno())
                file.close()
        if self.store:
            self.store.close()
        self._kept_open.close()

    def say_last_words(self) -> None:
        """Log how the run ended."""
        if self.reader.closed:
            structlog.get_logger("ecu").info("stopped", **self.reader.last_words)
        else:
            self.log.error("loop_gone", remedy="the ECU was killed; it has to be started again")


def _say(leash: socket.socket, what: bytes) -> None:
    """Send a message; a loop that does not read it, or has died, is ignored."""
    with suppress(OSError):
        leash.send(what, socket.MSG_DONTWAIT | socket.MSG_NOSIGNAL)


def _loop_is_gone(leash: socket.socket, patience_s: float) -> bool:
    """Wait that long; the loop sends nothing, so anything readable is its end."""
    return bool(select.select([leash], [], [], patience_s)[0])


def _follow(recorder: Recorder, leash: socket.socket, parent: int) -> bool:
    """Turn until the loop has ended or died; False: the supervisor has died, take its place."""
    while not recorder.reader.closed:
        recorder.turn()
        _say(leash, word(KEPT if recorder.kept else NOT_KEPT, recorder.reader.last_read))
        if os.getppid() != parent:
            return False
        if _loop_is_gone(leash, PERIOD_S):
            break
    return True


def main() -> int:
    """Follow the ring until its writer has ended or died."""
    parser = argparse.ArgumentParser(
        prog="python -m ecu.runtime.side_process", description="The side process of run."
    )
    parser.add_argument("--ring", type=Path, required=True)
    parser.add_argument("--leash", type=int, required=True)
    parser.add_argument("--parent", type=int, required=True)
    parser.add_argument("--record", type=Path)
    parser.add_argument("--record-limit", type=float, default=math.inf)
    parser.add_argument("--state", type=Path)
    for name in ("--standby", "--metrics", "--diagnostics", "--xcp"):
        parser.add_argument(name, help="of the supervisor that this process may become")
    parser.add_argument("--again", action="store_true")
    options = parser.parse_args()
    free_output()
    leave_signals()
    configure_logging()
    leash = socket.socket(fileno=options.leash)
    while not options.ring.exists():
        if _loop_is_gone(leash, LOOK_FOR_RING_S):
            return 0
    try:
        recorder = Recorder(
            RingReader(options.ring),
            options.record,
            options.state,
            limit_bytes=1e9 * options.record_limit,
            again=options.again,
        )
    except UserError as error:
        _say(leash, REFUSED + str(error).encode())
        return 2
    if not options.again:
        _say(leash, READY)
    lower_priority()
    if not _follow(recorder, leash, options.parent):
        recorder.finish()
        structlog.get_logger("recorder").error("supervisor_gone", remedy="this process takes its place")
        become(options.leash, _passed_on(sys.argv[1:]))
    recorder.finish()
    recorder.say_last_words()
    remove_ring(options.ring)
    return 0


def _passed_on(arguments: list[str]) -> list[str]:
    """Return the arguments for the next process: all but those added by a supervisor."""
    kept = [argument for argument in arguments if argument != "--again"]
    for name in ("--leash", "--parent"):
        at = kept.index(name)
        del kept[at : at + 2]
    return kept


if __name__ == "__main__":
    raise SystemExit(main())
