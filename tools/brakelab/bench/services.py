"""Services beside the daemon for `bench lateness`: one at a time for some seconds, none in between.

All cycles come from one run on one machine in one state, with the same other load.
"""

import os
import signal
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from threading import Event, Thread
from typing import Any, Final, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from brakelab.bench.xcp_master import VARIABLES, Master, Wire
from brakelab.rig.live import Bus
from ecu.bus.addresses import parse_addresses
from ecu.diagnostics.read_faults import BY_MASK
from ecu.diagnostics.services import READ_FAULTS
from ecu.diagnostics.tester import Tester
from ecu.diagnostics.transport import Link
from ecu.errors import RunFault

NOTHING: Final = "nothing"
BLOCK_S: Final = 5.0
AFTER_CHANGE_S: Final = 0.5
"""Of a block, not counted: processes that go on catch up first."""
VIEWERS: Final = 2
MEASURED: Final = 200
"""Variables that the master of XCP measures each cycle."""
PAGE, METRICS, XCP = 48760, 48761, 48762
"""Ports."""
IDS: Final = "0x7E0:0x7E8"
OPTIONS: Final = ("--metrics-port", str(METRICS), "--diagnostics", IDS, "--xcp", f"udp:{XCP}")
"""Of a daemon whose services are measured."""


class Block(NamedTuple):
    """A stretch of the monotonic clock [ns]."""

    begin_ns: int
    end_ns: int
    beside: str
    """Which service was asked."""


class Service(Protocol):
    """What can be asked, and left alone."""

    answers: int
    """That came."""

    def run(self, on: bool) -> None:
        """Ask it, or leave it alone."""

    def end(self) -> None:
        """Leave nothing behind."""


class Client:
    """Asks a service without end in a thread, while it is wanted."""

    def __init__(self, ask: Callable[[], object]) -> None:
        """`ask`: one question; OSError and RunFault of it are an answer that did not come."""
        self.answers = 0
        self.wanted = Event()

        def work() -> None:
            while self.wanted.wait():
                with suppress(OSError, RunFault):
                    ask()
                    self.answers += 1

        Thread(target=work, daemon=True).start()

    def run(self, on: bool) -> None:
        """Ask, or be silent."""
        (self.wanted.set if on else self.wanted.clear)()

    def end(self) -> None:
        """Be silent."""
        self.wanted.clear()


class Watchers:
    """`watch --json`, and `watch --web` with viewers, of the daemon `pid`.

    Raises:
        RunFault: the page did not open.
    """

    def __init__(self, pid: int) -> None:
        watch = [sys.executable, "-m", "ecu.cli", "watch", str(pid)]
        page = f"http://127.0.0.1:{PAGE}"
        self.answers = 0
        self._processes: list[subprocess.Popen[Any]] = [
            subprocess.Popen([*watch, "--json"], stdout=subprocess.DEVNULL),
            subprocess.Popen([*watch, "--web", "--port", str(PAGE)], stdout=subprocess.PIPE, text=True),
        ]
        web = self._processes[1]
        if not (web.stdout and web.stdout.readline().startswith("http")):
            self.end()
            raise RunFault(f"{page}: the page did not open; is the port taken?")
        for _ in range(VIEWERS):
            Thread(target=self._view, args=(f"{page}/stream",), daemon=True).start()

    def run(self, on: bool) -> None:
        """Let them go on, or stop them where they are."""
        for process in self._processes:
            process.send_signal(signal.SIGCONT if on else signal.SIGSTOP)

    def _view(self, address: str) -> None:
        while True:
            with suppress(OSError), urllib.request.urlopen(address, timeout=60) as stream:
                while line := stream.readline():
                    self.answers += line.startswith(b"data")
            time.sleep(0.5)

    def end(self) -> None:
        """End them."""
        for process in self._processes:
            process.kill()
            process.wait()


class Scraper(Client):
    """Reads the metrics every second; in between, and when it is not wanted, their process stands still."""

    def __init__(self) -> None:
        def scrape() -> None:
            time.sleep(1.0)
            with urllib.request.urlopen(metrics_address(), timeout=5) as answer:
                answer.read()

        super().__init__(scrape)

    def run(self, on: bool) -> None:
        """Ask, or stop the process."""
        for pid in _metrics_processes():
            os.kill(pid, signal.SIGCONT if on else signal.SIGSTOP)
        super().run(on)

    def end(self) -> None:
        """Let the process go on, to be ended by its daemon."""
        self.run(True)
        super().end()


def metrics_address() -> str:
    """Return where the daemon serves its metrics."""
    return f"http://127.0.0.1:{METRICS}/metrics"


def _metrics_processes() -> list[int]:
    """Return the processes that serve metrics at our port."""
    place = f"127.0.0.1:{METRICS}".encode()
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):
            words = path.read_bytes().split(b"\0")
            if b"ecu.watch.metrics_process" in words and place in words:
                found.append(int(path.parent.name))
    return found


def _tester(bus: Bus) -> Client:
    """Return a tester that reads the faults again and again."""
    addresses = parse_addresses("--diagnostics", IDS)
    tester = Tester(Link(bus.interface, bus.channel, addresses.request, addresses.response), addresses)
    return Client(lambda: tester.ask(bytes([READ_FAULTS, BY_MASK, 0xFF])))


class Measurement(Client):
    """A master of XCP: measures `MEASURED` variables each cycle, and takes what comes."""

    def __init__(self) -> None:
        self._master = Master(Wire("udp", XCP)).connect()
        names = [name for name, (_, one) in VARIABLES.items() if one.kind.itemsize == 8][:MEASURED]
        self._master.begin_numbers(names)
        self._master.stop()
        super().__init__(self._measure)

    def _measure(self) -> None:
        self._master.start()
        while self.wanted.is_set():
            self.answers += self._master.take()[0] == 0  # the first packet of each cycle
            self._master.packets.clear()
        self._master.stop()

    def end(self) -> None:
        """Hang up."""
        super().end()
        self._master.close()


def start_services(pid: int, bus: Bus) -> dict[str, Service]:
    """Return what is asked beside the daemon `pid`, which was started with `OPTIONS`, by its description.

    Raises:
        RunFault: one of them does not answer.
    """
    return {
        f"`watch --json`, `watch --web` with {VIEWERS} viewers": Watchers(pid),
        "`--metrics-port`, scraped each second": Scraper(),
        "`--diagnostics`, faults read without pause": _tester(bus),
        f"`--xcp`, {MEASURED} variables each cycle": Measurement(),
    }


def alternate(services: Mapping[str, Service], seconds: float, goes_on: Callable[[], bool]) -> list[Block]:
    """Ask one service after the other for a block each, after a block of nothing; return the blocks."""
    blocks: list[Block] = []
    end = time.monotonic() + seconds
    for service in services.values():
        service.run(False)
    turns = [NOTHING, *services]
    while time.monotonic() < end and goes_on():
        turn = turns[len(blocks) % len(turns)]
        if turn in services:
            services[turn].run(True)
        begin_ns = time.monotonic_ns()
        time.sleep(max(0.0, min(BLOCK_S, end - time.monotonic())))
        blocks.append(Block(begin_ns + round(1e9 * AFTER_CHANGE_S), time.monotonic_ns(), turn))
        if turn in services:
            services[turn].run(False)
    return blocks


def inside(blocks: list[Block], t_ns: NDArray[np.int64], beside: str) -> NDArray[np.bool_]:
    """Return which instants lie in blocks of one service."""
    found = np.zeros(len(t_ns), np.bool_)
    for block in blocks:
        if block.beside == beside:
            found |= (t_ns >= block.begin_ns) & (t_ns < block.end_ns)
    return found


def seconds_beside(blocks: list[Block], beside: str) -> float:
    """Return for how long a service was asked [s]."""
    chosen = [block for block in blocks if block.beside == beside]
    return sum(1e-9 * (block.end_ns - block.begin_ns) + AFTER_CHANGE_S for block in chosen)
