"""`python -m ecu.warm [--check]`: compile every kernel of the cycle, or load it from the cache.

Runs the preparation of `brake-ecu run`, and prints how many kernels had to be compiled. With `--check` it
exits 1 if there was any: an installation whose cache is complete compiles nothing.
"""

import argparse
import itertools
import tempfile
from pathlib import Path

from ecu.bus.protocol import BusStatus
from ecu.bus.signal_map import receive_plan
from ecu.bus.transmit import contract_transmit_plan
from ecu.contract.records import RecordArray
from ecu.contract.signals import CYCLE_NS
from ecu.jit import CompileCounter
from ecu.recording.ring import create_ring
from ecu.runtime.clock import Grid, TimeSource
from ecu.runtime.cycle import Ecu, Progress, Watch, cycle_once, new_ecu
from ecu.runtime.standby import Standby
from ecu.settings.config import load_config, new_params
from ecu.settings.resources import resource


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
    with tempfile.TemporaryDirectory(prefix="brake-ecu-") as folder:
        ring = create_ring(Path(folder) / "ring", {}, b"", slots=2, frames=1)
        instants = itertools.count(0, CYCLE_NS // 100)
        grid = Grid(TimeSource(instants.__next__, instants.__next__, lambda _: None))
        for standby in (None, Standby()):
            progress = Progress(Watch(Silence().status(), compiled), standby)
            for _ in range(3):
                cycle_once(twin, Silence(), ring, grid, progress)


def warm() -> int:
    """Prepare every kernel of the cycle; return how many had to be compiled."""
    compiled = CompileCounter()
    params = new_params(load_config(resource("config/suv.toml")))
    sending = contract_transmit_plan(resource("dbc/brake_ecu.dbc"), "BrakeEcu")
    warm_up(new_ecu(params, None, receive_plan(None), sending), compiled)
    return compiled.count


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m ecu.warm", description="Compile the kernels of the cycle."
    )
    parser.add_argument("--check", action="store_true", help="exit 1 if anything had to be compiled")
    check = parser.parse_args().check
    compiled = warm()
    print(f"{compiled} kernels compiled")
    return int(check and compiled > 0)


if __name__ == "__main__":
    raise SystemExit(main())
