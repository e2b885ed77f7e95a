"""The loop of the diagnostic server: requests from the bus, cycles from the ring."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

import can

from ecu.bus.addresses import parse_addresses
from ecu.diagnostics.server import Server
from ecu.diagnostics.transport import Link
from ecu.runtime.diagnostics import OPTION, Settings, read_secret
from ecu.runtime.place import Place

PERIOD_S: Final = 0.1
BUSY_S: Final = 0.002
"""Longest wait for a frame while a message is in progress: a flow control, a pause between its frames."""


def _place(settings: Settings) -> Place[Link]:
    request, response, functional = parse_addresses(OPTION, settings.addresses)
    return Place(
        "diagnostics",
        lambda: Link(settings.interface, settings.channel, response, request, functional),
    )


def serve(ring: Path, state: Path | None, settings: Settings, goes_on: Callable[[], bool]) -> None:
    """Answer until the run has ended or `goes_on` says no, then store the fault memory.

    Raises:
        UserError: there is no ring, or the key file has become none.
    """
    secret = read_secret(Path(settings.key)) if settings.key else b""
    place = _place(settings)
    server = Server(ring, state, secret, sleep=lambda seconds: _listen(place, seconds))
    due_s = 0.0
    while goes_on() and not server.reader.closed:
        _turn(server, place)
        if time.monotonic() >= due_s:
            server.follow()
            due_s = time.monotonic() + PERIOD_S
    server.finish()
    place.close()


def _listen(place: Place[Link], seconds: float) -> None:
    """Wait and take in what comes: a socket that nobody reads would lose the next request."""
    link = place.end()
    if link is None:
        time.sleep(seconds)
    else:
        link.turn(seconds)


def _turn(server: Server, place: Place[Link]) -> None:
    """Wait for frames and answer what they ask."""
    link = place.end()
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
