"""`python -m brakelab.warm`: compile the kernels of daemon and simulated vehicle, each once, on two cores.

Processes that start together on an empty cache would each compile all they use.
"""

import subprocess
import sys

import numpy as np

from brakelab.plant.description import load_plant
from brakelab.plant.draw import draw, load_widths
from brakelab.plant.records import COMMANDS
from brakelab.plant.vehicle import STEP, advance, new_state
from brakelab.simulation.closed_loop import new_loop, run
from brakelab.simulation.scenario import load_scenario
from ecu.jit import CompileCounter
from ecu.settings.config import load_config
from ecu.settings.resources import resource


def compile_vehicle() -> None:
    """Compile the simulated vehicle with the friction laws of its linings."""
    plant = load_plant(resource("config/plant/suv14.toml"))
    params = draw(plant, 0, load_widths(resource("config/plant/draw.toml"), "wide"))
    state = new_state(params, 20.0, (100.0, 100.0))
    advance(params[0], state[0], np.zeros(1, COMMANDS)[0], STEP)


def compile_closed_loop() -> None:
    """Compile vehicle, daemon and bus between them; what either has compiled is loaded."""
    scenario = load_scenario(resource("config/scenarios/stop-1.toml"))
    run(new_loop(scenario, load_config(resource("config/suv.toml")), 0), seconds=0.05)


def main() -> int:
    compiled = CompileCounter()
    daemon = subprocess.Popen([sys.executable, "-m", "ecu.warm"])
    compile_vehicle()
    failed = daemon.wait()
    compile_closed_loop()
    print(f"{compiled.count} kernels of the laboratory compiled")
    return failed


if __name__ == "__main__":
    raise SystemExit(main())
