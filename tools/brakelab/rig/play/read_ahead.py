"""Read-ahead of frames by a second process, so that reading and unpacking a log never delays sending.

Both share a ring of slots. A slot without frames is the end; the reader's findings, or its error, then follow
through a pipe.
"""

import ctypes
import signal
from collections.abc import Callable, Iterator
from itertools import cycle
from multiprocessing import get_context, parent_process
from types import TracebackType
from typing import Any, Final

import numpy as np

from brakelab.replay.quality import Findings
from ecu.contract.records import FRAME, RecordArray
from ecu.errors import RunFault, UserError

SLOTS: Final = 64
SLOT_FRAMES: Final = 1024
"""64 slots of 80 kB: 15 s of a full bus at 500 kbit/s."""
LOOK_S: Final = 1.0
"""How often each side looks whether the other is still there while it waits for it."""

Read = Callable[[Findings], Iterator[RecordArray]]


class ReadAhead:
    """The frames of `read(findings)` in blocks, read by a process of its own.

    A block is overwritten once the next is requested. At the end `findings` are the reader's.
    """

    def __init__(self, read: Read, findings: Findings) -> None:
        context = get_context("spawn")
        self.findings = findings
        memory = context.RawArray(ctypes.c_uint8, SLOTS * SLOT_FRAMES * FRAME.itemsize)
        self._slots = _slots(memory)
        self._counts = context.RawArray(ctypes.c_int64, SLOTS)
        self._free, self._filled = context.Semaphore(SLOTS), context.Semaphore(0)
        self._answer, answer = context.Pipe(duplex=False)
        self._reader = context.Process(
            target=_read,
            args=(read, findings, memory, self._counts, self._free, self._filled, answer),
            daemon=True,
        )
        # Ctrl-C is for the player: a process inherits blocked signals.
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            self._reader.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        answer.close()

    def __enter__(self) -> "ReadAhead":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._reader.terminate()
        self._reader.join()

    def __iter__(self) -> Iterator[RecordArray]:
        """Yield the blocks.

        Raises:
            UserError: as `read` does, after the frames before.
            RunFault: the reader ended early.
        """
        for slot in cycle(range(SLOTS)):
            while not self._filled.acquire(timeout=LOOK_S):
                if not self._reader.is_alive() and not self._filled.acquire(block=False):
                    raise RunFault(f"{self.findings.path}: the process that read it ended early")
            if not self._counts[slot]:
                break
            yield self._slots[slot, : self._counts[slot]]
            self._free.release()
        answer = self._answer.recv()
        if isinstance(answer, UserError):
            raise answer
        self.findings = answer


def _slots(memory: Any) -> RecordArray:
    return np.frombuffer(memory, FRAME).reshape(SLOTS, SLOT_FRAMES)


def _read(
    read: Read, findings: Findings, memory: Any, counts: Any, free: Any, filled: Any, answer: Any
) -> None:
    """Fill the slots, then send the findings or the error; leave if the slots are no longer read."""
    slots, order = _slots(memory), cycle(range(SLOTS))
    parent = parent_process()
    assert parent is not None

    def next_slot() -> int:
        while not free.acquire(timeout=LOOK_S):
            if not parent.is_alive():
                raise SystemExit
        return next(order)

    def hand_over(slot: int, count: int) -> None:
        counts[slot] = count
        filled.release()

    result: Findings | UserError = findings
    slot, count = next_slot(), 0
    try:
        for frames in read(findings):
            first = 0
            while first < len(frames):
                part = frames[first : first + SLOT_FRAMES - count]
                slots[slot, count : count + len(part)] = part
                first, count = first + len(part), count + len(part)
                if count == SLOT_FRAMES:
                    hand_over(slot, count)
                    slot, count = next_slot(), 0
    except UserError as error:
        result = error
    if count:
        hand_over(slot, count)
        slot = next_slot()
    hand_over(slot, 0)
    answer.send(result)
