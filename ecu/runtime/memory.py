"""Memory of the cycle, allocated before the first one."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.algorithm.step import new_state
from ecu.bus.protocol import STATUS
from ecu.bus.receive import Reception, new_reception
from ecu.bus.receive_plan import ReceivePlan
from ecu.bus.transmit import Transmission, TransmitPlan, frame_buffer, new_transmission
from ecu.contract.records import CYCLE, FRAME, INPUTS, OUTPUTS, RecordArray, new_record, output_vector
from ecu.runtime.standby import CLAIM, STANDBY, new_standby

WAITING_FRAMES: Final = 16384  # more than a socket holds: what waited while the process stood still
N_COUNTED: Final = 4

# State of the loop beside the ECU's own records. The cycle's record has the tick that it began with.
LOOP: Final = np.dtype(
    [
        ("waiting", "i8"),  # frames received and not consumed yet
        ("foreign", "i8"),  # frames with an identifier of ours so far
        ("overruns", "i8"),
        ("worst_lateness_ns", "i8"),
        ("previous_t_ns", "i8"),  # T_k of the cycle before
        ("emptied_ns", "i8"),  # when the bus was drained last, on the run's time line
        ("set_ns", "i8"),  # by how much the real-time clock was set by then
        ("status", STATUS),  # of the bus
        ("kept", "i8"),  # 1: the side process stores its data
        ("compiled", "i8"),  # 1: a kernel was compiled in operation
        ("seen", "i8", (N_COUNTED,)),  # counters whose rise is a fault, see `loop.py`
        ("until", "i8", (N_COUNTED,)),  # cycle to which the fault is shown
        ("claim", CLAIM),
        ("standby", STANDBY),
        ("rehearsal_ns", "i8"),  # how long a rehearsal lasts, a mean
        ("instant", "i8", (2,)),  # struct timespec, of a reading of a clock
    ],
    align=True,
)


class Ecu(NamedTuple):
    """All that the cycle reads and overwrites, one unit to kernels too."""

    params: RecordArray
    state: RecordArray
    inputs: RecordArray
    outputs: RecordArray
    vector: NDArray[np.float64]
    """The outputs as `transmit` reads them."""
    learned: RecordArray
    """A view into the state."""
    estimate: RecordArray
    """Likewise."""
    watched: RecordArray
    """Likewise."""
    cycle: RecordArray
    receive_plan: ReceivePlan
    reception: Reception
    transmit_plan: TransmitPlan
    transmission: Transmission
    waiting: RecordArray
    """Frames received and not consumed yet, from index 0."""
    sending: RecordArray


def new_ecu(
    params: RecordArray, learned: RecordArray | None, receive_plan: ReceivePlan, transmit_plan: TransmitPlan
) -> Ecu:
    """Return an ECU before its first cycle, with the values `learned` before (None: unadapted)."""
    params = params.copy()
    params["mapped"] = receive_plan.mapped
    state = new_state(params, learned)
    outputs = new_record(OUTPUTS)
    return Ecu(
        params,
        state,
        new_record(INPUTS),
        outputs,
        output_vector(outputs),
        state["learned"],
        state["estimate"],
        state["witness"]["published"],
        new_record(CYCLE),
        receive_plan,
        new_reception(receive_plan),
        transmit_plan,
        new_transmission(transmit_plan),
        new_record(FRAME, WAITING_FRAMES),
        frame_buffer(transmit_plan),
    )


def new_twin(ecu: Ecu) -> Ecu:
    """Return an ECU with memory of its own for all that the cycle overwrites, but the frames that wait."""
    state, outputs = ecu.state.copy(), ecu.outputs.copy()
    return ecu._replace(
        state=state,
        inputs=ecu.inputs.copy(),
        outputs=outputs,
        vector=output_vector(outputs),
        learned=state["learned"],
        estimate=state["estimate"],
        watched=state["witness"]["published"],
        cycle=ecu.cycle.copy(),
        reception=new_reception(ecu.receive_plan),
        transmission=new_transmission(ecu.transmit_plan),
        sending=frame_buffer(ecu.transmit_plan),
    )


def new_loop(*, waits: bool) -> RecordArray:
    """Return the state of a loop before its first cycle (`LOOP`, shape (1,)); `waits`: as a standby."""
    loop = new_record(LOOP)
    loop["kept"] = 1
    loop["standby"] = new_standby(waits=waits)
    return loop
