"""HTTP for machines of this one: a server that a client which hangs or lies cannot hold up.

A thread and one request per connection, no more than `CONNECTIONS` of them, each with a deadline for its
whole request and a time-out on every write.
"""

import socket
import threading
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from ipaddress import ip_address
from time import monotonic
from typing import Any, Final

from ecu.errors import UserError

PATIENCE_S: Final = 10.0
CONNECTIONS: Final = 64
_LOCAL: Final = ("127.0.0.1", "localhost", "[::1]")


class Server(ThreadingHTTPServer):
    """Server of `handler` at `port` of `address` (0: any free port).

    Raises:
        UserError: the port is taken.
    """

    daemon_threads = True
    request_queue_size = CONNECTIONS

    def __init__(self, address: str, port: int, handler: type[BaseHTTPRequestHandler]) -> None:
        self._places = threading.BoundedSemaphore(CONNECTIONS)
        self._due: dict[socket.socket, float] = {}
        try:
            super().__init__((address, port), handler)
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or error
            raise UserError(f"{address}:{port}", "", f"{reason}; choose another port") from None

    def process_request(self, request: Any, client_address: Any) -> None:
        """Start a thread for a connection, or close it when there are too many."""
        if self._places.acquire(blocking=False):
            self._due[request] = monotonic() + PATIENCE_S
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Serve a connection."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self.has_asked(request)
            self._places.release()

    def has_asked(self, request: Any) -> None:
        """Take note that the request of a connection is complete, or that it has none any more."""
        self._due.pop(request, None)

    def service_actions(self) -> None:
        """Hang up on clients whose requests are overdue; called twice a second."""
        for request, due in list(self._due.items()):
            if monotonic() > due:
                with suppress(OSError):
                    request.shutdown(socket.SHUT_RDWR)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing: a client that goes away is no event."""


class Handler(BaseHTTPRequestHandler):
    """Answers of one kind: a status, a type and bytes."""

    server: Server
    timeout = PATIENCE_S
    protocol_version = "HTTP/1.1"

    def parse_request(self) -> bool:
        """Read the header; return whether there is one to answer."""
        whole = super().parse_request()
        self.server.has_asked(self.connection)
        return whole

    def answer(self, status: int, kind: str, body: bytes) -> None:
        """Send the whole answer."""
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "no-store")
        self.send_header("Connection", "close")  # what else the client sends is not read
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)

    def is_local(self) -> bool:
        """Return whether the client means this machine by its name: a page elsewhere whose name was bent to
        127.0.0.1 does not. Through a tunnel the port is another; in a network this machine has any name."""
        own, host = str(self.server.server_address[0]), self.headers.get("Host", "")
        names = (*_LOCAL, own)
        return host.rpartition(":")[0] in names or host in names or not ip_address(own).is_loopback

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing."""
