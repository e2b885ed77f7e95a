import http.client
import socket
import threading

import pytest

from ecu.errors import UserError
from ecu.watch.serve import Handler, Server


class Echo(Handler):
    def do_GET(self):  # noqa: N802
        self.answer(200 if self.is_local() else 403, "text/plain", self.path.encode())


@pytest.fixture
def server():
    one = Server("127.0.0.1", 0, Echo)
    threading.Thread(target=one.serve_forever, daemon=True).start()
    yield one
    one.shutdown()
    one.server_close()


def get(server, path="/x", **headers):
    connection = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=10)
    connection.request("GET", path, headers=headers)
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
def test_only_this_machine_s_own_names_are_answered(server, host, status):
    assert get(server, Host=host)[0] == status


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
