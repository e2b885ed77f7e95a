"""Real-time rights of a process that stands in for a vehicle on a bus."""

import os
from typing import Final

from ecu.runtime.realtime import freeze_memory

PRIORITY: Final = 10
"""SCHED_FIFO, below the daemon's: a vehicle does not wait for others, and the ECU does not wait for it."""


def ask_for_priority() -> str:
    """Request real-time priority; return the reason of a refusal, "" if granted.

    Live objects are frozen (`ecu.runtime.realtime`): call it after the preparations.
    """
    freeze_memory()
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except (OSError, AttributeError) as error:
        return str(error)
    return ""
