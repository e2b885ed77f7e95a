"""Fast restart of the daemon: raised priority while it loads, and fewer modules to load.

Nothing here imports what takes time.
"""

import gc
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Final

ENDING: Final = (
    signal.SIGTERM,
    signal.SIGINT,
    signal.SIGHUP,
    signal.SIGQUIT,
    signal.SIGABRT,
    signal.SIGUSR1,
    signal.SIGUSR2,
)
"""End a run in order; a group's are left to the loop by its side processes."""
PRIORITY: Final = 1  # of SCHED_FIFO: before every ordinary process, after whatever runs in real time


def raise_priority() -> None:
    """Run before ordinary processes do, where that is granted, and collect no garbage. So do children."""
    _schedule("SCHED_FIFO", PRIORITY)
    gc.disable()


def lower_priority() -> None:
    """Take turns with ordinary processes again."""
    _schedule("SCHED_OTHER", 0)
    gc.enable()


def _schedule(policy: str, priority: int) -> None:
    with suppress(OSError, AttributeError):
        os.sched_setscheduler(0, getattr(os, policy), os.sched_param(priority))


@contextmanager
def without_modules(*names: str) -> Iterator[None]:
    """Let libraries that load `names` where they find them, for what is not needed here, not find them.

    What is loaded already stays; afterwards anyone may import them.
    """
    absent = [name for name in names if name not in sys.modules]
    for name in absent:
        sys.modules[name] = None  # type: ignore[assignment]
    try:
        yield
    finally:
        for name in absent:
            del sys.modules[name]


@contextmanager
def left_at_once() -> Iterator[None]:
    """Let any signal that has a handler end this process with exit code 0, whatever compiles at the time.

    A handler would run when the compiler is done, which takes a minute. Nothing was sent yet, and whatever
    was started ends when it sees that we are gone.
    """
    reading, writing = os.pipe()
    os.set_blocking(writing, False)

    def watch() -> None:
        if os.read(reading, 1):
            os._exit(0)

    before = signal.set_wakeup_fd(writing)
    watcher = threading.Thread(target=watch)
    watcher.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        os.close(writing)
        watcher.join()
        os.close(reading)
