"""Diagnostic server: follows a run by its ring, keeps the fault memory, answers requests."""

import os
import secrets
import signal
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

import numpy as np
import structlog

from ecu.contract.faults import NOT_KEPT, fault_mask
from ecu.contract.records import RecordArray
from ecu.contract.signals import STARTING
from ecu.contract.work import Kind
from ecu.diagnostics.fault_memory import FaultMemory
from ecu.diagnostics.identifiers import BY_NUMBER, TEXTS, measured, snapshot, to_bytes
from ecu.diagnostics.memory_file import MemoryFile, Place, take_over, to_record
from ecu.diagnostics.services import pending, respond
from ecu.diagnostics.session import P2_STAR_MS, SEED_BYTES, Ecu, Session, in_time
from ecu.diagnostics.transport import Request
from ecu.diagnostics.workshop import Workshop
from ecu.recording.events import INPUT_FAULTS
from ecu.recording.ring import Batch, RingReader
from ecu.runtime.asking import Sleep
from ecu.runtime.clock import monotonic_s
from ecu.watch.daemons import is_held, pid_of
from ecu.watch.health import ailment

STORED_WITHIN_S: Final = 0.8e-3 * P2_STAR_MS
LAST_STORED_WITHIN_S: Final = 0.8  # the end of the run waits for it
SELF_TEST_CYCLES: Final = 2400
PASSED, FAILED, NOT_TESTED = range(3)
SELF_TESTS: Final = (
    "cycles advance",
    "no period was missed in the last 24 s",
    "what is learned is kept",
    "the fault memory is stored",
)
"""Bytes of the self-test's result, each PASSED, FAILED or NOT_TESTED."""


class Server:
    """Server of one run."""

    def __init__(
        self,
        ring: Path,
        state: Path | None,
        secret: bytes,
        now_s: Callable[[], float] = time.monotonic,
        sleep: Sleep = time.sleep,
    ) -> None:
        """Go on where an earlier process of this run was, or begin an operation cycle.

        `sleep` waits for the loop.

        Raises:
            UserError: there is no ring, or its configuration is none.
        """
        self.reader = RingReader(ring, asks=bool(secret))
        about = self.reader.description
        self._ring, self._now_s = ring, now_s
        self.memory = FaultMemory()
        self.session = Session()
        self.last: RecordArray | None = None
        """RECORDED, shape (1,): the last cycle."""
        self._overruns: deque[tuple[int, int]] = deque()
        """Periods missed so far, by cycle, as it was followed."""
        self._file = MemoryFile(state, str(about["store_key"])) if state else None
        self._place = Place(int(about["start_ns"]), -1)
        self._texts = {
            "software": str(about["versions"]["brake-ecu"]),
            "system": "brake-ecu",
            "configuration": str(about["config_hash"]),
            "vehicle": str(about["name"]),
        }
        axles = [about["configuration"][axle]["pad"]["thickness_new"] for axle in ("front", "rear")]
        self._new_pads = np.repeat(axles, 2)
        self._workshop = Workshop(self.reader, kept=state is not None, sleep=sleep) if secret else None
        self._ecu = Ecu(
            self.memory,
            armed=bool(about["armed"]),
            read=self._read,
            clear=self._clear,
            clearing_lasts=self._file is not None,
            self_test=self._self_test,
            work=self._work,
            can_restart=lambda: "NOTIFY_SOCKET" in os.environ and is_held(ring),
            new_seed=lambda: secrets.token_bytes(SEED_BYTES),
            secret=secret,
        )
        self._begin()

    def _begin(self) -> None:
        kept = self._file.load() if self._file else None
        if kept:
            take_over(self.memory, kept.entries)
        if kept and kept.place.start_ns == self._place.start_ns:
            self._place = kept.place
            self.reader.go_on_after(kept.place.cycle)
        else:
            self.memory.begin_operation_cycle()
        self._saved_changes = -1
        self._save()

    def follow(self) -> None:
        """Add the cycles since the last time, save what changed, end a session whose tester is silent."""
        while len((batch := self.reader.read()).records):
            self._add(batch)
        self._save()
        self._adopt(in_time(self.session, self._now_s()))

    def _add(self, batch: Batch) -> None:
        outputs = batch.records["outputs"]
        starting = np.nan_to_num(outputs["mode"]) == STARTING
        for row, failed in enumerate(fault_mask(outputs).tolist()):
            tested = ~INPUT_FAULTS if starting[row] else ~0
            record = batch.records[row : row + 1]
            self.memory.add(failed, tested, lambda record=record: snapshot(record))  # type: ignore[misc]
        self.last = batch.records[-1:]
        self._place = self._place._replace(cycle=int(self.last["cycle"]["number"][0]))
        for row in (0, -1):
            cycle = batch.records["cycle"][row]
            self._overruns.append((int(cycle["number"]), int(cycle["overruns"])))
        while self._overruns[0][0] < self._place.cycle - SELF_TEST_CYCLES:
            self._overruns.popleft()

    def _save(self) -> None:
        if self._file and self.memory.changes != self._saved_changes:
            self._saved_changes = self.memory.changes
            self._file.save(to_record(self.memory, self._place))

    def _adopt(self, session: Session) -> None:
        self.session = session
        self.memory.enabled = session.dtc_setting

    @property
    def speaks(self) -> bool:
        """False while the daemon is silent: a standby leaves answering to the first one."""
        return self.last is not None and bool(self.last["cycle"]["speaks"][0])

    def answer(self, request: Request) -> Iterator[bytes]:
        """Yield the responses to a request; each is to be sent before the next is asked for."""
        self.follow()
        if not self.speaks:
            return
        first = pending(self.session, request.data, self._ecu)
        if first:
            yield first
        session, response = respond(
            self.session, request.data, self._ecu, self._now_s(), request.functional and not first
        )
        self._adopt(session)
        if response:
            yield response

    def restart_if_asked(self) -> None:
        """End the loop where a tester reset the ECU: its service manager starts it again."""
        if self.session.restarts:
            self.session = self.session._replace(restarts=False)
            structlog.get_logger("diagnostics").warning("reset", remedy="a tester asked for it (ECUReset)")
            with suppress(OSError):
                os.kill(pid_of(self._ring), signal.SIGTERM)

    def finish(self) -> None:
        """Add the last cycles and store the fault memory."""
        self.follow()
        if self._file:
            self._file.close(LAST_STORED_WITHIN_S)

    def _read(self, number: int) -> bytes | None:
        if number in TEXTS:
            return self._texts[TEXTS[number]].encode()
        if number in BY_NUMBER:
            assert self.last is not None
            return to_bytes(BY_NUMBER[number], measured(self.last, self._new_pads))
        return None

    def _clear(self, number: int | None) -> bool:
        self.memory.clear(number)
        self._save()
        return self._file is None or self._file.is_saved(STORED_WITHIN_S)

    def _work(self, kind: Kind, values: dict[str, float]) -> None:
        assert self._workshop is not None  # without a secret nobody gets access
        self._workshop.do(kind, values)

    def _self_test(self) -> bytes:
        assert self.last is not None
        age_s = monotonic_s() - 1e-9 * float(self.last["cycle"]["t_mono_ns"][0])
        missed = self._overruns[-1][1] > self._overruns[0][1]
        kept = not int(fault_mask(self.last["outputs"])[0]) & NOT_KEPT
        stored = PASSED if self._file and self._file.is_saved(STORED_WITHIN_S) else FAILED
        results = (
            FAILED if ailment(self.reader, age_s) else PASSED,
            FAILED if missed else PASSED,
            PASSED if kept else FAILED,
            stored if self._file else NOT_TESTED,
        )
        return bytes(results)
