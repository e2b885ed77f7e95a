"""What lets a daemon that starts again speak soon: precedence while it loads, and less to load.

Nothing here imports what takes time.
"""

import gc
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Final

PRIORITY: Final = 1  # of SCHED_FIFO: before every ordinary process, after whatever runs in real time


def ahead_of_others() -> None:
    """Run before ordinary processes do, where that is granted, and collect no garbage. So do children."""
    _schedule("SCHED_FIFO", PRIORITY)
    gc.disable()


def like_others() -> None:
    """Take turns with ordinary processes again."""
    _schedule("SCHED_OTHER", 0)
    gc.enable()


def _schedule(policy: str, priority: int) -> None:
    with suppress(OSError, AttributeError):
        os.sched_setscheduler(0, getattr(os, policy), os.sched_param(priority))


@contextmanager
def kept_out(*names: str) -> Iterator[None]:
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
