"""Fast restart of the daemon: raised priority while it loads, and fewer modules to load.

No slow import here.
"""

import gc
import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Final


def _signals(*names: str) -> set[int]:
    """Return those of the signals that this system has."""
    return {int(getattr(signal, name)) for name in names if hasattr(signal, name)}


IGNORED: Final = _signals("SIGTSTP", "SIGTTIN", "SIGTTOU")
"""Signals by which a terminal would stop the loop in the middle of a demand."""
HARMLESS: Final = _signals("SIGCHLD", "SIGCONT", "SIGURG", "SIGWINCH", "SIGPIPE", "SIGXFSZ")
"""Signals that end no process, the last two because Python ignores them."""
OUT_OF_REACH: Final = _signals("SIGKILL", "SIGSTOP", "SIGSEGV", "SIGBUS", "SIGFPE", "SIGILL", "SIGSYS")
"""Signals that cannot be caught, or that report an instruction that would be tried again for ever."""
ENDING: Final = tuple(
    sorted({int(one) for one in signal.valid_signals()} - IGNORED - HARMLESS - OUT_OF_REACH)
)
"""All other signals. They end a run in order."""
PRIORITY: Final = 1  # of SCHED_FIFO: above every ordinary process, below every real-time one


def leave_signals() -> None:
    """Ignore the signals by which a run ends: a group's are left to the loop by its side processes."""
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)


def signal_name(number: int) -> str:
    """Return a signal's name, for a real-time one its distance from the first."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"SIGRTMIN+{number - signal.SIGRTMIN}"


def is_run(arguments: list[str]) -> bool:
    """Return whether a command line, without the program's name, starts the daemon."""
    return next((word for word in arguments if not word.startswith("-")), "") == "run"


def raise_priority() -> None:
    """Raise priority above ordinary processes where granted, disable garbage collection, for children too."""
    _schedule("SCHED_FIFO", PRIORITY)
    gc.disable()


def lower_priority() -> None:
    """Return to ordinary priority."""
    _schedule("SCHED_OTHER", 0)
    gc.enable()


def _schedule(policy: str, priority: int) -> None:
    with suppress(OSError, AttributeError):
        os.sched_setscheduler(0, getattr(os, policy), os.sched_param(priority))


@contextmanager
def left_at_once() -> Iterator[None]:
    """Let any signal that has a handler end this process with exit code 0, even during a compilation.

    A handler would run only after the compilation, which takes a minute. Nothing was sent yet, and child
    processes end when they notice our exit.
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
