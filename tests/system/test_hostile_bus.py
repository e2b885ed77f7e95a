"""An armed daemon on a real SocketCAN bus that is full, strange or gone, and on a machine that stops it.

The bus is judged by what the car hears. The guest of these tests has one CPU: times are logic, not speed.
"""

import os
import random
import signal
import socket
import struct
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np
import pytest

from brakelab.testing.daemon import Daemon, patience
from ecu.bus.channel import open_channel

from .conftest import ROOT, Vehicle, demand_ids, priority

pytestmark = pytest.mark.socketcan

CONFIG = ROOT / "config" / "suv.toml"
FULL = 45  # frames in 10 ms: 500 kbit/s
EXTENDED, REMOTE, ERROR = 1 << 31, 1 << 30, 1 << 29
SURVIVED_S = 0.07
"""Silence of the car that costs no input, whatever the phase of the cycle."""
STILL_S = 5.0


@contextmanager
def interface(name: str, mtu: int = 16) -> Iterator[str]:
    """Make a bus that takes CAN FD frames if `mtu` is 72."""
    subprocess.run(["ip", "link", "add", name, "type", "vcan"], check=True)
    subprocess.run(["ip", "link", "set", name, "mtu", str(mtu), "up"], check=True)
    try:
        yield name
    finally:
        subprocess.run(["ip", "link", "del", name], check=False)


def arguments(bus: str) -> tuple[Any, ...]:
    return ("--config", CONFIG, "--armed", "-i", "socketcan", "-c", bus)


@contextmanager
def car_on(bus: str) -> Iterator[Vehicle]:
    """Put a car on the bus that rolls at 20 m/s and asks for 3 m/s^2."""
    car = Vehicle(open_channel("socketcan", bus, receive_ids=demand_ids()))
    car.set(decel_demand=3, vehicle_speed=20, vehicle_speed_valid=1)
    car.set(**{f"wheel_speed_{corner}": 55.0 for corner in ("fl", "fr", "rl", "rr")})
    with priority():
        yield car
    car.channel.close()


class Bench:
    """A car and an armed daemon that brakes it, for several tests: a start takes seconds."""

    def __init__(self, bus: str, car: Vehicle) -> None:
        self.bus, self.car, self.unit = bus, car, Daemon(*arguments(bus))
        self.unit.wait_for("ready")
        self.car.drive(1, until=lambda: self.unit.said("mode", now="active"))
        self.car.drive(100)  # the pressure has risen


@pytest.fixture(scope="module")
def bench() -> Iterator[Bench]:
    with interface("vcan8", mtu=72) as bus, car_on(bus) as car:
        made = Bench(bus, car)
        yield made
        if made.unit.process.poll() is None:
            assert made.unit.end() == 0


def front(heard: np.ndarray[Any, Any]) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Return valid flags and pressures [bar] of the front demands heard, without the spoilt ones."""
    data = heard["data"][heard["can_id"] == demand_ids()[0], :8]
    data = data[~(data == np.frombuffer(SPOILT, np.uint8)).all(axis=1)]
    pressure = (data[:, 2].astype(float) + 256.0 * data[:, 3]) * 0.005
    return data[:, 1] >> 4 & 3, pressure


def braked(
    car: Vehicle, each_period: Callable[[], None] = lambda: None, before: Callable[[], None] = lambda: None
) -> np.ndarray[Any, Any]:
    """Drive on until the machine let the car send all the time; return what it heard in a second.

    The car sends for a second before that, so that signals are back which were lost between two tests;
    then `before` is called.
    """
    heard = car.hear()
    for _ in patience():
        car.drive(100)
        car.longest_gap_s, car.each_period = 0.0, each_period
        before()
        heard = car.drive(100)
        car.each_period = lambda: None
        if car.longest_gap_s < SURVIVED_S:
            break
    return heard


def assert_braked(heard: np.ndarray[Any, Any]) -> None:
    """Look at what was heard in a second, half of it at least."""
    valid, pressure = front(heard)
    assert len(valid) >= 45
    assert (valid == 1).all()
    assert pressure.min() > 10.0


def events_since(unit: Daemon, line: int) -> list[str]:
    """Return what was logged since a line of the log."""
    unit.said("any")
    return [one["event"] for one in unit.seen[line:]]


def faults_since(unit: Daemon, line: int) -> set[str]:
    """Return what was reported of the bus since a line of the log; the ECU has never failed."""
    unit.said("any")
    said = unit.seen[line:]
    assert not [one for one in said if one["event"] == "mode" and one["now"] == "failed"]
    return {one["fault"] for one in said if one["event"] == "fault"} & OF_THE_BUS


@pytest.fixture
def raw(bench: Bench) -> Iterator[socket.socket]:
    """A socket that sends any frame."""
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as made:
        made.bind((bench.bus,))
        made.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
        yield made


def classical(can_id: int, data: bytes) -> bytes:
    return struct.pack("=IB3x8s", can_id, len(data), data)


def fd(can_id: int, data: bytes) -> bytes:
    return struct.pack("=IBB2x64s", can_id, len(data), 0, data)


WHEELS, OURS = 0x70, 0x50
SPOILT = b"\xff" * 8
"""Of either identifier the checksum is wrong."""
DRAW = random.Random(8)

# what else is on the bus in each period, and which faults may be reported
BESIDE: dict[str, tuple[Callable[[], list[bytes]], set[str]]] = {
    "full, of the highest priority": (lambda: [classical(0, b"\0" * 8)] * FULL, set()),
    "full of the lowest": (lambda: [classical(0x7FF, DRAW.randbytes(8)) for _ in range(FULL)], set()),
    "full of spoilt wheel speeds": (
        lambda: [classical(WHEELS, SPOILT)] * FULL,
        {"E2E rejections"},
    ),
    "wheel speeds too short": (lambda: [classical(WHEELS, b"\0" * 3)], {"E2E rejections"}),
    "remote frames": (lambda: [classical(REMOTE | one, b"\0" * 8) for one in (WHEELS, OURS)], set()),
    "29 bits": (lambda: [classical(EXTENDED | one, DRAW.randbytes(8)) for one in (WHEELS, OURS)], set()),
    "CAN FD": (lambda: [fd(one, DRAW.randbytes(64)) for one in (WHEELS, OURS)], set()),
    "spoilt demands": (lambda: [classical(OURS, SPOILT)], {"foreign sender"}),
}
OF_THE_BUS = {
    "E2E rejections",
    "foreign sender",
    "bus off",
    "error passive",
    "request lost",
    "wheel speed lost",
}
"""Faults that are looked at; a car that rolls on although it is braked raises others."""


@pytest.mark.parametrize(("frames", "allowed"), BESIDE.values(), ids=BESIDE)
@pytest.mark.requirement("REQ-IN-4")
def test_whatever_else_is_on_the_bus_the_car_is_braked(
    bench: Bench, raw: socket.socket, frames: Callable[[], list[bytes]], allowed: set[str]
) -> None:
    lines = 0

    def send() -> None:
        for frame in frames():
            with suppress(OSError):  # the queue is full
                raw.send(frame)

    def begin() -> None:
        nonlocal lines
        bench.unit.said("any")
        lines = len(bench.unit.seen)

    assert_braked(braked(bench.car, send, begin))
    bench.car.drive(20)
    assert faults_since(bench.unit, lines) <= allowed


# class and state of the controller in an error frame -> the fault that is reported
ERRORS = {
    "bus-off": (0x40, 0, "bus off"),
    "passive": (0x04, 0x30, "error passive"),
    "not acknowledged": (0x20, 0, "send failed"),
}


@pytest.mark.parametrize(("kind", "state", "fault"), ERRORS.values(), ids=ERRORS)
def test_what_the_controller_reports_becomes_a_fault_and_braking_goes_on(
    bench: Bench, raw: socket.socket, kind: int, state: int, fault: str
) -> None:
    assert_braked(braked(bench.car))

    def allowed() -> bool:
        raw.send(classical(ERROR | kind, bytes([0, state, 0, 0, 0, 0, 0, 0])))
        return bench.unit.said("fault", fault=fault)

    valid, _ = front(bench.car.drive(1, until=allowed))
    assert (valid == 1).any()
    raw.send(classical(ERROR | 0x100, b"\0" * 8))  # restarted
    bench.car.drive(1, until=lambda: bench.unit.said("fault_gone", fault=fault))
    assert_braked(braked(bench.car))


@pytest.mark.skipif(os.environ.get("WITH_VCAN") != "uml", reason="would set the machine's own clock")
@pytest.mark.parametrize("step_s", [0.03, -0.03, 3600, -3600, 31_536_000, -31_536_000])
@pytest.mark.requirement("REQ-LOOP-4")
def test_a_clock_that_is_set_brakes_on(bench: Bench, step_s: float) -> None:
    lines = 0

    def set_clock() -> None:
        nonlocal lines
        bench.unit.said("any")
        lines = len(bench.unit.seen)
        time.clock_settime(time.CLOCK_REALTIME, time.time() + step_s)

    assert_braked(braked(bench.car, before=set_clock))
    assert not faults_since(bench.unit, lines)

    bench.car.drive(1, until=lambda: "clock_set" in events_since(bench.unit, lines))


@pytest.mark.requirement("REQ-DEM-5")
def test_a_daemon_that_wakes_after_five_seconds_asks_for_what_is_asked_then(bench: Bench) -> None:
    car = bench.car
    car.drive(20)
    os.kill(bench.unit.process.pid, signal.SIGSTOP)
    os.waitpid(bench.unit.process.pid, os.WUNTRACED)
    car.hear()
    car.set(decel_demand=0)
    end = time.monotonic() + STILL_S
    car.drive(0, until=lambda: time.monotonic() > end)
    os.kill(bench.unit.process.pid, signal.SIGCONT)
    valid, pressure = front(car.drive(20))
    assert pressure[valid == 1].max(initial=0.0) == 0.0
    car.set(decel_demand=3)
    car.drive(100)


def test_one_that_was_stopped_while_its_standby_braked_says_nothing_any_more(
    bench: Bench, daemon: Callable[..., Daemon]
) -> None:
    """The last test of the shared daemon: it yields."""
    car = bench.car

    def standby() -> Daemon:
        car.drive(220)  # established
        made = daemon(*arguments(bench.bus), "--standby")
        made.wait_for("ready")
        car.drive(50, until=lambda: made.said("mode", now="active"))
        return made

    first, second = bench.unit, standby()
    for _ in patience():
        if not first.said("falls_silent"):
            break
        first, second = second, standby()  # whose start held up the first one for too long: one CPU
    lines = len(second.seen)
    os.kill(first.process.pid, signal.SIGSTOP)
    try:
        os.waitpid(first.process.pid, os.WUNTRACED)
        car.drive(20, until=lambda: "takes_over" in events_since(second, lines))
        car.set(decel_demand=0)
        car.drive(100)
        end = time.monotonic() + STILL_S
        heard = [car.drive(10, until=lambda: time.monotonic() > end)]
    finally:
        os.kill(first.process.pid, signal.SIGCONT)
    heard.append(car.drive(100, until=lambda: first.said("falls_silent")))
    heard.append(car.drive(50))
    valid, pressure = front(np.concatenate(heard))
    assert pressure[valid == 1].max(initial=0.0) == 0.0
    counters = heard[-1]["data"][heard[-1]["can_id"] == demand_ids()[0], 1] & 0xF
    assert set(np.diff(counters.astype(int)) % 15) <= {0, 1}  # one sender
    assert "falls_silent" not in events_since(second, lines)
    assert second.end() == 0


def test_of_two_armed_ones_that_start_together_one_brakes(daemon: Callable[..., Daemon]) -> None:
    with interface("vcan9") as bus, car_on(bus) as car:
        units = [daemon(*arguments(bus)) for _ in range(2)]

        def settled() -> bool:
            return any(unit.process.poll() is not None or unit.said("falls_silent") for unit in units)

        car.drive(100, until=settled)
        car.drive(100)  # the one that is left, or the first of both to take over
        heard = braked(car)
        counters = heard["data"][heard["can_id"] == demand_ids()[0], 1] & 0xF
        assert set(np.diff(counters.astype(int)) % 15) <= {0, 1}  # one sender
        assert_braked(heard)
        assert sorted(unit.end() for unit in units) in ([0, 0], [0, 2])


@pytest.mark.requirement("REQ-TWO-6")
def test_stray_frames_keep_no_daemon_from_starting_nor_from_braking(daemon: Callable[..., Daemon]) -> None:
    with interface("vcan9") as bus, car_on(bus) as car:
        stray = open_channel("socketcan", bus, receive_ids=[])
        with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as raw:
            raw.bind((bus,))
            unit = daemon(*arguments(bus))
            periods = 0

            def send() -> None:
                nonlocal periods
                periods += 1
                if periods % (40 if not unit.said("ready") else 4) == 0:  # 2.5, then 25 in a second
                    raw.send(classical(OURS, DRAW.randbytes(8)))

            car.each_period = send
            car.drive(0, until=lambda: unit.said("ready"))
            heard = car.drive(400)
        stray.close()
        rear = heard[heard["can_id"] == demand_ids()[1]]  # the stray ones are of the front
        assert len(rear) > 200
        assert not unit.said("falls_silent")
        assert unit.said("stray_frames") or unit.said("fault", fault="foreign sender")
        assert unit.end() == 0


def test_an_interface_that_is_removed_and_comes_back_is_used_again(daemon: Callable[..., Daemon]) -> None:
    with interface("vcan9") as bus, car_on(bus) as car:
        unit = daemon(*arguments(bus))
        unit.wait_for("ready")
        car.drive(50, until=lambda: unit.said("mode", now="active"))
        subprocess.run(["ip", "link", "del", bus], check=True)
        unit.wait_for("fault", fault="bus off")
        subprocess.run(["ip", "link", "add", bus, "type", "vcan"], check=True)
        subprocess.run(["ip", "link", "set", bus, "up"], check=True)
        car.drive(50, until=lambda: unit.said("fault_gone", fault="bus off"))
        assert_braked(braked(car))
        assert unit.end() == 0
