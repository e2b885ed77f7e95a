"""Ends of a connection: packets in, packets out, garbage, a second master, one that has hung up."""

import socket
import struct

import can
import pytest

from ecu.errors import UserError
from ecu.xcp.transport import MOST_AT_ONCE, MOST_WAITING, TAKE_OVER_S, Can, Tcp, Udp

CONNECT, STATUS = b"\xff\x00", b"\xfd"


def packet(data, counter=0):
    return struct.pack("<HH", len(data), counter) + data


def heard(end, timeout_s=1.0):
    return list(end.commands(timeout_s))


class Session:
    """What an end asks its slave."""

    def __init__(self):
        self.connected, self.left, self.now_s = False, 0, 100.0

    def leave(self):
        self.left += 1
        self.connected = False


@pytest.fixture
def session():
    return Session()


@pytest.fixture
def udp(session):
    end = Udp("127.0.0.1", 0, lambda: session.connected, lambda: session.now_s)
    yield end
    end.close()


@pytest.fixture
def tcp(session):
    end = Tcp("127.0.0.1", 0, lambda: session.connected, session.leave)
    yield end
    end.close()


@pytest.fixture
def masters():
    """Open a master's socket: of UDP, or connected to a port of TCP."""
    opened = []

    def open_one(port=None):
        kind = socket.SOCK_DGRAM if port is None else socket.SOCK_STREAM
        opened.append(socket.socket(socket.AF_INET, kind))
        opened[-1].settimeout(5.0)
        if port is None:
            opened[-1].bind(("127.0.0.1", 0))
        else:
            opened[-1].connect(("127.0.0.1", port))
        return opened[-1]

    yield open_one
    for one in opened:
        one.close()


def test_udp_hears_and_answers_with_a_counter(udp, masters):
    master = masters()
    master.sendto(packet(CONNECT), ("127.0.0.1", udp.port))
    assert heard(udp) == [CONNECT]
    assert udp.send(b"\xff\x01")
    assert udp.send(b"\xff\x02")
    assert [master.recv(100) for _ in range(2)] == [packet(b"\xff\x01"), packet(b"\xff\x02", 1)]


@pytest.mark.parametrize(
    ("datagram", "commands"),
    [
        (packet(CONNECT) + packet(STATUS), [CONNECT, STATUS]),
        (packet(CONNECT) + b"\x05\x00\x00\x00\xfd", [CONNECT]),  # longer than it is
        (packet(CONNECT) + b"\xff", [CONNECT]),
        (b"", []),
        (b"\x02\x00\x00\x00", []),
        (b"\x00\x00\x00\x00\xff", []),  # of no length
        (b"\xff\xff\xff\xff" * 100, []),
        (packet(STATUS), []),  # nobody has connected
    ],
)
def test_udp_takes_what_is_made_of_packets(udp, masters, datagram, commands):
    masters().sendto(datagram, ("127.0.0.1", udp.port))
    assert heard(udp) == commands


@pytest.mark.parametrize(
    ("connected", "silent_s", "asks", "is_heard"),
    [
        (True, 0.0, CONNECT, False),
        (True, TAKE_OVER_S + 0.1, CONNECT, True),
        (True, TAKE_OVER_S + 0.1, STATUS, False),
        (False, 0.0, CONNECT, True),
        (False, 0.0, STATUS, False),
    ],
)
def test_a_second_master_on_udp(udp, masters, session, connected, silent_s, asks, is_heard):
    first, second = masters(), masters()
    first.sendto(packet(CONNECT), ("127.0.0.1", udp.port))
    heard(udp)
    session.connected = connected
    session.now_s += silent_s
    second.sendto(packet(asks), ("127.0.0.1", udp.port))
    assert heard(udp) == ([asks] if is_heard else [])
    udp.send(b"\xff")
    assert (second if is_heard else first).recv(100) == packet(b"\xff")


def test_a_flood_on_udp_leaves_time_for_the_rest(udp, masters):
    master = masters()
    for _ in range(MOST_AT_ONCE + 6):
        master.sendto(packet(CONNECT), ("127.0.0.1", udp.port))
    assert len(heard(udp)) == MOST_AT_ONCE
    assert len(heard(udp)) == 6


def test_a_master_of_udp_that_has_died_does_not_end_it(udp, masters):
    master = masters()
    master.sendto(packet(CONNECT), ("127.0.0.1", udp.port))
    heard(udp)
    master.close()
    assert all(udp.send(b"\x00") for _ in range(3))
    assert heard(udp, 0.0) == []


def test_a_port_that_is_taken_is_one_line(udp, tcp):
    for kind, end in ((Udp, udp), (Tcp, tcp)):
        with pytest.raises(
            UserError, match=f"127.0.0.1:{end.port}: Address already in use; choose another address or port"
        ):
            kind("127.0.0.1", end.port, lambda: False, lambda: None)


def test_a_unit_that_forbids_the_network_is_one_line(monkeypatch):
    def refused(*_):
        raise OSError(97, "Address family not supported by protocol")

    monkeypatch.setattr(socket, "socket", refused)
    with pytest.raises(UserError, match="add AF_INET to RestrictAddressFamilies"):
        Tcp("127.0.0.1", 5555, lambda: False, lambda: None)


def test_tcp_joins_what_comes_in_pieces(tcp, masters):
    master = masters(tcp.port)
    text = packet(CONNECT) + packet(STATUS)
    assert heard(tcp) == []
    for piece, commands in ((text[:3], []), (text[3:8], [CONNECT]), (text[8:], [STATUS])):
        master.sendall(piece)
        assert heard(tcp) == commands
    assert tcp.send(b"\xff\x01")
    assert master.recv(100) == packet(b"\xff\x01")


def test_tcp_answers_many_that_come_at_once(tcp, masters):
    masters(tcp.port).sendall(packet(CONNECT) * (MOST_AT_ONCE + 5))
    assert [len(heard(tcp, 0.2)) for _ in range(3)] == [MOST_AT_ONCE, 5, 0]


@pytest.mark.parametrize("garbage", [b"\x00\x00\x00\x00", b"\xf9\x00\x00\x00", b"GET / HTTP/1.1\r\n\r\n"])
def test_tcp_hangs_up_on_what_is_no_xcp(tcp, masters, session, garbage):
    master = masters(tcp.port)
    heard(tcp)
    master.sendall(garbage)
    assert heard(tcp) == []
    assert master.recv(100) == b""
    assert session.left == 1


def test_a_second_master_on_tcp_waits_for_the_first(tcp, masters, session):
    first = masters(tcp.port)
    heard(tcp)
    session.connected = True
    second = masters(tcp.port)
    heard(tcp)
    assert second.recv(100) == b""
    first.close()
    heard(tcp)
    assert session.left == 1
    third = masters(tcp.port)
    third.sendall(packet(CONNECT))
    assert heard(tcp) == [CONNECT]
    tcp.send(b"\xff")
    assert third.recv(100) == packet(b"\xff")


def test_a_master_that_does_not_read_makes_no_more_room(tcp, masters):
    """What waits is bounded, and goes on without a gap once the master reads."""
    master = masters(tcp.port)
    heard(tcp)
    sent = 0
    while tcp.send(struct.pack("<L", sent) + bytes(1000)):
        sent += 1
    assert sent * 1008 > MOST_WAITING
    data = b""
    master.settimeout(0.2)
    while len(data) < sent * 1008:
        heard(tcp, 0.0)
        data += master.recv(1 << 16)
    numbers = [struct.unpack_from("<HHL", data, at) for at in range(0, len(data), 1008)]
    assert numbers == [(1004, number & 0xFFFF, number) for number in range(sent)]
    assert tcp.send(b"\xff")


@pytest.mark.parametrize(("request_id", "response_id"), [(0x7A0, 0x7A8), (0x18DA28F1, 0x18DAF128)])
def test_can_hears_its_own_identifier(request_id, response_id):
    name = f"xcp{request_id}"
    extended = request_id > 0x7FF
    with can.Bus(interface="virtual", channel=name) as bus:
        end = Can("virtual", name, request_id, response_id)
        for number, data in ((request_id, CONNECT), (request_id + 1, b"\x01"), (request_id, STATUS)):
            bus.send(can.Message(arbitration_id=number, is_extended_id=extended, data=data))
        bus.send(can.Message(arbitration_id=request_id & 0x7FF, is_extended_id=not extended, data=b"\x02"))
        bus.send(can.Message(arbitration_id=request_id, is_extended_id=extended, is_remote_frame=True))
        assert [one for _ in range(5) for one in heard(end, 0.1)] == [CONNECT, STATUS]
        assert end.send(b"\xff\x01")
        answer = bus.recv(1.0)
        assert (answer.arbitration_id, answer.is_extended_id, bytes(answer.data)) == (
            response_id,
            extended,
            b"\xff\x01",
        )
        end.close()
