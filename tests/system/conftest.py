"""Whole processes on real buses: the daemon as a child, a vehicle that sends its frames."""

import json
import os
import queue
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brakelab.simulation.priority import PRIORITY
from ecu.bus.channel import open_channel
from ecu.bus.protocol import Channel
from ecu.bus.transmit import contract_transmit_plan, frame_buffer, new_transmission, transmit
from ecu.contract.records import FRAME, new_record
from ecu.contract.signals import INPUT, N_INPUTS
from ecu.recording.recorder import read_recording
from ecu.runtime.clock import Grid, system_time

ROOT = Path(__file__).parents[2]
DBC = ROOT / "dbc" / "brake_ecu.dbc"
PATIENCE_S = 300  # a cold cache compiles every kernel


class Daemon:
    """`brake-ecu run` as a child process; its log is read line by line."""

    def __init__(
        self, *arguments: object, stderr: int = subprocess.PIPE, program: str = "", **environment: str
    ) -> None:
        paths = os.pathsep.join([str(ROOT), str(ROOT / "tools")])
        command = [sys.executable, *(["-c", program] if program else ["-m", "ecu.cli"]), "run"]
        self.process = subprocess.Popen(
            [*command, *map(str, arguments)],
            stdout=subprocess.DEVNULL,
            stderr=stderr,
            text=True,
            env={**os.environ, "PYTHONPATH": paths, **environment},
            preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL),  # the tests may run under nohup
        )
        self._lines: queue.Queue[str | None] = queue.Queue()
        self.seen: list[dict[str, Any]] = []
        self.other: list[str] = []
        if stderr == subprocess.PIPE:
            threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self.process.stderr is not None
        for line in self.process.stderr:
            self._lines.put(line)
        self._lines.put(None)

    def wait_for(self, event: str, **content: Any) -> dict[str, Any]:
        """Return the first line of `event` with `content`, read already or to come."""
        wanted = {"event": event, **content}
        for line in self.seen:
            if wanted.items() <= line.items():
                return line
        while self._next():
            if self.seen and wanted.items() <= self.seen[-1].items():
                return self.seen[-1]
        raise AssertionError(f"ended without {wanted}: {self.seen} {self.other}")

    def said(self, event: str, **content: Any) -> bool:
        """Whether a line of `event` with `content` was written by now."""
        while not self._lines.empty() and self._next():
            pass
        return any({"event": event, **content}.items() <= line.items() for line in self.seen)

    def family(self) -> list[int]:
        """Process ids of the loop, the supervisor and the recorder, as far as they are there."""
        family = [self.process.pid]
        for pid in family:
            with suppress(OSError):
                family += map(int, Path(f"/proc/{pid}/task/{pid}/children").read_text().split())
        return family

    def _next(self) -> bool:
        line = self._lines.get(timeout=PATIENCE_S)
        if line is None:
            self._lines.put(None)
            return False
        try:
            self.seen.append(json.loads(line))
        except json.JSONDecodeError:
            self.other.append(line.strip())
        return True

    def end(self, number: int | None = signal.SIGTERM) -> int:
        """Send a signal, wait for the end and return the exit code."""
        if number is not None and self.process.poll() is None:
            self.process.send_signal(number)
        while self._next():
            pass
        return self.process.wait(PATIENCE_S)


@pytest.fixture
def daemon() -> Iterator[Callable[..., Daemon]]:
    """Start daemons that do not outlive the test."""
    started: list[Daemon] = []

    def start(*arguments: object, **more: Any) -> Daemon:
        started.append(Daemon(*arguments, **more))
        return started[-1]

    yield start
    for one in started:
        if one.process.poll() is None:
            one.process.kill()
        one.process.wait()


def patience() -> Iterator[None]:
    """Turns of a loop that waits for a fact: how long that takes is the machine's affair."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        yield
    raise AssertionError(f"not in {PATIENCE_S} s")


def wait_for(fact: Callable[[], bool]) -> None:
    """Look again and again until `fact` holds."""
    for _ in patience():
        if fact():
            return
        time.sleep(0.01)


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
    """Sends every frame of the vehicle at its rate for as long as it is told to, and hears what it must."""

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
