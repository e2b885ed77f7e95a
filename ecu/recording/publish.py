"""What the loop does with the ring in each cycle: it writes and goes on, whoever reads."""

from ecu.contract.records import RecordArray
from ecu.jit import kernel
from ecu.recording.ring import Ring


def publish(
    ring: Ring,
    cycle: RecordArray,
    outputs: RecordArray,
    inputs: RecordArray,
    estimate: RecordArray,
    learned: RecordArray,
    watched: RecordArray,
    frames: RecordArray,
) -> None:
    """Write one cycle with its `cycle["frames"]` frames, the first of `frames`; never waits.

    The claims are outside the kernel that fills, where a compiler could move or drop them.
    """
    header = ring.header[0]
    number, begin = int(header["written"]), int(header["frames_written"])
    end = begin + int(cycle["frames"][0])
    place = number % len(ring.slots)
    numbers = ring.slots["number"]
    numbers[place] = -1
    header["frames_claimed"] = end
    _fill(ring.slots, place, ring.frames, begin, end, cycle, outputs, inputs, estimate, frames)
    latest = ring.latest[number % 2]
    latest["learned"], latest["watched"] = learned[0], watched[0]
    header["frames_written"] = end
    numbers[place] = number
    header["written"] = number + 1


# Arrays, not records: handing a numpy record to a kernel costs 10 us, an array 0.6 us.
@kernel
def _fill(
    slots: RecordArray,
    place: int,
    ring_frames: RecordArray,
    begin: int,
    end: int,
    cycle: RecordArray,
    outputs: RecordArray,
    inputs: RecordArray,
    estimate: RecordArray,
    frames: RecordArray,
) -> None:
    for i in range(begin, end):
        ring_frames[i % len(ring_frames)] = frames[i - begin]
    slot = slots[place]
    slot.first_frame = begin
    slot.recorded.cycle = cycle[0]
    slot.recorded.outputs = outputs[0]
    slot.beside.inputs = inputs[0]
    slot.beside.estimate = estimate[0]
