import http.client
import socket
import threading
import time

import pytest

from ecu.errors import UserError
from ecu.watch import serve
from ecu.watch.serve import CONNECTIONS, Handler, Server


class Echo(Handler):
    def do_GET(self):  # noqa: N802
        self.answer(200 if self.is_local() else 403, "text/plain", self.path.encode())


@pytest.fixture
def server(serve_here):
    return serve_here(Echo)


def get(server, address="127.0.0.1", **headers):
    connection = http.client.HTTPConnection(address, server.server_port, timeout=10)
    connection.request("GET", "/x", headers=headers)
    answer = connection.getresponse()
    return answer.status, answer.read().decode()


@pytest.mark.parametrize(
    ("host", "status"),
    [
        ("127.0.0.1:8760", 200),
        ("localhost:9000", 200),  # through a tunnel
        ("localhost", 200),
        ("[::1]:80", 200),
        ("evil.example:8760", 403),  # a name bent to 127.0.0.1
        ("127.0.0.1.evil.example", 403),
        ("", 403),
    ],
)
@pytest.mark.requirement("REQ-PROC-5")
def test_only_this_machine_s_own_names_are_answered(server, host, status):
    assert get(server, Host=host)[0] == status


@pytest.mark.parametrize(
    ("address", "host", "status"),
    [
        ("127.0.0.2", "127.0.0.2:9476", 200),
        ("127.0.0.2", "evil.example", 403),
        ("0.0.0.0", "vehicle.example:9476", 200),  # anybody may ask it, by any name
    ],
)
def test_who_listens_elsewhere_has_the_name_of_that_place(serve_here, address, host, status):
    assert get(serve_here(Echo, address), address, Host=host)[0] == status


def test_a_request_that_comes_line_by_line_holds_no_place(server, monkeypatch):
    """Each line is well within the time-out of a read; all 64 places are taken."""
    now = [0.0]
    monkeypatch.setattr(serve, "monotonic", lambda: now[0])
    slow = [socket.create_connection(("127.0.0.1", server.server_port), 5.0) for _ in range(CONNECTIONS)]
    while len(server._due) < CONNECTIONS:
        time.sleep(0.01)
    for line in (b"GET /x HTTP/1.1\r\n", b"A: 1\r\n", b"B: 2\r\n", b"C: 3\r\n"):
        for one in slow:
            one.send(line)
        now[0] += 3.0
    assert [one.recv(1) for one in slow] == [b""] * CONNECTIONS
    for _ in range(CONNECTIONS):
        assert server._places.acquire(timeout=60)
    for _ in range(CONNECTIONS):
        server._places.release()
    assert get(server) == (200, "/x")
    assert not server._due


def test_an_answer_takes_as_long_as_it_takes(server, monkeypatch):
    """A stream outlives the deadline of its request."""
    now, begins, goes_on, answer = [0.0], threading.Event(), threading.Event(), Echo.answer
    monkeypatch.setattr(serve, "monotonic", lambda: now[0])
    monkeypatch.setattr(Echo, "answer", lambda *parts: (begins.set(), goes_on.wait(60), answer(*parts)))
    client = socket.create_connection(("127.0.0.1", server.server_port), 60.0)
    client.send(b"GET /x HTTP/1.1\r\nHost: localhost\r\n\r\n")
    assert begins.wait(60)
    now[0] = 100.0
    server.service_actions()
    goes_on.set()
    assert client.recv(12) == b"HTTP/1.1 200"


def test_one_request_a_connection(server):
    connection = socket.create_connection(("127.0.0.1", server.server_port), 60.0)
    connection.send(2 * b"GET /x HTTP/1.1\r\nHost: localhost\r\n\r\n")
    said = b"".join(iter(lambda: connection.recv(4096), b""))
    assert (said.count(b"HTTP/1.1 200"), b"Connection: close" in said) == (1, True)


def test_clients_that_hang_hold_up_nobody(server, monkeypatch):
    monkeypatch.setattr(Echo, "timeout", 1.0)
    hanging = [socket.create_connection(("127.0.0.1", server.server_port)) for _ in range(20)]
    hanging[0].send(b"GET /half")
    assert get(server) == (200, "/x")
    assert [one.recv(1) for one in hanging] == [b""] * 20  # closed after the time-out


def test_no_more_connections_than_it_has_places(server):
    server._places = threading.BoundedSemaphore(2)
    hanging = [socket.create_connection(("127.0.0.1", server.server_port)) for _ in range(2)]
    with pytest.raises(OSError):  # connections are accepted in the order they come in
        get(server)
    for one in hanging:
        one.close()
    assert server._places.acquire(timeout=60)
    server._places.release()
    assert get(server)[0] == 200


def test_a_port_that_is_taken(server):
    with pytest.raises(UserError, match=rf"127.0.0.1:{server.server_port}: .*in use; choose another port"):
        Server("127.0.0.1", server.server_port, Echo)
