"""Inputs of the ECU in a simulated drive: decoded once, for any number of runs of `step`."""

from typing import Any

import numpy as np

from brakelab.simulation.closed_loop import START_NS, plans
from ecu.bus.freshness import begin_cycle, end_cycle
from ecu.bus.receive import Reception, new_reception, receive
from ecu.bus.receive_plan import ReceivePlan
from ecu.contract.records import INPUTS, RecordArray, new_record
from ecu.contract.signals import CYCLE_NS
from ecu.jit import kernel


def vehicle_frames(frames: RecordArray) -> RecordArray:
    """Return the frames of a drive that the vehicle sent."""
    return frames[~np.isin(frames["can_id"], plans().ecu_sends.ids)]


def ecu_inputs(frames: RecordArray, cycles: int, plan: ReceivePlan | None = None) -> RecordArray:
    """Return `INPUTS` of a drive's first `cycles`, shape (cycles,), from the vehicle's frames.

    `plan`: what is received; None: the contract's messages. The first cycle ends at `START_NS`.
    """
    plan = plan or plans().ecu_hears
    inputs = new_record(INPUTS, cycles)
    _decode(plan, new_reception(plan), frames, new_record(INPUTS), inputs)
    return inputs


@kernel
def _decode(plan: ReceivePlan, reception: Reception, frames: Any, now: Any, inputs: Any) -> None:
    first = 0
    for k in range(len(inputs)):
        begin_cycle(now[0], START_NS + k * CYCLE_NS, CYCLE_NS)
        first = receive(plan, reception, frames, first, len(frames), now[0])
        end_cycle(now[0], reception.freshness)
        inputs[k] = now[0]
