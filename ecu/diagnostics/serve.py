"""The loop of the diagnostic server: requests from the bus, cycles from the ring."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

import can
import structlog

from ecu.bus.addresses import Addresses, parse_addresses
from ecu.diagnostics.server import Server
from ecu.diagnostics.transport import Link
from ecu.errors import UserError
from ecu.runtime.diagnostics import OPTION, Settings, read_secret

PERIOD_S: Final = 0.1
BUSY_S: Final = 0.002
"""Longest wait for a frame while a message is under way: a flow control, a pause between its frames."""
AGAIN_S: Final = 5.0


class Place:
    """The server's end on the bus, opened again when it has gone."""

    def __init__(self, settings: Settings, now_s: Callable[[], float] = time.monotonic) -> None:
        self._settings, self._now_s = settings, now_s
        self._addresses: Addresses = parse_addresses(OPTION, settings.addresses)
        self._link: Link | None = None
        self._again_s = 0.0
        self._told = False

    def link(self) -> Link | None:
        """Return the open end, None: the bus is not there; it is tried every 5 s."""
        if self._link is None and self._now_s() >= self._again_s:
            request, response, functional = self._addresses
            try:
                self._link = Link(
                    self._settings.interface, self._settings.channel, response, request, functional
                )
                self._told = False
            except UserError as error:
                self.lose(error)
        return self._link

    def lose(self, error: Exception) -> None:
        """Close an end that failed; say why, once until it is back."""
        if not self._told:
            structlog.get_logger("diagnostics").error(
                "no_diagnostics", reason=str(error), remedy="it is tried again every 5 s"
            )
        self._told, self._again_s = True, self._now_s() + AGAIN_S
        self.close()

    def close(self) -> None:
        """Close the end, if it is open."""
        if self._link is not None:
            self._link.close()
            self._link = None


def serve(ring: Path, state: Path | None, settings: Settings, goes_on: Callable[[], bool]) -> None:
    """Answer until the run has ended or `goes_on` says no, then store the fault memory.

    Raises:
        UserError: there is no ring, or the key file has become none.
    """
    secret = read_secret(Path(settings.key)) if settings.key else b""
    server, place = Server(ring, state, secret), Place(settings)
    due_s = 0.0
    while goes_on() and not server.reader.closed:
        _turn(server, place)
        if time.monotonic() >= due_s:
            server.follow()
            due_s = time.monotonic() + PERIOD_S
    server.finish()
    place.close()


def _turn(server: Server, place: Place) -> None:
    """Wait for frames and answer what they ask."""
    link = place.link()
    if link is None:
        time.sleep(PERIOD_S)
        return
    try:
        link.turn(BUSY_S if link.is_busy else PERIOD_S)
        while (request := link.next()) is not None:
            for response in server.answer(request):
                link.send(response)
        if not link.is_busy:
            server.restart_if_asked()
    except (can.CanError, OSError) as error:
        place.lose(error)
