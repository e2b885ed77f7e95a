"""Kernels of the laboratory that its commands call, called once: `ecu/build.py` sees from it what to compile.

Those of studies, benchmarks and identifications are not among them: numba compiles them when they run.
"""

import numpy as np

from brakelab.identify.tuning.recording import Recording
from brakelab.identify.tuning.replay import replay_errors
from brakelab.mapping.series import FEWEST, read_series
from brakelab.plant.disc import cooling_rate
from brakelab.simulation.ecu_inputs import ecu_inputs
from brakelab.warm import compile_all
from ecu.bus.database import load_database
from ecu.contract.records import FRAME, INPUTS, new_record
from ecu.settings.config import load_config
from ecu.settings.resources import resource


def call_every_entry() -> None:
    """Call what `simulate`, `rig`, `demo`, `replay`, `map` and `tune` call."""
    compile_all()
    recording = Recording(new_record(INPUTS, 2), np.ones((2, 4)), np.zeros(2, np.int64))
    replay_errors([recording], [load_config(resource("config/suv.toml"))])
    ecu_inputs(new_record(FRAME), 1)
    database = load_database(resource("dbc/brake_ecu.dbc"))
    message = database.messages[0]
    frames = new_record(FRAME, FEWEST)
    frames["can_id"], frames["length"] = message.frame_id, message.length
    frames["stamp_ns"] = np.arange(FEWEST)
    read_series([frames], database)
    cooling_rate(1e-3, 1e-4, 10.0, 0.0)
