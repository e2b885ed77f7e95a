"""HTTP for machines of this one: a server that a client which hangs or lies cannot hold up.

A thread per connection, each with a time-out on every read and write, and no more than `CONNECTIONS` of them.
"""

import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
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
        try:
            super().__init__((address, port), handler)
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or error
            raise UserError(f"{address}:{port}", "", f"{reason}; choose another port") from None

    def process_request(self, request: Any, client_address: Any) -> None:
        """Start a thread for a connection, or close it when there are too many."""
        if self._places.acquire(blocking=False):
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Serve a connection."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._places.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing: a client that goes away is no event."""


class Handler(BaseHTTPRequestHandler):
    """Answers of one kind: a status, a type and bytes."""

    timeout = PATIENCE_S
    protocol_version = "HTTP/1.1"

    def answer(self, status: int, kind: str, body: bytes) -> None:
        """Send the whole answer."""
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "no-store")
        if self.command not in ("GET", "HEAD"):  # what it carries is not read, and is no next request
            self.send_header("Connection", "close")
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)

    def is_local(self) -> bool:
        """Return whether the client means this machine by its name: a page elsewhere whose name was bent to
        127.0.0.1 does not. Through a tunnel the port is another."""
        host = self.headers.get("Host", "")
        return host.rpartition(":")[0] in _LOCAL or host in _LOCAL

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing."""
