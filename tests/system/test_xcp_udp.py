"""`run --xcp` beside a loop on a real bus: measured to the bit; masters that die, flood, ask for too much."""

import os
import random
import signal
import socket
import struct
import time

import numpy as np
import pytest

from brakelab.bench.xcp_master import VARIABLES, CanWire, Master, Refused, Wire
from brakelab.testing.daemon import wait_for
from ecu.bus.channel import open_bus
from ecu.contract.records import output_vector
from ecu.contract.signals import OUTPUT_COLUMNS
from ecu.recording.recorder import read_recording
from ecu.xcp.a2l import a2l_text
from ecu.xcp.memory import EPK

from .conftest import ROOT, free_port, process_of, unharmed

pytestmark = pytest.mark.multicast

GROUP = f"239.82.{os.getpid() >> 8 & 0xFF}.{os.getpid() & 0xFF}"
DOUBLES = [name for name, (_, one) in VARIABLES.items() if one.kind == "f8" and one.length == 1]
SIGNALS = [name for name in DOUBLES if not name.startswith("parameters")][:200]


@pytest.fixture
def port():
    return free_port()


@pytest.fixture
def unit(daemon, start_driving, tmp_path):
    """Start a daemon with XCP beside a car that drives in a thread."""

    def start(transport, *more):
        bus = ("--config", ROOT / "config" / "suv.toml", "--armed", "-i", "udp_multicast", "-c", GROUP)
        one = daemon(*bus, "--record", tmp_path / "record", "--xcp", transport, *more)
        one.wait_for("ready")
        start_driving()
        return one

    return start


def slave_of(unit):
    return process_of(unit, "ecu.xcp.process")


@pytest.mark.parametrize("kind", ["udp", "tcp"])
@pytest.mark.study
def test_two_hundred_signals_at_100_hz_none_is_lost_and_all_are_those_of_the_recording(
    unit, connect, port, tmp_path, kind
):
    one = unit(f"{kind}:{port}")
    asks = connect(kind, port)
    stamps, rows = asks.measure(SIGNALS, 200)
    assert len(SIGNALS) == 200
    assert asks.wire.lost == 0
    assert asks.events == []
    assert set(np.diff(np.array(stamps, np.uint32))) <= {10_000 * periods for periods in range(1, 100)}
    unharmed(one, tmp_path / "record")
    recorded = read_recording(tmp_path / "record")
    clock = (recorded.cycles["t_mono_ns"] // 1000 % 2**32).tolist()
    at = {stamp: row for row, stamp in enumerate(clock)}
    rows_of = [at[stamp] for stamp in stamps]
    assert rows_of == list(range(rows_of[0], rows_of[0] + len(stamps)))  # each cycle once
    values = output_vector(recorded.outputs.copy()).reshape(len(recorded.outputs), -1)[rows_of]
    measured = np.array([np.frombuffer(row, np.float64) for row in rows])
    columns = [SIGNALS.index(f"outputs.{name}") for name in OUTPUT_COLUMNS]
    assert measured[:, columns].tobytes() == values.tobytes()
    assert measured[-1, SIGNALS.index("inputs.vehicle_speed")] == pytest.approx(20.0, abs=0.01)


def test_a_master_reads_what_has_an_address_and_nothing_else(unit, connect, port):
    unit(f"udp:{port}")
    asks = connect("udp", port)
    assert asks.value("parameters.vehicle.mass") == 2105.0
    wait_for(lambda: asks.value("estimate.speed") == pytest.approx(20.0, abs=0.5))
    assert asks.value("outputs.pressure_demand_fl") >= 0.0
    assert asks.value("parameters.transmit") == 1
    for command in (("BBBBL", 0xF4, 8, 0, 0, 0), ("BBBBL", 0xF4, 255, 0, 0, 0xFFFFFF00)):
        with pytest.raises(Refused):
            asks.ask(*command)
    for address in (0x0, 0x7FFF_FFFF, 0xFFFF_FFF8, 0x10000 - 8, 0x50000):
        with pytest.raises(Refused, match="36"):  # ERR_ACCESS_DENIED
            asks.upload(address, 8)
    asks.ask("BHBL", 0xF6, 0, 0, VARIABLES["parameters.vehicle.mass"][0])
    with pytest.raises(Refused, match="35"):  # ERR_WRITE_PROTECTED
        asks.ask("BBd", 0xF0, 8, 3000.0)
    assert asks.value("parameters.vehicle.mass") == 2105.0


def test_the_slave_hands_out_its_own_file_of_addresses(unit, connect, port):
    unit(f"tcp:{port}")
    asks = connect("tcp", port)
    length = struct.unpack("<BHL", asks.ask("BB", 0xFA, 4))[2]
    text = b""
    while len(text) < length:
        text += asks.ask("BB", 0xF5, min(247, length - len(text)))
    found = text.decode()
    assert EPK in found
    assert f'{port} ADDRESS "127.0.0.1"' in found
    assert {line for line in a2l_text([], None).splitlines() if "MEASUREMENT" in line} <= set(
        found.splitlines()
    )


@pytest.mark.study
def test_on_the_bus_of_the_run(unit, daemon, tmp_path):
    one = unit("can:0x7A0:0x7A8", "--diagnostics", "0x7E0:0x7E8")
    asks = Master(CanWire(open_bus("udp_multicast", GROUP), 0x7A0, 0x7A8)).connect()
    address, _ = VARIABLES["outputs.vehicle_speed"]
    wait_for(
        lambda: (
            struct.unpack("<d", b"".join(asks.upload(address + at, 4) for at in (0, 4)))[0]
            == pytest.approx(20.0, abs=1.0)
        )
    )
    with pytest.raises(Refused):
        asks.upload(address, 8)
    asks.begin([[(address, 3)], [(address + 3, 5)]])
    while len(asks.packets) < 200:
        asks.take()
    halves = [asks.packets[at : at + 2] for at in range(0, 200, 2)]
    assert all((first[0], second[0]) == (0, 1) for first, second in halves)
    speeds = [struct.unpack("<d", first[5:] + second[1:])[0] for first, second in halves]
    assert speeds == pytest.approx([20.0] * len(speeds), abs=1.0)
    stamps = np.array([struct.unpack_from("<L", first, 1)[0] for first, _ in halves], np.uint32)
    assert np.all(np.diff(stamps) % 10_000 == 0)
    asks.close()
    unharmed(one, tmp_path / "record")


@pytest.mark.study
def test_a_master_that_dies_while_it_measures(unit, connect, port, tmp_path):
    """On UDP nothing says so: the next one is heard once the dead one has been silent."""
    one = unit(f"udp:{port}")
    first = connect("udp", port)
    first.begin([[(VARIABLES["outputs.mode"][0], 8)]])
    first.take()
    first.close()
    second = connect("udp", port)
    assert second.ask("B", 0xFD)[0] & 0x40 == 0  # no list runs
    assert second.value("outputs.mode") >= 0
    unharmed(one, tmp_path / "record")


@pytest.mark.study
def test_a_second_master_on_tcp_is_refused_until_the_first_has_gone(unit, connect, port, tmp_path):
    one = unit(f"tcp:{port}")
    first = connect("tcp", port)
    second = Wire("tcp", port)
    with pytest.raises(ConnectionError):
        Master(second).ask("BB", 0xFF, 0)
    assert first.value("outputs.mode") >= 0
    first.close()
    assert connect("tcp", port).value("outputs.mode") >= 0
    unharmed(one, tmp_path / "record")


@pytest.mark.parametrize("kind", ["udp", "tcp"])
@pytest.mark.study
def test_floods_and_garbage(unit, connect, port, tmp_path, kind):
    one = unit(f"{kind}:{port}")
    asks = connect(kind, port)
    before = slave_of(one)
    draw = random.Random(9)
    if kind == "udp":
        for number in range(3000):
            text = draw.randbytes(draw.randint(0, 60))
            if number % 2:  # a whole packet with a command
                text = struct.pack("<HH", len(text), number) + bytes([draw.randint(0xC0, 0xFF)]) + text[1:]
            asks.wire.socket.send(text)
    else:
        for _ in range(200):
            with socket.create_connection(("127.0.0.1", port), 5) as junk:
                junk.sendall(draw.randbytes(100))
        for _ in range(3000):
            asks.wire.send(bytes([draw.randint(0xC0, 0xFD)]) + draw.randbytes(7))
    time.sleep(0.5)
    asks.close()
    again = connect(kind, port)
    assert again.value("parameters.vehicle.mass") == 2105.0
    assert slave_of(one) == before
    unharmed(one, tmp_path / "record")


@pytest.mark.requirement("REQ-PROC-4")
def test_loop_and_recorder_do_not_care_for_the_slave(unit, connect, port, tmp_path):
    one = unit(f"tcp:{port}")
    asks = connect("tcp", port)
    first = slave_of(one)
    for number in (signal.SIGTERM, signal.SIGINT):  # a group's are left to the loop
        os.kill(first, number)
    assert asks.value("outputs.mode") >= 0
    os.kill(first, signal.SIGKILL)
    assert connect("tcp", port).value("outputs.mode") >= 0
    assert slave_of(one) not in (None, first)
    unharmed(one, tmp_path / "record")


@pytest.mark.study
def test_the_end_of_a_run_is_reported(unit, connect, port):
    one = unit(f"udp:{port}")
    asks = connect("udp", port)
    assert one.end() == 0
    while not asks.events:
        asks.take()
    assert asks.events == [b"\xfd\x07"]


@pytest.mark.requirement("REQ-PROC-5")
def test_it_does_not_listen_unless_asked(daemon, car):
    one = daemon("--config", ROOT / "config" / "suv.toml", "-i", "udp_multicast", "-c", GROUP)
    one.wait_for("ready")
    car.drive(5)
    assert slave_of(one) is None
    assert one.end() == 0
