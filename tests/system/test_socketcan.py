"""A real SocketCAN bus: the drain and the daemon on vcan0, controller states on a wire of two controllers."""

import os
import re
import signal
import subprocess
import time
from pathlib import Path

import can
import numpy as np
import pytest

from brakelab.rig.wire import ACTIVE, BUS_OFF, PASSIVE, STATE_NAMES, WARNING, Wire
from brakelab.testing.daemon import patience, wait_for
from ecu.bus.channel import open_channel
from ecu.contract.records import EXTENDED_ID, FRAME, FRAME_EXTENDED, FRAME_FD, new_record
from ecu.recording.recorder import read_recording

from .conftest import ROOT, demand_ids

pytestmark = pytest.mark.socketcan

BUS = ("--config", ROOT / "config" / "suv.toml", "-i", "socketcan", "-c", "vcan0")


@pytest.fixture
def pair():
    """Sender and receiver of 0x10 and 29-bit 0x20 on vcan0."""
    sender = open_channel("socketcan", "vcan0", receive_ids=[0x30])
    receiver = open_channel("socketcan", "vcan0", receive_ids=[0x10, 0x20 | EXTENDED_ID])
    yield sender, receiver
    sender.close()
    receiver.close()


def frames_of(*ids, flags=0, length=8):
    frames = new_record(FRAME, len(ids))
    frames["can_id"], frames["flags"], frames["length"] = ids, flags, length
    frames["data"][:, :length] = np.arange(length)
    return frames


def drained(channel, frames, start, wanted):
    """Drain until `wanted` frames are there: on a loaded machine the kernel delivers a little later."""
    count = 0
    for _ in patience():
        count += channel.drain(frames, start + count)
        if count >= wanted:
            break
    return count


def test_the_kernel_lets_only_wanted_identifiers_through(pair):
    sender, receiver = pair
    frames = new_record(FRAME, 16)
    sender.send(frames_of(0x10, 0x11, 0x20, 0x710), 4)
    sender.send(frames_of(0x10, 0x20, flags=FRAME_EXTENDED), 2)
    count = drained(receiver, frames, 0, 2)
    found = list(zip(frames["can_id"][:count].tolist(), frames["flags"][:count].tolist(), strict=True))
    assert found == [(0x10, 0), (0x20, FRAME_EXTENDED)]
    assert frames["data"][0, :9].tolist() == [0, 1, 2, 3, 4, 5, 6, 7, 0]


def test_one_does_not_hear_oneself_but_another_sender_of_ones_frames(pair):
    sender, receiver = pair
    frames = new_record(FRAME, 16)
    receiver.send(frames_of(0x10), 1)
    assert receiver.drain(frames, 0) == 0
    sender.send(frames_of(0x10), 1)
    assert drained(receiver, frames, 0, 1) == 1


def test_a_burst_longer_than_one_system_call_comes_in_order(pair):
    sender, receiver = pair
    sent = frames_of(*[0x10] * 300)
    sent["data"][:, 0], sent["data"][:, 1] = np.arange(300) % 256, np.arange(300) // 256
    frames = new_record(FRAME, 512)
    assert sender.send(sent, 300) == 300
    assert drained(receiver, frames, 7, 300) == 300
    assert (frames["data"][7:307] == sent["data"]).all()


def test_what_does_not_fit_waits_in_the_kernel(pair):
    sender, receiver = pair
    sender.send(frames_of(*[0x10] * 10), 10)
    frames = new_record(FRAME, 8)
    assert drained(receiver, frames, 4, 4) == 4
    assert drained(receiver, frames, 0, 6) == 6


def test_stamps_are_the_kernels_real_time_in_whole_microseconds(pair):
    sender, receiver = pair
    before = time.time_ns()
    for _ in range(20):
        sender.send(frames_of(0x10), 1)
    frames = new_record(FRAME, 32)
    stamps = frames["stamp_ns"][: drained(receiver, frames, 0, 20)]
    after = time.time_ns()
    assert (stamps % 1000 == 0).all()
    assert before - 1000 <= stamps[0] <= stamps[-1] <= after
    assert (np.diff(stamps) >= 0).all()


def test_frames_that_the_kernel_drops_are_counted(pair):
    sender, receiver = pair
    receiver._socket.setsockopt(1, 8, 2048)  # SOL_SOCKET, SO_RCVBUF
    sender.send(frames_of(*[0x10] * 100), 100)
    frames = new_record(FRAME, 128)
    sent, received = 100, 0
    for _ in patience():
        received += receiver.drain(frames, 0)
        if receiver.status().dropped == sent - received > 0:
            break
        sent += sender.send(frames_of(0x10), 1)  # the counter comes with the next frame
        received += drained(receiver, frames, 0, 1)


def test_fd_frames_come_where_configured():
    subprocess.run(["ip", "link", "set", "vcan1", "down"], check=True)
    subprocess.run(["ip", "link", "set", "vcan1", "mtu", "72", "up"], check=True)
    sender = open_channel("socketcan", "vcan1", receive_ids=[], fd=True)
    receivers = [open_channel("socketcan", "vcan1", receive_ids=[0x10], fd=fd) for fd in (True, False)]
    sender.send(frames_of(0x10, flags=FRAME_FD, length=64), 1)
    frames = new_record(FRAME, 8)
    assert drained(receivers[0], frames, 0, 1) == 1
    assert receivers[1].drain(frames, 1) == 0
    assert (frames["flags"][0], frames["length"][0], frames["data"][0, 63]) == (FRAME_FD, 64, 63)
    for channel in (sender, *receivers):
        channel.close()


def test_an_interface_that_goes_down_counts_as_bus_off_until_it_is_back(pair):
    sender, receiver = pair
    frames = new_record(FRAME, 8)
    subprocess.run(["ip", "link", "set", "vcan0", "down"], check=True)
    try:
        assert sender.send(frames_of(0x10, 0x10), 2) == 0
        receiver.drain(frames, 0)
        assert receiver.status().bus_off
        assert sender.status().bus_off
        assert sender.status().send_failures == 2
    finally:
        subprocess.run(["ip", "link", "set", "vcan0", "up"], check=True)
    assert sender.send(frames_of(0x10), 1) == 1
    assert drained(receiver, frames, 0, 1) == 1
    assert not receiver.status().bus_off


@pytest.fixture
def wire():
    made = Wire()
    yield made
    made.close()


def settle(channel, wanted):
    """Drain until the status is what is wanted; error frames pass through a terminal line."""
    frames = new_record(FRAME, 64)

    def settled():
        channel.drain(frames, 0)
        return wanted(channel.status())

    wait_for(settled)


# what the controller reports, in order -> (bus off, error passive) each time
STATES = {
    "warning": {WARNING: (False, False)},
    "passive": {WARNING: (False, False), PASSIVE: (False, True)},
    "recovered": {WARNING: (False, False), PASSIVE: (False, True), ACTIVE: (False, False)},
    "bus off": {WARNING: (False, False), PASSIVE: (False, True), BUS_OFF: (True, True)},
}


@pytest.mark.parametrize("reports", STATES.values(), ids=STATES)
def test_the_controllers_state_is_followed(wire, reports):
    unit = open_channel("socketcan", wire.ends[0].name, receive_ids=[0x10])
    for line, expected in reports.items():
        wire.ends[0].report(line)
        wait_for(lambda name=STATE_NAMES[line]: wire.ends[0].state() == name)
        settle(unit, lambda status, now=expected: (status.bus_off, status.error_passive) == now)
    unit.close()


def test_a_controller_that_takes_part_again_is_neither_off_nor_passive(wire):
    unit = open_channel("socketcan", wire.ends[0].name, receive_ids=[0x10])
    other = open_channel("socketcan", wire.ends[1].name, receive_ids=[])
    wire.ends[0].go_off()
    settle(unit, lambda status: (status.bus_off, status.error_passive) == (True, True))
    wire.ends[0].restart()
    other.send(frames_of(0x10), 1)
    settle(unit, lambda status: (status.bus_off, status.error_passive) == (False, False))
    unit.close()
    other.close()


def test_frames_go_through_the_wire_and_a_missing_acknowledgement_is_counted(wire):
    unit = open_channel("socketcan", wire.ends[0].name, receive_ids=[0x10])
    other = can.Bus(interface="socketcan", channel=wire.ends[1].name)
    unit.send(frames_of(0x123), 1)
    heard = other.recv(5)
    assert (heard.arbitration_id, bytes(heard.data)) == (0x123, bytes(range(8)))
    assert unit.status().send_failures == 0
    wire.cut = True
    unit.send(frames_of(0x124), 1)
    settle(unit, lambda status: status.send_failures == 1)
    unit.close()
    other.shutdown()


def test_the_daemon_cycles_records_what_candump_sees_and_leaves_in_order(daemon, vehicle, witness, tmp_path):
    car = vehicle("socketcan", "vcan0")
    unit = daemon(*BUS, "--record", tmp_path / "record")
    unit.wait_for("ready")
    independent = witness()
    car.drive(250)
    assert unit.end(signal.SIGTERM) == 0
    recording = read_recording(tmp_path / "record")
    assert recording.cycles["dropped"][-1] == 0
    assert len(recording.cycles) == unit.wait_for("stopped")["cycles"] >= 250
    recorded = recording.frames.read_text().splitlines()
    everything = independent.lines_until(recorded[-1])
    own = {f"{number:03X}" for number in demand_ids()}
    heard = [line for line in everything if _identifier(line) not in own]
    first = heard.index(recorded[0])
    assert recorded == heard[first : first + len(recorded)]
    demands = [line for line in everything if _identifier(line) == f"{demand_ids()[0]:03X}"]
    assert len(demands) >= 250


def _identifier(line: str) -> str:
    found = re.match(r"\(\d+\.\d{6}\) \S+ ([0-9A-F]+)#", line)
    assert found
    return found[1]


@pytest.mark.requirement("REQ-TWO-1")
def test_the_daemon_refuses_where_someone_sends_its_frames(daemon):
    other = can.Bus(interface="socketcan", channel="vcan0")
    task = other.send_periodic(can.Message(arbitration_id=demand_ids()[0], is_extended_id=False), 0.05)
    unit = daemon(*BUS)
    assert unit.end(None) == 2
    assert any("someone else already sends it" in line for line in unit.other)
    task.stop()
    other.shutdown()


def test_a_second_sender_in_operation_is_a_fault_that_goes_again(daemon, vehicle):
    car = vehicle("socketcan", "vcan0")
    unit = daemon(*BUS)
    unit.wait_for("ready")
    car.drive(50)
    intruder = open_channel("socketcan", "vcan0", receive_ids=[])
    intruder.send(frames_of(demand_ids()[0]), 1)
    car.drive(1, until=lambda: unit.said("fault", fault="foreign sender"))
    car.drive(1, until=lambda: unit.said("fault_gone", fault="foreign sender"))
    intruder.close()
    assert unit.end() == 0


def test_a_bus_that_goes_off_is_a_fault_and_the_exit_code_1(daemon, wire):
    unit = daemon(*BUS[:-1], wire.ends[0].name)
    unit.wait_for("ready")
    for line in (WARNING, PASSIVE, BUS_OFF):
        wire.ends[0].report(line)
    unit.wait_for("fault", fault="bus off")
    assert unit.end() == 1
    assert any("bus was off" in line for line in unit.other)


def test_the_daemon_comes_back_when_the_interface_does(daemon, vehicle):
    car = vehicle("socketcan", "vcan0")
    unit = daemon(*BUS)
    unit.wait_for("ready")
    car.drive(1, until=lambda: unit.said("mode", now="ready"))
    subprocess.run(["ip", "link", "set", "vcan0", "down"], check=True)
    unit.wait_for("fault", fault="bus off")
    subprocess.run(["ip", "link", "set", "vcan0", "up"], check=True)
    car.drive(1, until=lambda: unit.said("fault_gone", fault="bus off"))
    assert unit.end() == 0


def test_no_ring_is_left_behind(daemon, vehicle):
    car = vehicle("socketcan", "vcan0")
    unit = daemon(*BUS)
    ring = Path(unit.wait_for("ready")["ring"])
    assert ring.exists()
    car.drive(1, until=lambda: unit.said("mode", now="ready"))
    os.kill(unit.process.pid, signal.SIGTERM)
    assert unit.end(None) == 0
    assert not ring.exists()
