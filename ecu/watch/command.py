"""`brake-ecu watch`: look into a running daemon from another process, in the terminal or as a page."""

import os
import signal
import sys
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

from ecu.errors import UserError
from ecu.runtime.start import lower_priority
from ecu.watch.watcher import Watcher

NICE = 10
"""Below everything else: a watcher has time."""


def watch(daemon: str | None, web: bool, port: int, as_json: bool, folder: Path) -> int:
    """Watch `daemon` (its process, channel, car or ring; None: the only one) until the user ends it.

    `web`: on a page at `port` of 127.0.0.1. `folder` takes the recordings that are kept.

    Raises:
        UserError: several daemons run and none is named, or the port is taken.
    """
    if web and as_json:
        raise UserError("--json", "", "gives lines, --web a page; leave one of them out")
    lower_priority()
    with suppress(OSError):
        os.nice(NICE)
    signal.signal(signal.SIGTERM, _end)
    watcher = Watcher(daemon)
    if web:
        from ecu.watch.web import serve

        return serve(watcher, port, folder)
    from ecu.watch.terminal import print_lines, show

    if as_json or not (sys.stdin.isatty() and sys.stdout.isatty()):
        return print_lines(watcher, as_json)
    return show(watcher, folder)


def _end(*_: object) -> NoReturn:
    raise KeyboardInterrupt
