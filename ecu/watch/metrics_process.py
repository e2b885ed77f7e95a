"""Metrics server of `run --metrics-port`: a process of its own, started and ended by the supervisor.

`python -m ecu.watch.metrics_process --ring RING --metrics ADDRESS:PORT --parent PID [--pause S]`. It follows
the ring as any reader does. A thread per client answers `/metrics` and `/health`; a port that is taken is
tried again.
"""

import os

from ecu.runtime.start import lower_priority

if __name__ == "__main__":  # the daemon is starting: it goes first
    lower_priority()
    os.nice(10)

import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import structlog

from ecu.errors import UserError
from ecu.recording.log import configure_logging
from ecu.runtime.companion import begin_companion
from ecu.watch.metrics import families
from ecu.watch.serve import Handler, Server
from ecu.watch.tally import Tally

PERIOD_S: Final = 0.25
AGAIN_S: Final = 5.0
NO_RING: Final = "the loop has not begun"


class Shared:
    """The tally, and the lock that the following thread and the answering ones take in turns."""

    def __init__(self, ring: Path) -> None:
        self.lock = threading.Lock()
        self.tally: Tally | None = None
        self._ring = ring

    def turn(self) -> None:
        """Count the new cycles."""
        with self.lock:
            if self.tally is None:
                if not self._ring.exists():
                    return
                self.tally = Tally(self._ring)
            self.tally.follow()

    def collect(self) -> Any:
        """Return the metrics, as a collector of prometheus-client does."""
        with self.lock:
            return list(families(self.tally)) if self.tally else []

    def describe(self) -> Any:
        """Return no metric before there is one."""
        return []

    def ailment(self) -> str:
        """Return why the loop is not healthy, empty while it is."""
        with self.lock:
            if self.tally is None:
                return NO_RING
            self.tally.follow()
            return self.tally.ailment()


def new_handler(shared: Shared) -> type[Handler]:
    """Return the handler of requests to `shared`."""
    from prometheus_client import CollectorRegistry
    from prometheus_client.exposition import choose_encoder

    registry = CollectorRegistry(auto_describe=False)
    registry.register(shared)

    class Scraped(Handler):
        """One connection."""

        def do_GET(self) -> None:  # noqa: N802
            """Answer `/metrics` (OpenMetrics, or what the client takes) and `/health`."""
            if not self.is_local():
                self.answer(403, "text/plain", b"ask for 127.0.0.1 or localhost\n")
                return
            match self.path.partition("?")[0]:
                case "/metrics":
                    encode, kind = choose_encoder(
                        self.headers.get("Accept") or "application/openmetrics-text"
                    )
                    self.answer(200, kind, encode(registry))
                case "/health":
                    ailment = shared.ailment()
                    self.answer(503 if ailment else 200, "text/plain", f"{ailment or 'ok'}\n".encode())
                case _:
                    self.answer(404, "text/plain", b"/metrics or /health\n")

    return Scraped


def open_server(place: str, handler: type[Handler], goes_on: Callable[[], bool]) -> Server | None:
    """Return the server at `place`, as soon as that is free; None: it need not be any more."""
    address, _, port = place.rpartition(":")
    reported = False
    while goes_on():
        try:
            return Server(address, int(port), handler)
        except UserError as error:
            if not reported:
                structlog.get_logger("metrics").error(
                    "no_metrics", reason=str(error), remedy="it is tried again every 5 s"
                )
            reported = True
            time.sleep(AGAIN_S)
    return None


def main() -> int:
    """Serve until the parent has gone."""
    options, goes_on = begin_companion("ecu.watch.metrics_process", "--metrics")
    configure_logging()
    shared = Shared(options.ring)
    server = open_server(options.metrics, new_handler(shared), goes_on)
    if server is None:
        return 0
    threading.Thread(target=server.serve_forever, daemon=True).start()
    while goes_on():
        shared.turn()
        time.sleep(PERIOD_S)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
