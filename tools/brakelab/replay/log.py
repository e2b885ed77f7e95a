"""One log of a drive, whatever its form, through one ECU: rows of results come out."""

import hashlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from brakelab.logs.column_map import MappedFile
from brakelab.logs.formats import Advance, kind_of, read_frames
from brakelab.logs.log_quality import LogQuality
from brakelab.logs.physics.judge import judge
from brakelab.logs.physics.samples import Collector, car_of
from brakelab.logs.sample_block import SampleBlock
from brakelab.logs.signal_file import freshness_at_any_rate, read_signals
from brakelab.replay.calibrated import changes_of
from brakelab.replay.earlier_layout import convert_initial
from brakelab.replay.engine import Ecu, Rows, run_frames, run_samples
from brakelab.replay.quality import Findings, identifier, note_faults
from brakelab.replay.seen import set_raw_ends
from brakelab.replay.source import Source, only_interface
from ecu.algorithm.step import INITIAL, initial_part, resume
from ecu.bus.receive import new_reception
from ecu.bus.receive_plan import ReceivePlan, accepted_ids
from ecu.contract.faults import FOREIGN_SENDER
from ecu.contract.records import CYCLE, EXTENDED_ID, FRAME_ERROR, FRAME_EXTENDED, RecordArray
from ecu.errors import UserError
from ecu.recording.recorder import Recording, read_recording
from ecu.unit_lateness import lateness_line


def log_size(path: Path) -> int:
    """Return the length in bytes by which progress is shown."""
    if path.is_dir():
        path = read_recording(path).frames
    return path.stat().st_size if path.is_file() else 0


def log_hash(path: Path) -> str:
    """Return the SHA-256 of the log's content."""
    if path.is_dir():
        path = read_recording(path).frames
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def read_cycles(recording: Recording) -> RecordArray:
    """Return the cycles of a recording as CYCLE, shape (n,). Raises UserError if its layout is another's."""
    cycles = np.zeros(len(recording.cycles), CYCLE)
    try:
        for name in CYCLE.names or ():
            cycles[name] = recording.cycles[name]
    except ValueError:
        raise _other_version(recording) from None
    if not len(cycles):
        raise UserError(str(recording.folder), "cycles.bin", "no cycle was recorded; record for longer")
    return cycles


def start_as_recorded(ecu: Ecu, recording: Recording) -> None:
    """Overwrite the ECU's state with the one before the first recorded cycle; arm it if it was armed."""
    if recording.about.get("first_cycle", 0):
        raise UserError(
            str(recording.folder),
            "recording.json",
            "begins within a run: its cycles cannot be repeated; leave --cycles out",
        )
    known = recording.initial.dtype == INITIAL
    initial = recording.initial if known else convert_initial(recording.initial, initial_part(ecu.state))
    if initial is None:
        raise _other_version(recording)
    resume(ecu.state, initial)
    ecu.params[0]["transmit"] = recording.about.get("armed", ecu.params[0]["transmit"])


def _other_version(recording: Recording) -> UserError:
    return UserError(
        str(recording.folder), "recording.json", "recorded by another version; replay its frames.log instead"
    )


def replay_log(
    path: Path,
    ecu: Ecu,
    source: Source,
    recording: Recording | None,
    findings: Findings,
    advance: Advance,
) -> Iterator[Rows]:
    """Yield the rows of one log.

    `recording` gives initial state, T_k and missed periods to a log of frames. `advance(bytes)` hears of
    progress.
    """
    findings.seen = ecu.seen
    kind = kind_of(path)
    if kind == "signals":
        yield from _noted(_replay_signals(path, ecu, source.columns, findings, advance), findings, ecu)
        return
    found = read_recording(path) if kind == "recording" else None
    log = found.frames if found else path
    # What `watch` kept may begin within a run: with the state before it unknown, it is a log like any other.
    counted = found is not None and not found.about.get("first_cycle", 0)
    if counted:
        recording = found
    plan = source.plan
    ecu.params[0]["mapped"] = plan.mapped
    set_raw_ends(ecu.seen, plan.signals)
    reception = findings.reception = new_reception(plan)
    findings.freshness, findings.mapped = reception.freshness, plan.mapped
    findings.bus = source.bus
    blocks = read_frames(log, findings.interfaces, findings.log, advance, mended=not counted)
    if source.bus and not counted:
        blocks = only_interface(blocks, source.bus, findings)
    if recording is None:
        rows = run_frames(ecu, plan, reception, blocks)
    else:
        start_as_recorded(ecu, recording)
        cycles = read_cycles(recording)
        findings.dropped = int(cycles["dropped"].max())
        if not counted:
            blocks = _from_first_recorded(blocks, recording)
            counted = _heard_everything(cycles)
            if counted:
                blocks = _expected_only(blocks, plan)
        changes, findings.calibrated = changes_of(recording, ecu)
        rows = run_frames(ecu, plan, reception, blocks, cycles, counted, changes)
    yield from _noted(rows, findings, ecu)
    if recording is not None and ecu.params[0]["transmit"]:
        findings.late = lateness_line(ecu.params[0], ecu.outputs[0])
    if not reception.messages["accepted"].any():
        raise _foreign(path, source, findings)


def _from_first_recorded(blocks: Iterator[RecordArray], recording: Recording) -> Iterator[RecordArray]:
    """Leave out the frames before the first one that the recorded run heard."""
    own = next(read_frames(recording.frames, [], LogQuality(), mended=False))
    for block in blocks:
        later = block[np.maximum.accumulate(block["stamp_ns"]) >= own["stamp_ns"][0]]
        if len(later):
            yield later


def _heard_everything(cycles: RecordArray) -> bool:
    """Return whether the recorded run consumed all expected frames of its bus, and nobody sent its own.

    Then each cycle took as many of an independent log's frames as it noted, also such as the kernel
    delivered after the cycle whose deadline they were stamped before.
    """
    return not (cycles["dropped"].any() or (cycles["bus_faults"] & FOREIGN_SENDER).any())


def _expected_only(blocks: Iterator[RecordArray], plan: ReceivePlan) -> Iterator[RecordArray]:
    """Leave out frames that the kernel's filter kept from the recorded run, and its own."""
    wanted = list(accepted_ids(plan.messages[plan.messages["foreign"] == 0]))
    for block in blocks:
        extended = np.where(block["flags"] & FRAME_EXTENDED, EXTENDED_ID, 0).astype(np.uint32)
        expected = block[np.isin(block["can_id"] | extended, wanted) & (block["flags"] & FRAME_ERROR == 0)]
        if len(expected):
            yield expected


def _noted(rows: Iterator[Rows], findings: Findings, ecu: Ecu) -> Iterator[Rows]:
    collector = Collector()
    for block in rows:
        if not findings.rows:
            findings.start_ns = int(block.t_ns[0])
        findings.rows += len(block.t_ns)
        note_faults(findings, block.values)
        collector.add(block.samples)
        yield block
    findings.physics = judge(collector.series(), car_of(ecu.params[0]))


def _replay_signals(
    path: Path, ecu: Ecu, columns: MappedFile | None, findings: Findings, advance: Advance
) -> Iterator[Rows]:
    blocks = read_signals(path, findings.signals, columns)
    first = next(blocks)
    findings.mapped[first.places] = True
    ecu.params[0]["mapped"] = findings.mapped
    freshness = findings.freshness = freshness_at_any_rate(columns.timeouts if columns else None)

    def every() -> Iterator[SampleBlock]:
        yield first
        yield from blocks

    yield from run_samples(ecu, freshness, every())
    advance(log_size(path))


def _foreign(path: Path, source: Source, findings: Findings) -> UserError:
    plan = source.plan
    ours = plan.messages["foreign"] == 0
    wanted = [identifier(message) for message in plan.messages[ours]]
    shown = ", ".join(wanted[:4]) + (f", … ({len(wanted)} in all)" if len(wanted) > 4 else "")
    rejected = int(findings.reception.messages["received"][ours].sum()) if findings.reception else 0
    heard = f"{findings.log.frames} frames on {', '.join(findings.interfaces)}"
    found = "no identifier" if not rejected else f"no intact frame ({rejected} rejected)"
    where = f" on {source.bus}" if source.bus else ""
    remedy = f"{found} that is expected{where} ({shown}); give the signal map of this car: --map MAP"
    return UserError(str(path), heard, remedy)
