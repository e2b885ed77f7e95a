"""`brake-ecu play`: a recorded drive onto a bus, on the absolute schedule of its stamps.

Without a map the log's frames go out as they are. With one (and for a file of decoded signals) the log is
decoded every 10 ms and encoded as the contract's input frames with fresh counters and checksums; what is
stale or invalid in the log is sent as "not available".
"""

import sys
from collections.abc import Iterable, Iterator
from itertools import chain
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.replay.formats import kind_of, read_frames
from brakelab.replay.progress import progress_bar
from brakelab.replay.quality import Findings, damage_lines
from brakelab.replay.signal_file import SampleBlock, freshness_at_any_rate, read_signals
from brakelab.replay.source import Source, load_source, map_unused, only_interface
from ecu.bus.channel import Channel, open_channel
from ecu.bus.freshness import accept, begin_cycle, end_cycle
from ecu.bus.receive import new_reception, receive
from ecu.bus.transmit import contract_transmit_plan, frame_buffer, new_transmission, transmit
from ecu.clock import TimeSource, system_time
from ecu.errors import UserError
from ecu.recorder import read_recording
from ecu.records import FRAME, FRAME_ERROR, FRAME_FD, FRAME_REMOTE, INPUTS, RecordArray, new_record
from ecu.resources import resource
from ecu.signals import CYCLE_NS, USABLE

Vector = NDArray[np.float64]

# Raw frames due within this time leave in one burst: waking for each would cost more than it gives.
BURST_NS: Final = 500_000


class Burst(NamedTuple):
    """Frames that leave together."""

    t_ns: int
    """On the log's clock."""
    frames: RecordArray


def play(log: Path, interface: str, channel: str, map: Path | None, speed: float) -> int:
    """Put `log` onto a bus, `speed` times as fast as it was; return the exit code 0.

    Raises:
        UserError: an argument, the map or the log is not right, or the bus cannot be opened.
    """
    if not speed > 0.0:
        raise UserError("--speed", f"{speed:g}", "give a factor above 0; 1 is real time")
    if not log.exists():
        raise UserError(str(log), "", "no such file; give an existing log")
    if map and kind_of(log) == "signals":
        print(map_unused(map, log), file=sys.stderr)
    findings = Findings(log)
    if map is None and kind_of(log) != "signals":
        bursts = raw_bursts(log, channel, findings)
    else:
        bursts = contract_bursts(log, load_source(map), findings)
    first = next(bursts, None)
    if first is None:
        raise UserError(str(log), "", "holds no frame that can be sent; give a log of data frames")
    fd = bool((first.frames["flags"] & FRAME_FD).any())
    bus = open_channel(interface, channel, receive_ids=(), fd=fd)
    try:
        offered, taken = send_on_schedule(chain([first], bursts), bus, speed, system_time())
    finally:
        bus.close()
    for line in damage_lines(findings):
        print(line, file=sys.stderr)
    refused = f", {offered - taken} refused by the bus" if taken < offered else ""
    others = (
        f", {findings.other_interfaces} of other interfaces left out" if findings.other_interfaces else ""
    )
    print(f"{log}: {taken} frames sent{refused}{others}")
    return 0


def send_on_schedule(
    bursts: Iterable[Burst], bus: Channel, speed: float, source: TimeSource
) -> tuple[int, int]:
    """Send every burst at its time; return how many frames were offered and how many the bus took."""
    offered = taken = 0
    start_ns, first_ns, shown_ns = source.monotonic_ns(), None, 0
    with progress_bar("play", None) as advance:
        for burst in bursts:
            first_ns = burst.t_ns if first_ns is None else first_ns
            due_ns = start_ns + round((burst.t_ns - first_ns) / speed)
            while source.monotonic_ns() < due_ns:
                source.sleep_until(due_ns)
            offered += len(burst.frames)
            taken += bus.send(burst.frames, len(burst.frames))
            advance(1e-9 * (burst.t_ns - first_ns - shown_ns))
            shown_ns = burst.t_ns - first_ns
    return offered, taken


def raw_bursts(log: Path, channel: str, findings: Findings) -> Iterator[Burst]:
    """Yield the data frames of a log as they are; of several interfaces `channel`, else the first."""
    path = read_recording(log).frames if log.is_dir() else log
    for block in read_frames(path, findings.interfaces, findings.log):
        name = channel if channel in findings.interfaces else findings.interfaces[0]
        for chosen in only_interface([block], name, findings):
            frames = chosen[chosen["flags"] & (FRAME_ERROR | FRAME_REMOTE) == 0]
            first = 0
            while first < len(frames):
                t_ns = int(frames["stamp_ns"][first])
                later = np.flatnonzero(frames["stamp_ns"][first : first + 64] > t_ns + BURST_NS)
                end = first + (int(later[0]) if len(later) else len(frames[first : first + 64]))
                yield Burst(t_ns, frames[first:end])
                first = end


def contract_bursts(log: Path, source: Source, findings: Findings) -> Iterator[Burst]:
    """Yield the log as the frames that a vehicle sends to the ECU, every 10 ms."""
    plan = contract_transmit_plan(resource("dbc/brake_ecu.dbc"), "Vehicle")
    transmission, frames = new_transmission(plan), frame_buffer(plan)
    decoded = (
        _decoded_samples(log, findings)
        if kind_of(log) == "signals"
        else _decoded_frames(log, source, findings)
    )
    for number, (t_ns, values) in enumerate(decoded):
        due = transmit(plan, transmission, values, number, frames)
        yield Burst(t_ns, frames[:due])


def _decoded_frames(log: Path, source: Source, findings: Findings) -> Iterator[tuple[int, Vector]]:
    path = read_recording(log).frames if log.is_dir() else log
    blocks: Iterator[RecordArray] = read_frames(path, findings.interfaces, findings.log)
    if source.bus:
        blocks = only_interface(blocks, source.bus, findings)
    inputs, reception = new_record(INPUTS), new_reception(source.plan)
    t_ns = latest = None
    end = new_record(FRAME, 0)
    for frames in chain(blocks, [end]):
        cursor = 0
        if frames is not end:
            latest = max(int(frames["stamp_ns"].max()), latest or 0)
        while True:
            if t_ns is None:
                if frames is end:
                    return
                t_ns = int(frames["stamp_ns"][0])
                begin_cycle(inputs[0], t_ns, CYCLE_NS)
            cursor = receive(source.plan, reception, frames, cursor, len(frames), inputs[0])
            if cursor == len(frames) and (frames is not end or t_ns > (latest or 0)):
                break
            end_cycle(inputs[0], reception.freshness)
            yield t_ns, _usable(inputs)
            t_ns += CYCLE_NS
            begin_cycle(inputs[0], t_ns, CYCLE_NS)


def _decoded_samples(log: Path, findings: Findings) -> Iterator[tuple[int, Vector]]:
    inputs, freshness = new_record(INPUTS), freshness_at_any_rate()
    t_ns: int | None = None
    for block in read_signals(log, findings.signals):
        for row, stamp_ns in enumerate(block.t_ns.tolist()):
            if t_ns is None:
                t_ns = stamp_ns
                begin_cycle(inputs[0], t_ns, CYCLE_NS)
            while stamp_ns > t_ns:
                end_cycle(inputs[0], freshness)
                yield t_ns, _usable(inputs)
                t_ns += CYCLE_NS
                begin_cycle(inputs[0], t_ns, CYCLE_NS)
            _accept_row(inputs, freshness, block, row)
    if t_ns is not None:
        end_cycle(inputs[0], freshness)
        yield t_ns, _usable(inputs)


def _accept_row(inputs: RecordArray, freshness: RecordArray, block: SampleBlock, row: int) -> None:
    for place, value in zip(block.places.tolist(), block.values[row].tolist(), strict=True):
        if value == value:
            accept(inputs[0], freshness, place, value, int(block.t_ns[row]), True)


def _usable(inputs: RecordArray) -> Vector:
    usable = inputs["verdict"][0] & USABLE == USABLE
    return np.where(usable, inputs["value"][0], np.nan)
