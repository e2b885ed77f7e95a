"""Frames of a log for `brake-ecu play`, with their times.

Without a map the log's frames are sent unchanged. With one (and for a file of decoded signals) the log is
decoded every 10 ms and encoded as the contract's input frames with new counters and checksums; stale or
invalid signals are sent as "not available".
"""

from collections.abc import Iterable, Iterator
from itertools import chain
from pathlib import Path

import numpy as np

from brakelab.arrays import Vector
from brakelab.logs.column_map import MappedFile
from brakelab.logs.formats import kind_of, read_frames
from brakelab.logs.sample_block import SampleBlock
from brakelab.logs.signal_file import freshness_at_any_rate, read_signals
from brakelab.replay.quality import Findings
from brakelab.replay.source import Source, load_source, only_interface
from ecu.bus.freshness import accept, begin_cycle, end_cycle
from ecu.bus.receive import new_reception, receive
from ecu.bus.transmit import contract_transmit_plan, frame_buffer, new_transmission, transmit
from ecu.contract.records import FRAME, FRAME_ERROR, FRAME_REMOTE, INPUTS, RecordArray, new_record
from ecu.contract.signals import CYCLE_NS, USABLE
from ecu.errors import UserError
from ecu.recording.recorder import read_recording
from ecu.settings.resources import resource


def timed_frames(
    log: Path, map: Path | None, channel: str, speed: float, findings: Findings
) -> Iterator[RecordArray]:
    """Yield the frames to send, in blocks; `stamp_ns` is the due time after the first frame.

    Raises:
        UserError: the map or the log is invalid, or contains nothing to send.
    """
    if map is None and kind_of(log) != "signals":
        blocks = raw_frames(log, channel, findings)
    else:
        blocks = contract_frames(log, load_source(map), findings)
    empty = True
    for frames in timed(blocks, speed):
        empty = False
        yield frames
    if empty:
        raise UserError(str(log), "", "holds no frame that can be sent; give a log of data frames")


def timed(blocks: Iterable[RecordArray], speed: float) -> Iterator[RecordArray]:
    """Yield `blocks`, none of them empty, with `stamp_ns` as the time since the first frame over `speed`.

    Frames keep the order of the log: one stamped before its predecessor is due with it.
    """
    first_ns = latest_ns = None
    for frames in blocks:
        stamps = np.maximum.accumulate(frames["stamp_ns"])
        if first_ns is None or latest_ns is None:
            first_ns = latest_ns = stamps[0]
        stamps = np.maximum(stamps, latest_ns)
        latest_ns = stamps[-1]
        frames["stamp_ns"] = np.rint((stamps - first_ns) / speed)
        yield frames


def raw_frames(log: Path, channel: str, findings: Findings) -> Iterator[RecordArray]:
    """Yield the data frames of a log unchanged; of several interfaces `channel`, else the first."""
    path = read_recording(log).frames if log.is_dir() else log
    for block in read_frames(path, findings.interfaces, findings.log):
        name = channel if channel in findings.interfaces else findings.interfaces[0]
        for chosen in only_interface([block], name, findings):
            frames = chosen[chosen["flags"] & (FRAME_ERROR | FRAME_REMOTE) == 0]
            if len(frames):
                yield frames


def contract_frames(log: Path, source: Source, findings: Findings) -> Iterator[RecordArray]:
    """Yield the log as the frames that a vehicle sends to the ECU, every 10 ms.

    Each block is overwritten by the next.
    """
    plan = contract_transmit_plan(resource("dbc/brake_ecu.dbc"), "Vehicle")
    transmission, frames = new_transmission(plan), frame_buffer(plan)
    for number, (t_ns, values) in enumerate(decoded(log, source, findings)):
        due = transmit(plan, transmission, values, number, frames)
        frames["stamp_ns"][:due] = t_ns
        yield frames[:due]


def decoded(log: Path, source: Source, findings: Findings) -> Iterator[tuple[int, Vector]]:
    """Yield the time [ns] and the usable inputs, NaN: none, shape (N_INPUTS,), of every 10 ms of a log."""
    if kind_of(log) == "signals":
        return _decoded_samples(log, source.columns, findings)
    return _decoded_frames(log, source, findings)


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


def _decoded_samples(
    log: Path, columns: MappedFile | None, findings: Findings
) -> Iterator[tuple[int, Vector]]:
    timeouts = columns.timeouts if columns else None
    inputs, freshness = new_record(INPUTS), freshness_at_any_rate(timeouts)
    t_ns: int | None = None
    for block in read_signals(log, findings.signals, columns):
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
