"""The page of `watch --web`: on 127.0.0.1 alone, everything in one file, pushed 25 times a second.

The browser opens a stream of events (EventSource), which it opens again by itself. Every viewer has a place
of his own in the rows: a slow one gets more of them at once, later, and holds nobody up.
"""

import json
import math
import threading
from collections.abc import Iterable
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

import numpy as np

from ecu.contract.faults import FAULTS, WORD
from ecu.contract.signals import CORNERS
from ecu.recording.events import MODES
from ecu.watch.history import COLUMNS, LATENESS_US, REMEMBERED_S, SHOWN_S, Row, frames_text
from ecu.watch.keep import keep_now
from ecu.watch.serve import Handler, Server
from ecu.watch.watcher import Watcher, follow

QUIET_S: Final = 1.0
"""Interval at which a viewer gets the state when there are no rows."""


class Shared:
    """The watcher, and the lock that its thread and the viewers' threads take in turns."""

    def __init__(self, watcher: Watcher, folder: Path) -> None:
        self.watcher, self.folder = watcher, folder
        self.changed = threading.Condition()
        self._keeping = threading.Lock()

    def turn(self) -> None:
        """Read new cycles; wake the viewers. Raises UserError: see `Watcher.turn`."""
        with self.changed:
            if self.watcher.turn():
                self.changed.notify_all()

    def news(self, seen: int) -> tuple[int, dict[str, Any]]:
        """Return the rows after the first `seen`, and their number by now; waits for some."""
        with self.changed:
            history = self.watcher.history
            self.changed.wait_for(lambda: history.added != seen, QUIET_S)
            count = min(history.added - seen, len(history.rows))
            rows = [history.rows[place] for place in range(len(history.rows) - count, len(history.rows))]
            daemon = self.watcher.daemon
            status = {
                "daemon": daemon.label if daemon else "",
                "trouble": self.watcher.trouble,
                "cycles": history.cycles,
                "missed": history.missed,
                "frames": frames_text(history.frames),
                "lateness": history.lateness.tolist(),
                "inputs": [[_short(v) if isinstance(v, float) else v for v in row] for row in history.inputs],
                "kept": round(history.kept_s),
                "events": [[e.clock, e.text, e.serious] for e in list(history.events)[-40:]],
            }
            added = history.added
        return added, {**status, "rows": [_numbers(row) for row in rows]}

    def keep(self) -> str:
        """Keep the last minutes; return the line for the user."""
        with self._keeping:
            return keep_now(self.watcher, self.folder, self.changed)


def _numbers(row: Row) -> Iterable[float | None]:
    """Return a row for JSON: times to the millisecond, whole numbers as they are, the rest to five digits."""
    return [*np.round(row[:2], 3).tolist(), *map(_short, row[2:].tolist())]


def _short(value: float) -> float | None:
    if not math.isfinite(value):
        return None
    return value if value.is_integer() else float(f"{value:.5g}")


@cache
def page() -> bytes:
    """Return the page with the names it needs."""
    about = {
        "columns": COLUMNS,
        "corners": CORNERS,
        "modes": MODES,
        "faults": [[*divmod(fault.bit.bit_length() - 1, WORD), fault.name] for fault in FAULTS],
        "edges": LATENESS_US,
        "shown": SHOWN_S,
        "remembered": REMEMBERED_S,
    }
    text = files("ecu.watch").joinpath("page.html").read_text("utf-8")
    return text.replace("/*ABOUT*/", json.dumps(about).replace("</", "<\\/")).encode()


def new_handler(shared: Shared) -> type[Handler]:
    """Return the handler of requests to `shared`."""

    class Viewer(Handler):
        """One connection."""

        def do_GET(self) -> None:  # noqa: N802
            """Send the page, or the stream."""
            if not self.is_local():
                self.answer(403, "text/plain", b"open this page as 127.0.0.1 or localhost\n")
            elif self.path.partition("?")[0] == "/":
                self.answer(200, "text/html; charset=utf-8", page())
            elif self.path == "/stream":
                self._stream()
            else:
                self.answer(404, "text/plain", b"nothing here\n")

        def do_POST(self) -> None:  # noqa: N802
            """Keep the last minutes, for our own page: another's cannot set this header."""
            if self.is_local() and self.path == "/keep" and self.headers.get("X-Brake-Ecu") == "keep":
                self.answer(200, "text/plain; charset=utf-8", shared.keep().encode())
            else:
                self.answer(403, "text/plain", b"only the page itself may\n")

        def _stream(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "text/event-stream")
            self.send_header("Cache-Control", "no-store")
            self.send_header("Connection", "close")
            self.end_headers()
            self.close_connection = True
            seen = 0
            while True:
                seen, status = shared.news(seen)
                self.wfile.write(f"data: {json.dumps(status)}\n\n".encode())

    return Viewer


def serve(watcher: Watcher, port: int, folder: Path) -> int:
    """Serve the page until Ctrl-C; return the exit code 0.

    Raises:
        UserError: the port is taken, or several daemons run and none is named.
    """
    shared = Shared(watcher, folder)
    shared.turn()
    server = Server("127.0.0.1", port, new_handler(shared))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    print(
        f"http://127.0.0.1:{server.server_port}/ (Ctrl-C ends it); {watcher.trouble or 'attached'}",
        flush=True,
    )
    try:
        return follow(watcher, shared.turn)
    finally:
        server.server_close()
