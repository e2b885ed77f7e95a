"""`brake-ecu watch`: look into a running daemon from another process, in the terminal or as a page."""

import os
import signal
import sys
from contextlib import suppress
from pathlib import Path
from typing import Final, NoReturn

from ecu.errors import UserError
from ecu.runtime.start import lower_priority
from ecu.watch.watcher import Watcher

PORT: Final = 8760
NICE: Final = 10
"""Below everything else: a watcher has time."""


def watch(
    daemon: str | None, web: bool, foxglove: bool, port: int | None, as_json: bool, folder: Path
) -> int:
    """Watch `daemon` (its process, channel, car or ring; None: the only one) until the user ends it.

    `web`: on a page at `port` of 127.0.0.1; `foxglove`: for that program there; None: the port that each
    usually has. `folder` takes the recordings that are kept.

    Raises:
        UserError: several daemons run and none is named, or the port is taken.
    """
    if web + foxglove + as_json > 1:
        remedy = "--json gives lines, --web a page, --foxglove serves Foxglove; give one of them"
        raise UserError("watch", "", remedy)
    if port is not None and not (web or foxglove):
        raise UserError("--port", str(port), "is for --web or --foxglove; give one of them")
    lower_priority()
    with suppress(OSError):
        os.nice(NICE)
    signal.signal(signal.SIGTERM, _end)
    watcher = Watcher(daemon)
    if web:
        from ecu.watch.web import serve

        return serve(watcher, PORT if port is None else port, folder)
    if foxglove:
        from ecu.watch import foxglove_server

        return foxglove_server.serve(watcher, foxglove_server.PORT if port is None else port)
    from ecu.watch.terminal import print_lines, show

    if as_json or not (sys.stdin.isatty() and sys.stdout.isatty()):
        return print_lines(watcher, as_json)
    return show(watcher, folder)


def _end(*_: object) -> NoReturn:
    raise KeyboardInterrupt
