"""The slave's loop beside a ring that the test writes: what is measured, what is lost, how a run ends."""

import itertools
import struct

import numpy as np
import pytest
import structlog

from ecu.contract.signals import OUTPUT
from ecu.errors import UserError
from ecu.runtime.xcp import Settings
from ecu.xcp import serve as serve_module
from ecu.xcp.serve import Server, serve

from .conftest import OUTPUTS

SETTINGS = Settings("udp:5555", "virtual", "x")
SPEED, OVERRUNS = OUTPUTS + 8 * OUTPUT["vehicle_speed"], OUTPUTS + 8 * OUTPUT["overruns"]


class Wire:
    """An end whose commands and room for packets the test gives."""

    def __init__(self):
        self.asked, self.sent, self.room, self.closed = [], [], 10_000, False

    def commands(self, timeout_s):
        asked, self.asked = self.asked, []
        for one in asked:
            if isinstance(one, Exception):
                raise one
            yield bytes.fromhex(one)

    def send(self, packet):
        if self.room <= 0:
            return False
        self.room -= 1
        self.sent.append(packet)
        return True

    def close(self):
        self.closed = True

    def take(self):
        sent, self.sent = self.sent, []
        return sent


@pytest.fixture
def run(loop, configuration):
    return loop(configuration=configuration)


@pytest.fixture
def wire(monkeypatch):
    """The end that a server opens."""
    one = Wire()
    for kind in ("Udp", "Tcp", "Can"):
        monkeypatch.setattr(serve_module, kind, lambda *_: one)
    return one


@pytest.fixture
def server(run, wire):
    return Server(run.ring.path, SETTINGS)


def ask(server, wire, *commands):
    wire.asked += commands
    server.turn()
    return wire.take()


def measure(server, wire, address=SPEED):
    """Set up and start a list with one entry and a time stamp."""
    where = struct.pack("<L", address).hex()
    answers = ask(
        server,
        wire,
        *("FF00", "D6", "D500 0100", "D400 0000 01", "D300 0000 00 01", "E200 0000 00 00"),
        *(f"E1FF 08 00 {where}", "E010 0000 0000 01 00", "DE01 0000"),
    )
    assert [one[0] for one in answers] == [0xFF] * 9


def values(packets):
    return [struct.unpack("<BLd", packet) for packet in packets]


def test_upload_reads_the_last_cycle(run, server, wire):
    run.publish(3, vehicle_speed=10.0)
    run.publish(1, vehicle_speed=12.5)
    _, read = ask(server, wire, "FF00", f"F4080000{struct.pack('<L', SPEED).hex()}")
    assert struct.unpack("<d", read[1:]) == (12.5,)


def test_every_cycle_from_the_start_on_is_sent_once_with_its_stamp(run, server, wire):
    run.publish(5, vehicle_speed=1.0)
    measure(server, wire)
    found = []
    for number in range(300):
        run.publish(1 + number % 3, vehicle_speed=float(number))
        found += values(ask(server, wire))
    stamps = np.array([stamp for _, stamp, _ in found], np.uint32)
    assert len(found) == 600
    assert set(np.diff(stamps)) == {10_000}
    assert [value for *_, value in found] == [n for n in range(300) for _ in range(1 + n % 3)]
    assert stamps[0] == (run.cycle["t_mono_ns"][0] // 1000 - 599 * 10_000) % 2**32


def test_without_room_cycles_wait_in_the_ring(run, server, wire):
    run.publish(1)
    measure(server, wire)
    wire.room = 0
    for number in range(1000):
        run.publish(2, vehicle_speed=float(number))
        assert ask(server, wire) == []
    assert server.reader.last_read < 10
    wire.room = 10_000
    found = []
    while packets := ask(server, wire):
        found += values(packets)
    assert [value for *_, value in found] == [float(n) for n in range(1000) for _ in range(2)]


def test_what_the_ring_has_lost_is_reported(run, server, wire):
    run.publish(1)
    measure(server, wire)
    wire.room = 0
    run.publish(10)
    ask(server, wire)
    run.publish(2500)  # the ring holds 2400
    wire.room = 100_000
    packets = ask(server, wire)
    packets += ask(server, wire)
    overload = packets.index(b"\xfd\x06\x00\x00")
    assert overload == 10
    first = struct.unpack("<BLd", packets[overload + 1])[1]
    assert first - struct.unpack("<BLd", packets[overload - 1])[1] == 101 * 10_000


def test_after_a_stop_nothing_comes(run, server, wire):
    run.publish(1)
    measure(server, wire)
    run.publish(5)
    assert ask(server, wire, "DD00") == [b"\xff"]
    run.publish(5)
    assert ask(server, wire) == []


def test_a_connection_that_is_lost_ends_the_session(run, server, wire):
    run.publish(1)
    measure(server, wire)
    wire.asked = [OSError("gone")]
    with structlog.testing.capture_logs() as lines:
        server.turn()
    assert [line["event"] for line in lines] == ["no_xcp"]
    assert not server.slave.connected
    assert wire.closed


@pytest.mark.parametrize(
    ("transport", "speaks", "answers"), [("can:1:2", 0, 0), ("can:1:2", 1, 1), ("udp:1", 0, 1)]
)
def test_a_standby_that_is_silent_does_not_answer_on_the_bus(run, wire, transport, speaks, answers):
    run.cycle["speaks"] = speaks
    run.publish(1)
    server = Server(run.ring.path, SETTINGS._replace(transport=transport))
    assert len(ask(server, wire, "FF00")) == answers


def test_the_file_of_addresses_is_uploaded(run, server, wire):
    run.publish(1)
    _, identification, text = ask(server, wire, "FF00", "FA04", "F50E")
    assert struct.unpack("<L", identification[4:])[0] > 10_000
    assert text[1:] == b"ASAP2_VERSION "


def test_at_the_end_of_a_run_the_last_cycles_and_the_event_are_sent(run, wire):
    run.publish(1)
    turns = itertools.count()

    def goes_on():
        turn = next(turns)
        if turn == 0:
            wire.asked += ["FF00", "D6", "D500 0100", "D400 0000 01", "D300 0000 00 01", "E200 0000 00 00"]
            wire.asked += [f"E1FF 08 00 {struct.pack('<L', SPEED).hex()}", "DE01 0000"]
        if turn == 1:
            run.publish(3)
            run.close(by="SIGTERM")
        return True

    serve(run.ring.path, SETTINGS, goes_on)
    assert len(wire.sent) == 8 + 3 + 1
    assert wire.sent[-1] == b"\xfd\x07"
    assert wire.closed


def test_a_process_whose_parent_has_gone_ends(run, wire):
    serve(run.ring.path, SETTINGS, lambda: False)
    assert wire.sent == []


def test_without_a_ring_there_is_an_error(tmp_path):
    with pytest.raises(UserError, match="no ring to read here"):
        serve(tmp_path / "none", SETTINGS, lambda: True)
