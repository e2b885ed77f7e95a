"""Whole processes on real buses: the daemon as a child, a vehicle that sends its frames."""

import os
import shutil
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brakelab.bench.xcp_master import Master, Wire
from brakelab.simulation.priority import PRIORITY
from brakelab.testing.daemon import Daemon, patience, wait_for
from ecu.bus.channel import open_channel
from ecu.bus.protocol import Channel
from ecu.bus.transmit import contract_transmit_plan, frame_buffer, new_transmission, transmit
from ecu.contract.records import FRAME, new_record
from ecu.contract.signals import INPUT, N_INPUTS
from ecu.recording.recorder import read_recording
from ecu.runtime.clock import Grid, system_time

ROOT = Path(__file__).parents[2]
DBC = ROOT / "dbc" / "brake_ecu.dbc"
ENVIRONMENT = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "tools")])}
"""In which a child takes the modules of this checkout."""


@contextmanager
def priority() -> Iterator[None]:
    """SCHED_FIFO for this thread, not for what it starts: a vehicle does not wait for a busy machine."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(PRIORITY))
    except OSError:
        yield
        return
    try:
        yield
    finally:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


class Vehicle:
    """Sends every frame of the vehicle at its rate until it is stopped, and receives what it must."""

    def __init__(self, channel: Channel) -> None:
        self.channel = channel
        self._plan = contract_transmit_plan(DBC, "Vehicle")
        self._counters, self._buffer = new_transmission(self._plan), frame_buffer(self._plan)
        self._periods = 0
        self._frames = new_record(FRAME, 4096)
        self.values = np.zeros(N_INPUTS)
        self.each_period: Callable[[], None] = lambda: None
        """What else is sent in each period."""
        self.longest_gap_s = self._sent_s = 0.0
        """Longest time between two periods of frames [s]: the machine may hold it up."""
        self.set(hydraulic_ready=1, decel_demand_valid=1, accumulator_pressure=160, vehicle_speed=0)

    def set(self, **values: float) -> None:
        """Set inputs by name."""
        for name, value in values.items():
            self.values[INPUT[name]] = value

    def drive(self, cycles: int, until: Callable[[], bool] = lambda: True) -> np.ndarray[Any, Any]:
        """Send until `cycles` of the daemon were heard and `until` holds; return the frames that came in."""
        grid, heard, demands = Grid(system_time()), [self.hear()], 0
        for _ in patience():
            grid.wait()
            self.each_period()
            count = transmit(self._plan, self._counters, self.values, self._periods, self._buffer)
            self.channel.send(self._buffer, count)
            gap_s, self._sent_s = time.monotonic() - self._sent_s, time.monotonic()
            self.longest_gap_s = max(self.longest_gap_s, gap_s)
            self._periods += 1
            heard.append(self.hear())
            demands += int((heard[-1]["can_id"] == demand_ids()[0]).sum())
            if demands >= cycles and until():
                break
        return np.concatenate(heard)

    def hear(self) -> np.ndarray[Any, Any]:
        """Return the frames that wait."""
        return self._frames[: self.channel.drain(self._frames, 0)].copy()


@cache
def demand_ids() -> tuple[int, ...]:
    """Identifiers of all frames of the ECU, demands first."""
    return tuple(int(number) for number in contract_transmit_plan(DBC, "BrakeEcu").ids)


@pytest.fixture
def vehicle() -> Iterator[Callable[..., Vehicle]]:
    """Open a vehicle on a bus; the test that drives it runs in real time where that is granted."""
    opened: list[Vehicle] = []

    def start(interface: str, channel: str) -> Vehicle:
        opened.append(Vehicle(open_channel(interface, channel, receive_ids=demand_ids())))
        return opened[-1]

    with priority():
        yield start
    for one in opened:
        one.channel.close()


@pytest.fixture
def car(vehicle: Callable[..., Vehicle], request: pytest.FixtureRequest) -> Vehicle:
    """A car on the module's multicast group `GROUP`; it rolls at 20 m/s and asks for 3 m/s²."""
    car = vehicle("udp_multicast", request.module.GROUP)
    car.set(decel_demand=3, vehicle_speed=20, vehicle_speed_valid=1)
    car.set(**{f"wheel_speed_{corner}": 55.0 for corner in ("fl", "fr", "rl", "rr")})
    return car


@contextmanager
def driven(car: Vehicle) -> Iterator[None]:
    """Let the car drive meanwhile."""
    ends = threading.Event()
    thread = threading.Thread(target=lambda: car.drive(0, until=ends.is_set))
    thread.start()
    try:
        yield
    finally:
        ends.set()
        thread.join()


@pytest.fixture
def unit(
    daemon: Callable[..., Daemon], car: Vehicle, request: pytest.FixtureRequest, tmp_path: Path
) -> Iterator[Daemon]:
    """An armed daemon with diagnostics and a key, beside a car that drives in a thread."""
    from .uds_tester import SECRET

    key = tmp_path / "key"
    key.write_text(SECRET)
    key.chmod(0o600)
    group = request.module.GROUP
    bus = ("--config", ROOT / "config" / "suv.toml", "--armed", "-i", "udp_multicast", "-c", group)
    keeps = ("--state", tmp_path / "state", "--record", tmp_path / "record")
    one = daemon(*bus, *keeps, "--diagnostics", "0x7E0:0x7E8", "--diagnostics-key", key)
    one.wait_for("ready")
    with driven(car):
        yield one


@pytest.fixture
def start_driving(car: Vehicle) -> Iterator[Callable[[], None]]:
    """Let the car drive from the call on until the test ends."""
    with ExitStack() as stack:
        yield lambda: stack.enter_context(driven(car))


@pytest.fixture
def connect() -> Iterator[Callable[[str, int], Master]]:
    """Connect XCP masters that do not outlive the test."""
    with ExitStack() as stack:

        def start(kind: str, port: int) -> Master:
            return stack.enter_context(closing(Master(Wire(kind, port)))).connect()

        yield start


def free_port() -> int:
    """A port of this machine that nobody has."""
    with socket.create_server(("127.0.0.1", 0)) as one:
        return int(one.getsockname()[1])


def process_of(daemon: Daemon, module: str) -> int | None:
    """Process beside the loop that runs a module, None: it is away."""
    for pid in daemon.family():
        try:
            if module.encode() in Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0"):
                return pid
        except OSError:
            pass
    return None


def unharmed(daemon: Daemon, recordings: Path) -> None:
    """End the daemon; the loop and the recorder know nothing of what befell a process beside them."""
    assert daemon.end() == 0
    assert not daemon.said("recorder_gone")
    numbers = read_recording(recordings).cycles["number"]
    assert numbers.tolist() == list(range(len(numbers)))


class Witness:
    """candump on vcan0, the log that knows nothing of the daemon."""

    def __init__(self, log: Path) -> None:
        self.log = log
        program = shutil.which("candump")
        assert program, "candump is missing: apt-get install can-utils"
        with log.open("wb") as file:
            self._process = subprocess.Popen([program, "-L", "-r", "4000000", "vcan0"], stdout=file)
        wait_for(lambda: log.stat().st_size > 0)

    def lines_until(self, last: str) -> list[str]:
        """Wait for the line `last`, end the log and return its lines."""
        wait_for(lambda: f"{last}\n" in self.log.read_text())
        self.end()
        return self.log.read_text().splitlines()

    def end(self) -> None:
        """Stop listening."""
        self._process.terminate()
        self._process.wait()


@pytest.fixture
def witness(tmp_path: Path) -> Iterator[Callable[[], Witness]]:
    """Start a witness on a bus where someone sends; return when it hears."""
    started: list[Witness] = []

    def start() -> Witness:
        started.append(Witness(tmp_path / "candump.log"))
        return started[-1]

    yield start
    for one in started:
        one.end()
