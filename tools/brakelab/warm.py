"""`python -m brakelab.warm`: compile the kernels of daemon, simulated vehicle and replay, on two cores.

Afterwards `simulate`, `replay`, `rig` and `demo` compile nothing, whatever scenario and friction law.
Processes that start together on an empty cache would each compile all they use.
"""

import subprocess
import sys
import tempfile
from itertools import islice
from pathlib import Path
from typing import Final

import numpy as np
from can import Logger, LogReader

from brakelab.logs.formats import read_frames
from brakelab.plant.description import load_plant
from brakelab.plant.draw import draw, load_widths
from brakelab.plant.records import COMMANDS
from brakelab.plant.vehicle import STEP, advance, new_state
from brakelab.replay.command import replay_into
from brakelab.replay.quality import Findings
from brakelab.rig.vehicle_node import warm_up
from brakelab.simulation.closed_loop import new_loop, run
from brakelab.simulation.configured import configured, shipped
from brakelab.simulation.simulate import simulate
from ecu.jit import CompileCounter
from ecu.output import Level, asked, new_policy
from ecu.settings.resources import resource

FRAMES: Final = 50
"""Of a log in each format."""
SHORT: Final = """
plant = "suv"
initial_speed = 20.0
phase = [{ kind = "cruise", speed = 20.0, seconds = 0.1 }, { kind = "brake", decel = 4.0, seconds = 0.2 }]
"""


def compile_vehicle() -> None:
    """Compile the simulated vehicle with the friction laws of its linings."""
    plant = load_plant(resource("config/plant/suv14.toml"))
    params = draw(plant, 0, load_widths(resource("config/plant/draw.toml"), "wide"))
    state = new_state(params, 20.0, (100.0, 100.0))
    advance(params[0], state[0], np.zeros(1, COMMANDS)[0], STEP)


def compile_closed_loop() -> None:
    """Compile vehicle, daemon and bus between them; what either has compiled is loaded."""
    scenario = shipped("stop-1")
    run(new_loop(scenario, configured(), 0), seconds=0.05)


def compile_commands() -> None:
    """Compile what `simulate` and `replay` do around that: frames to text and back, the rows of a result."""
    config = resource("config/suv.toml")
    with tempfile.TemporaryDirectory(prefix="brake-ecu-") as folder, new_policy() as policy:
        policy.level = Level.QUIET
        drive, scenario = Path(folder) / "drive", Path(folder) / "scenario.toml"
        scenario.write_text(SHORT)
        with asked():
            simulate(scenario, config, drive)
            for log in (Path(f"{drive}.log"), Path(f"{drive}.parquet")):
                replay_into([log], config, None, None, None, Path(folder) / "result.parquet")
            for ending in (".asc", ".blf", ".trc"):
                _read_as(drive.with_suffix(ending), Path(f"{drive}.log"))


def _read_as(log: Path, frames: Path) -> None:
    """Read some frames of a candump log in another format."""
    with LogReader(frames) as reader, Logger(log) as writer:
        for message in islice(reader, FRAMES):
            writer(message)
    findings = Findings(log)
    for _ in read_frames(log, findings.interfaces, findings.log):
        pass


def compile_all() -> None:
    """Compile all of the laboratory's kernels that stand above."""
    compile_vehicle()
    compile_closed_loop()
    warm_up(shipped("demo"))
    compile_commands()


def main() -> int:
    """Compile what is missing, and return the exit code."""
    compiled = CompileCounter()
    daemon = subprocess.Popen([sys.executable, "-m", "ecu.warm"])
    compile_vehicle()
    failed = daemon.wait()
    compile_all()
    print(f"{compiled.count} kernels of the laboratory compiled")
    return failed


if __name__ == "__main__":
    raise SystemExit(main())
