"""Asking the running loop for a change, from another process: one at a time, answered or given up."""

import os
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any, Final

from ecu.contract.records import RecordArray
from ecu.contract.work import Work
from ecu.recording.calibration import ask, in_force
from ecu.recording.ring import Ring, RingReader, open_own
from ecu.runtime.clock import monotonic_s
from ecu.settings.config import config_of, new_params

ANSWERS_IN_S: Final = 0.5
"""The loop looks ten times a second."""
LOOK_S: Final = 0.01

Sleep = Callable[[float], None]


class Busy(Exception):
    """Another change is in progress: ask again."""


def taken_over(
    reader: RingReader,
    params: RecordArray,
    tables: dict[str, Any],
    work: Work | None = None,
    sleep: Sleep = time.sleep,
) -> int | None:
    """Have the loop take over `params` and do `work`; return its first cycle with them, None: refused.

    Args:
        reader: opened to ask.
        params: `PARAMS`, shape (1,).
        tables: of CONFIG, those that they may differ in.
        work: on the learned values.
        sleep: waits so many seconds.

    Raises:
        Busy: another process asks, or the last change is not recorded yet.
    """
    header = reader.ring.header
    with _alone(reader.ring):
        if not wait(lambda: header["followed"][0] >= header["calibrated_from"][0], sleep):
            raise Busy("the change before is not recorded yet; try again")
        before = header["calibration"][0]
        until_ns = round(1e9 * (monotonic_s() + ANSWERS_IN_S))
        number = ask(reader.ring, params, tables, until_ns, work)
        wait(lambda: header["answered"][0] == number, sleep)
        return None if header["calibration"][0] == before else int(header["calibrated_from"][0])


def worked(reader: RingReader, work: Work, sleep: Sleep = time.sleep) -> int | None:
    """Have the loop do `work` and leave its parameters as they are; else as `taken_over`."""
    found = in_force(reader.ring)
    tables = {} if found is None else found.tables
    params = new_params(config_of({**reader.description["configuration"], **tables}, reader.ring.path.name))
    return taken_over(reader, params, tables, work, sleep)


def wait(done: Callable[[], bool], sleep: Sleep) -> bool:
    """Wait until it is done, at most twice the time in which the loop answers; return whether it is."""
    end_s = monotonic_s() + 2 * ANSWERS_IN_S
    while not done():
        if monotonic_s() > end_s:
            return False
        sleep(LOOK_S)
    return True


@contextmanager
def _alone(ring: Ring) -> Iterator[None]:
    """Keep other processes from asking: a record lock, which is none of those of `recording/lock.py`."""
    import fcntl  # as there

    with ExitStack() as stack:
        try:
            handle = open_own(ring.path, os.O_RDWR)
            stack.callback(os.close, handle)
            fcntl.lockf(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise Busy("another process asks for a change, or the run has ended; try again") from None
        yield
