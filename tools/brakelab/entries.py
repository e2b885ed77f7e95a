"""Kernels of the laboratory that its commands call, called once: `ecu/build.py` sees from it what to compile.

Those of studies, benchmarks and identifications are not among them: numba compiles them when they run.
"""

import numpy as np

from brakelab.fmu.vehicle_cycle import go_on, measure
from brakelab.identify.tuning.recording import Recording
from brakelab.identify.tuning.replay import replay_errors
from brakelab.mapping.series import FEWEST_FRAMES, read_series
from brakelab.plant.disc import cooling_rate
from brakelab.simulation.ecu_inputs import ecu_inputs
from brakelab.simulation.scenario import load_scenario
from brakelab.simulation.vehicle_bus import N_TRUTH, new_noise, new_values, new_vehicle
from brakelab.warm import compile_all
from ecu.bus.database import load_database
from ecu.bus.freshness import target_dtype
from ecu.contract.records import FRAME, INPUTS, new_record
from ecu.contract.signals import N_OUTPUTS
from ecu.settings.config import load_config
from ecu.settings.resources import resource


def call_every_entry() -> None:
    """Call what `simulate`, `rig`, `demo`, `replay`, `map`, `tune` and FMUs call."""
    compile_all()
    recording = Recording(new_record(INPUTS, 2), np.ones((2, 4)), np.zeros(2, np.int64))
    replay_errors([recording], [load_config(resource("config/suv.toml"))])
    ecu_inputs(new_record(FRAME), 1)
    database = load_database(resource("dbc/brake_ecu.dbc"))
    message = database.messages[0]
    frames = new_record(FRAME, FEWEST_FRAMES)
    frames["can_id"], frames["length"] = message.frame_id, message.length
    frames["stamp_ns"] = np.arange(FEWEST_FRAMES)
    read_series([frames], database)
    cooling_rate(1e-3, 1e-4, 10.0, 0.0)
    vehicle = new_vehicle(load_scenario(resource("config/scenarios/stop-1.toml")), 0)
    noise, values, row = new_noise(0), new_values(), np.zeros(N_TRUTH)
    measure(vehicle, noise, values, row)
    go_on(vehicle, np.zeros(1, target_dtype(N_OUTPUTS))[0], noise, values, row)
