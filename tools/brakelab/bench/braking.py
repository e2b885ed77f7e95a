"""What the benches work on: a simulated stop (`config/scenarios/stop-1.toml`) as frames and as inputs.

The wheel transducers are on, so that every 10 and 20 ms message of the contract is on the bus.
"""

from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.closed_loop import START_NS, Drive, new_loop, run
from brakelab.scenario import load_scenario
from ecu.bus.freshness import begin_cycle, end_cycle
from ecu.bus.receive import ReceivePlan, Reception, contract_receive_plan, new_reception, receive
from ecu.bus.transmit import contract_transmit_plan
from ecu.config import load_config, new_params
from ecu.jit import kernel
from ecu.records import INPUTS, RecordArray, new_record
from ecu.resources import resource
from ecu.signals import CYCLE_NS

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
    """What the vehicle sends, the last sample held, shape (n, N_INPUTS)."""
    braking: int
    """The first cycle in which all four corners observe their friction."""


@cache
def simulated_stop() -> Stop:
    """Return a stop from 120 km/h at 4 m/s^2 after 6 s of cruising."""
    scenario = load_scenario(resource("config/scenarios/stop-1.toml"))
    scenario = scenario.model_copy(update={"wheel_transducers": True})
    config = load_config(resource("config/suv.toml"))
    drive = run(new_loop(scenario, config, seed=0))
    frames, inputs = decoded(drive)
    params = new_params(config)
    params["mapped"] = contract_receive_plan(resource("dbc/brake_ecu.dbc")).mapped
    return Stop(params, frames, inputs, inputs["value"].copy(), _all_observing(drive))


def decoded(drive: Drive) -> tuple[RecordArray, RecordArray]:
    """Return the vehicle's frames of a drive (`FRAME`) and the `INPUTS` of every cycle, shape (n,)."""
    plan = contract_receive_plan(resource("dbc/brake_ecu.dbc"))
    own = contract_transmit_plan(resource("dbc/brake_ecu.dbc"), "BrakeEcu").ids
    frames = drive.frames[~np.isin(drive.frames["can_id"], own)]
    inputs = new_record(INPUTS, len(drive.t))
    _decode(plan, new_reception(plan), frames, new_record(INPUTS), inputs)
    return frames, inputs


def _all_observing(drive: Drive) -> int:
    modes = np.stack([drive.outputs[f"mode_{corner}"] for corner in ("fl", "fr", "rl", "rr")])
    return int(np.flatnonzero((modes == 1).all(axis=0))[0])


@kernel
def _decode(plan: ReceivePlan, reception: Reception, frames: Any, now: Any, inputs: Any) -> None:
    first = 0
    for k in range(len(inputs)):
        begin_cycle(now[0], START_NS + k * CYCLE_NS, CYCLE_NS)
        first = receive(plan, reception, frames, first, len(frames), now[0])
        end_cycle(now[0], reception.freshness)
        inputs[k] = now[0]
