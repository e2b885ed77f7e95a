"""Workload of the benches: a simulated stop (`config/scenarios/stop-1.toml`) as frames and as inputs.

The wheel transducers are on, so that every 10 and 20 ms message of the contract is on the bus.
"""

from functools import cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.simulation.closed_loop import Drive, new_loop, plans, run
from brakelab.simulation.configured import configured, shipped, with_keys
from brakelab.simulation.ecu_inputs import ecu_inputs, vehicle_frames
from ecu.contract.records import RecordArray
from ecu.settings.config import new_params

MESSAGES_IN: Final = 13
"""Input messages of the contract at 10 and 20 ms."""
ALL_DUE: Final = 1
"""A cycle in which exactly these are due: HydraulicStatus is in odd ones, Ambient in one of a hundred."""


class Stop(NamedTuple):
    """A simulated stop."""

    params: RecordArray
    """`PARAMS` of the configured car, shape (1,)."""
    frames: RecordArray
    """`FRAME`s of the vehicle, in the order of their stamps."""
    inputs: RecordArray
    """`INPUTS` of every cycle, shape (n,)."""
    values: NDArray[np.float64]
    """Values that the vehicle sends, the last sample held, shape (n, N_INPUTS)."""
    braking: int
    """The first cycle in which all four corners observe their friction."""


@cache
def simulated_stop() -> Stop:
    """Return a stop from 120 km/h at 4 m/s^2 after 6 s of cruising."""
    scenario = with_keys(shipped("stop-1"), {"wheel_transducers": True})
    config = configured()
    drive = run(new_loop(scenario, config, seed=0))
    frames = vehicle_frames(drive.frames)
    inputs = ecu_inputs(frames, len(drive.t))
    params = new_params(config)
    params["mapped"] = plans().ecu_hears.mapped
    return Stop(params, frames, inputs, inputs["value"].copy(), _all_observing(drive))


def _all_observing(drive: Drive) -> int:
    modes = np.stack([drive.outputs[f"mode_{corner}"] for corner in ("fl", "fr", "rl", "rr")])
    return int(np.flatnonzero((modes == 1).all(axis=0))[0])
