"""A few cycles on a bus without traffic, so that every kernel of the cycle is compiled or loaded."""

import itertools
import sys
import tempfile
from pathlib import Path

from ecu.bus.protocol import BusStatus
from ecu.bus.socketcan import new_socket
from ecu.contract.records import RecordArray
from ecu.contract.signals import CYCLE_NS
from ecu.jit import CompileCounter
from ecu.recording.ring import create_ring, ring_folder
from ecu.runtime.clock import Grid, TimeSource, system_time
from ecu.runtime.cycle import Progress, cycle_once
from ecu.runtime.exchange import LEAD_NS, exchange
from ecu.runtime.memory import Ecu, new_ecu


class Silence:
    """A bus without traffic, see `ecu.bus.channel.Channel`."""

    name = ""

    def drain(self, frames: RecordArray, start: int) -> int:
        """Receive nothing."""
        return 0

    def send(self, frames: RecordArray, count: int) -> int:
        """Take `count` frames."""
        return count

    def status(self) -> BusStatus:
        """Return an error-free status."""
        return BusStatus(False, False, 0, 0)

    def close(self) -> None:
        """Nothing is open."""


def warm_up(ecu: Ecu, compiled: CompileCounter) -> None:
    """Run a few cycles of an identical ECU on a bus of its own, so that every kernel is compiled."""
    twin = new_ecu(ecu.params, None, ecu.receive_plan, ecu.transmit_plan)
    with tempfile.TemporaryDirectory(prefix="brake-ecu-", dir=ring_folder()) as folder:
        ring = create_ring(Path(folder) / "ring", {}, b"", slots=2, frames=1)
        instants = itertools.count(0, CYCLE_NS // 100)
        grid = Grid(TimeSource(instants.__next__, instants.__next__, lambda _: None))
        for waits in (True, False):
            progress = Progress(twin, Silence().status(), compiled, waits=waits)
            for _ in range(3):
                cycle_once(twin, Silence(), ring, grid, progress)
        if sys.platform == "linux":
            on_can = Grid(system_time())
            on_can.approach(LEAD_NS)
            exchange(twin, progress.twin, progress.loop, progress.twin_loop, on_can.memory, new_socket())
