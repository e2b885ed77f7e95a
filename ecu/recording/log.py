"""Structured logging to stderr: readable on a terminal, JSON elsewhere; one line a second per cause.

`BRAKE_ECU_LOG_FORMAT` (console, json) and `BRAKE_ECU_LOG_LEVEL` (quiet, normal, verbose) say otherwise, as
`run --log-format`, `-q` and `-v` do.
"""

import logging
import os
import sys
import time
from collections.abc import Callable
from typing import Any, Final

import structlog

from ecu.output import LOG_FORMAT, LOG_LEVEL

QUIET_S: Final = 1.0
LEVELS: Final = {"quiet": logging.WARNING, "normal": logging.INFO, "verbose": logging.DEBUG}


def configure_logging() -> None:
    """Send every event of this process to stderr."""
    terminal = sys.stderr is not None and sys.stderr.isatty()
    form = os.environ.get(LOG_FORMAT) or ("console" if terminal else "json")
    renderer: Any = (
        structlog.dev.ConsoleRenderer(colors=terminal)
        if form == "console"
        else structlog.processors.JSONRenderer()
    )
    structlog.configure(
        processors=[
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            renderer,
        ],
        wrapper_class=structlog.make_filtering_bound_logger(
            LEVELS.get(os.environ.get(LOG_LEVEL, ""), logging.INFO)
        ),
        logger_factory=structlog.WriteLoggerFactory(file=sys.stderr),
    )


class Throttle:
    """Rate limit of one event a second per cause; the next one passed states how many were suppressed."""

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._last: dict[str, float] = {}
        self._held: dict[str, int] = {}

    def passes(self, cause: str) -> int | None:
        """Return how many events of this cause were suppressed since the last; None: suppress this one."""
        now = self._now_s()
        if now - self._last.get(cause, -QUIET_S) < QUIET_S:
            self._held[cause] = self._held.get(cause, 0) + 1
            return None
        self._last[cause] = now
        return self._held.pop(cause, 0)
