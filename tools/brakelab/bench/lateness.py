"""Lateness of the daemon's cycles, start and end, while other processes keep every core busy.

Daemon and simulated vehicle are processes on a bus of their own. Beside them, on the daemon's own core and
above its priority, a bare loop wakes every 10 ms and does nothing: the floor of this machine.
Its services are asked in turns of five seconds, with one of nothing.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.bench.services import (
    BLOCK_S,
    NOTHING,
    OPTIONS,
    Block,
    Service,
    alternate,
    inside,
    seconds_beside,
    start_services,
)
from brakelab.results.text_table import Table
from brakelab.results.verdict import Goal, verdict
from brakelab.rig.live import Processes, choose_bus
from brakelab.studies.measure import machine
from brakelab.studies.study import Asked, Measured, Study
from ecu.contract.signals import CYCLE_NS
from ecu.recording.recorder import read_recording
from ecu.runtime.clock import Grid, system_time
from ecu.runtime.realtime import PRIORITY, make_realtime
from ecu.settings.resources import resource

SCENARIO: Final = "config/scenarios/ordinary.toml"  # ten minutes
SEED: Final = 1
SETTLING_S: Final = 2.0
LEAST_CYCLES: Final = 100
BUSY: Final = "while True: pass"
LATEST_US: Final = 500.0
SHARES: Final = (0.5, 0.99, 0.999, 1.0)


class Lateness(NamedTuple):
    """Measured times [us], shape (cycles,)."""

    bare: NDArray[np.float64]
    woken: NDArray[np.float64]
    """Start of the daemon's cycle after its deadline."""
    ended: NDArray[np.float64]
    """End of its last stage after its deadline."""
    missed: int
    """Periods without a cycle of their own."""
    t_ns: NDArray[np.int64]
    """Deadlines on the monotonic clock [ns]."""
    blocks: list[Block]
    """Beside nothing and each service, in turns."""
    answers: dict[str, int]
    """Of each service."""
    bus: str
    busy: int
    """Processes that kept the cores busy."""


def bare_loop() -> None:
    """Wake every 10 ms until standard input closes, then print the lateness of each wake-up [ns], as JSON."""
    make_realtime()
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY + 1))
    late: list[int] = []
    grid = Grid(system_time())
    parent = os.getppid()
    while os.getppid() == parent and not os.path.exists(sys.argv[1]):
        late.append(grid.wait().lateness_ns)
    print(json.dumps(late))


def measure(seconds: float) -> Lateness:
    """Drive `SCENARIO` for `seconds` with every core busy.

    Raises:
        RunFault: daemon or vehicle did not get ready.
        UserError: there is no bus on which two processes can meet.
    """
    bus = choose_bus()
    busy: list[subprocess.Popen[bytes]] = []
    with tempfile.TemporaryDirectory() as folder:
        out, stop = Path(folder), Path(folder) / "stop"
        with (out / "daemon.log").open("wb") as log:
            processes = Processes(bus, resource("config/suv.toml"), out, log)
            bare = None
            services: dict[str, Service] = {}
            try:
                processes.start_vehicle(resource(SCENARIO), SEED)
                processes.start_daemon("drive", *OPTIONS)
                services = start_services(processes.daemons[-1].pid, bus)
                processes.departure()
                busy = [subprocess.Popen([sys.executable, "-c", BUSY]) for _ in os.sched_getaffinity(0)]
                bare = subprocess.Popen(
                    [sys.executable, "-c", f"from {__name__} import bare_loop; bare_loop()", str(stop)],
                    stdout=subprocess.PIPE,
                    text=True,
                )
                time.sleep(SETTLING_S)
                blocks = alternate(services, seconds, processes.driving)
                stop.touch()
                floor = np.array(json.loads(bare.communicate()[0]), np.float64)
            finally:
                for service in services.values():
                    service.end()
                others: list[subprocess.Popen[Any]] = [*busy, *([bare] if bare else [])]
                for process in others:
                    process.kill()
                    process.wait()
                processes.end()
        cycles = read_recording(out / "drive").cycles
    skipped = round(SETTLING_S * 1e9 / CYCLE_NS)
    cycles = cycles[skipped : skipped + round(seconds * 1e9 / CYCLE_NS)]
    woken = cycles["lateness_ns"] * 1e-3
    return Lateness(
        floor[LEAST_CYCLES:] * 1e-3,
        woken,
        woken + cycles["stage_ns"].sum(axis=1) * 1e-3,
        int(cycles["missed"].sum()),
        cycles["t_mono_ns"],
        blocks,
        {name: service.answers for name, service in services.items()},
        bus.why,
        len(busy),
    )


def lateness_tables(seconds: float) -> list[Table]:
    """Return the table of a run of `seconds`."""
    found = measure(seconds)
    late_ends = int(np.sum(found.ended > 1e-3 * CYCLE_NS))

    def row(what: str, values: NDArray[np.float64], goal: str, judged: str = "–") -> tuple[str, ...]:
        return (what, *(f"{np.quantile(values, share):.0f}" for share in SHARES), goal, judged)

    begins = verdict(Goal("", float(np.quantile(found.woken, 0.999)), LATEST_US))
    ends = verdict(Goal("", float(found.ended.max()), 1e-3 * CYCLE_NS))
    rows = [
        row("bare loop wakes", found.bare, "–"),
        row("daemon's cycle begins", found.woken, f"p99.9 ≤ {LATEST_US:.0f}", begins),
        row("daemon's cycle ends", found.ended, f"≤ {1e-3 * CYCLE_NS:.0f}", ends),
        *(
            row(f"begins, beside {service}", found.woken[chosen], "–")
            for service in dict.fromkeys(block.beside for block in found.blocks)
            if (chosen := inside(found.blocks, found.t_ns, service)).any()
        ),
    ]
    rates = ", ".join(
        f"{name} {count / seconds_beside(found.blocks, name):.1f}"
        for name, count in found.answers.items()
        if seconds_beside(found.blocks, name)
    )
    below = (
        f"µs after the deadline, {len(found.woken)} cycles of 10 ms on {found.bus}, {found.busy} other "
        f"processes busy on as many cores. {found.missed} periods missed, {late_ends} cycles ended after the "
        f"next deadline. Services are asked in turns of {BLOCK_S:g} s, {NOTHING} is one of them; those that "
        f"are not asked stand still, or wait. Answers a second: {rates}."
    )
    return [Table("lateness", ("what", "p50", "p99", "p99.9", "worst", "goal", "verdict"), rows, below)]


TEXT: Final = (
    "Daemon and simulated vehicle as processes in real time, with a busy process on every core. The bare "
    "loop wakes every 10 ms on the daemon's core, above its priority, and does nothing: what the machine "
    "allows."
)


def _run(asked: Asked) -> Measured:
    return Measured(lateness_tables(asked.seconds), f". {machine()}")


STUDY: Final = Study("Lateness under load", TEXT, _run)
