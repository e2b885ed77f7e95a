"""A watched daemon in Foxglove, live (`watch --foxglove`), by foxglove-sdk.

Topics and names are those of `replay --out RESULT.mcap`, so that a layout serves both: `/ecu`, and
`/corner/fl` … `/corner/rr` with names without the corner. `/events` are lines of the daemon's log
(foxglove.Log). What is not available is left out; log time is Unix time.
"""

import math
import sys
from collections.abc import Callable, Mapping
from typing import Any, Final

from ecu.contract.signals import CORNERS, OUTPUT_SIGNALS, topic_of
from ecu.errors import UserError
from ecu.settings.resources import resource
from ecu.watch.history import COLUMN, COLUMNS, Event, Row
from ecu.watch.line import faults_of
from ecu.watch.watcher import Watcher, follow

PORT: Final = 8765
"""At which Foxglove looks."""
EVENTS: Final = "/events"
LAYOUT: Final = "tools/deploy/foxglove-brake-ecu.json"
INFO, WARNING = 2, 3  # of foxglove.Log
UNITS: Final = {
    **{signal.name: signal.unit for signal in OUTPUT_SIGNALS},
    "t": "s",
    "clock": "s since 1970",
    "lateness": "us",
}
PLACES: Final = [topic_of(column.replace("mode_mu_b_", "mode_")) for column in COLUMNS]
"""Topic and name of each column, as in results."""
Log = Callable[[dict[str, Any], int], None]
"""Takes a message and its time [ns]."""


def schemas() -> dict[str, dict[str, Any]]:
    """Return the JSON schema of each topic."""
    found: dict[str, dict[str, Any]] = {
        "/ecu": {"faults": {"type": "array", "items": {"type": "string"}}},
        **{f"/corner/{corner}": {} for corner in CORNERS},
    }
    for topic, name in PLACES:
        found[topic][name] = {"type": "number", "description": UNITS.get(name, "")}
    titles = {topic: "brake_ecu.ecu" if topic == "/ecu" else "brake_ecu.corner" for topic in found}
    line = {"level": "integer", "message": "string", "name": "string"}
    found[EVENTS] = {name: {"type": kind} for name, kind in line.items()}
    found[EVENTS]["timestamp"] = {
        "type": "object",
        "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
    }
    titles[EVENTS] = "foxglove.Log"
    return {
        topic: {"type": "object", "title": titles[topic], "properties": properties}
        for topic, properties in found.items()
    }


def messages(row: Row) -> dict[str, dict[str, Any]]:
    """Return the message of each topic on a row."""
    found: dict[str, dict[str, Any]] = {"/ecu": {"faults": faults_of(row)}}
    for (topic, name), value in zip(PLACES, row.tolist(), strict=True):
        if math.isfinite(value):
            found.setdefault(topic, {})[name] = value
    return found


class Publisher:
    """Hands what is new in a watcher's history to a log for each topic."""

    def __init__(self, watcher: Watcher, logs: Mapping[str, Log]) -> None:
        self._watcher, self._logs = watcher, logs
        self._rows = 0
        self._last: Event | None = None

    def turn(self) -> None:
        """Read new cycles and publish them. Raises UserError: see `Watcher.turn`."""
        self._watcher.turn()
        history = self._watcher.history
        count = min(history.added - self._rows, len(history.rows))
        self._rows = history.added
        for place in range(len(history.rows) - count, len(history.rows)):
            row = history.rows[place]
            stamp_ns = round(1e9 * row[COLUMN["clock"]])
            for topic, message in messages(row).items():
                self._logs[topic](message, stamp_ns)
        for event in self._new_events():
            seconds, rest = divmod(round(1e9 * event.clock), 10**9)
            message = {
                "timestamp": {"sec": seconds, "nsec": rest},
                "level": WARNING if event.serious else INFO,
                "message": event.text,
                "name": "brake-ecu",
            }
            self._logs[EVENTS](message, 10**9 * seconds + rest)

    def _new_events(self) -> list[Event]:
        events = list(self._watcher.history.events)
        known = [place for place, event in enumerate(events) if event is self._last]
        self._last = events[-1] if events else None
        return events[known[0] + 1 :] if known else events


def serve(watcher: Watcher, port: int) -> int:
    """Serve Foxglove on 127.0.0.1 until Ctrl-C; return the exit code 0.

    Raises:
        UserError: foxglove-sdk is missing, the port is taken, or several daemons run and none is named.
    """
    try:
        import foxglove
    except ImportError:
        remedy = f"needs foxglove-sdk: {sys.executable} -m pip install foxglove-sdk"
        raise UserError("--foxglove", "", remedy) from None
    watcher.turn()
    logs: dict[str, Log] = {}
    for topic, schema in schemas().items():
        channel = foxglove.Channel(topic, schema=schema)
        logs[topic] = lambda message, stamp_ns, channel=channel: channel.log(message, log_time=stamp_ns)  # type: ignore[misc]
    try:
        server = foxglove.start_server(name="brake-ecu", host="127.0.0.1", port=port)
    except RuntimeError as error:
        raise UserError(
            "--port", str(port), f"cannot be served: {error}; give another one, 0 for any"
        ) from None
    print(
        f"ws://127.0.0.1:{server.port} in Foxglove (Ctrl-C ends it), layout {resource(LAYOUT)}; "
        f"{watcher.trouble or 'attached'}",
        flush=True,
    )
    try:
        return follow(watcher, Publisher(watcher, logs).turn)
    finally:
        server.stop()
