"""`brake-ecu replay`: recorded logs, one drive in the order given, through the code of the ECU."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.logs.formats import Advance, kind_of
from brakelab.replay.contradictions import HELD, contradiction_lines, runs
from brakelab.replay.drive import drive_frames, replay_drive
from brakelab.replay.log import log_hash, log_size
from brakelab.replay.needed import (
    NEEDED,
    NO_PRESSURE,
    fault_lines,
    has_pressure,
    lacking_line,
    needed_lines,
    nothing_usable,
    request_line,
    transducer_line,
)
from brakelab.replay.quality import Findings, quality_counts, quality_lines
from brakelab.replay.source import Source, check_map, delay_line, load_source, radius_line
from brakelab.replay.summary import WIDTH, brakings_table, listed, prediction_errors, prediction_lines, taps
from brakelab.results.car import KEY as CAR
from brakelab.results.car import car_of
from brakelab.results.columns import EXPORTS
from brakelab.results.console import new_console
from brakelab.results.files import ResultWriter, brakes_path
from brakelab.results.outputs import check_outputs, config_files
from brakelab.results.pads import pads_of
from brakelab.results.prediction import SHORT
from brakelab.results.progress import progress_bar
from brakelab.simulation.configured import with_observer
from ecu import __version__
from ecu.algorithm.step import new_state
from ecu.bus.receive_plan import ReceivePlan
from ecu.contract.records import RecordArray
from ecu.errors import RunFault, UserError
from ecu.output import Level, argument, detail, give, policy, say, wrote
from ecu.recording.recorder import Recording, read_recording
from ecu.recording.rest import cool_discs
from ecu.recording.restored import restored
from ecu.recording.store import open_store, save
from ecu.settings.config import Config, config_hash, load_config, new_params, store_key


def replay(
    logs: Sequence[Path],
    config: Path,
    map: Path | None,
    observer: str | None,
    state: Path | None,
    out: Path,
    cycles: Path | None = None,
    force: bool = False,
    stood: float | None = None,
) -> None:
    """Replay `logs` as one drive into `out`, print the findings; arguments as `replay_into`.

    Raises:
        UserError: an argument, the configuration, the map or a log is not right.
        RunFault: the results are written, but no needed input was ever usable.
    """
    done = replay_into(logs, config, map, observer, state, out, cycles, force, stood, progress=True)
    for line in done.notes:
        say(line)
    _tell(done)
    give(notes=done.notes)
    if out.suffix in EXPORTS:
        wrote(out)
    else:
        page = argument(out.with_suffix(".html"))
        wrote(out, brakes_path(out), next=f"brake-ecu report {argument(out)} --out {page}")
    if nothing_usable(done.findings):
        names = ", ".join(group.name for group in NEEDED)
        raise RunFault(f"{out}: not one sample of the needed inputs was usable ({names})")


class Replayed(NamedTuple):
    """Files and findings of a replay."""

    writer: ResultWriter
    findings: list[Findings]
    notes: list[str]
    """On the map, the logs and the inputs, one line each."""
    nominal: Sequence[float]
    """Configured friction of each lining."""


def replay_into(
    logs: Sequence[Path],
    config: Path,
    map: Path | None,
    observer: str | None,
    state: Path | None,
    out: Path,
    cycles: Path | None = None,
    force: bool = False,
    stood: float | None = None,
    progress: bool = False,
) -> Replayed:
    """Replay `logs` as one drive into `out` (its folder is made) and `<name>.brakes.parquet`.

    Where physics contradicts a log, the drive is replayed once more with friction as it was before it, and
    nothing is stored; not with `force`, nor from recordings, which repeat what the ECU did.

    An `out` that ends in .mf4 or .mcap holds both, the latter the frames of the logs, too.

    `map` is a signal map (None: the ECU's own database), `state` the folder of the state store, `cycles` a
    recording that gives initial state, T_k and missed periods to an independent log of the same drive.
    `stood`: hours for which the car stood before, in which its discs cooled; None: nobody knows.
    `progress` shows a bar.

    Raises:
        UserError: an argument, the configuration, the map or a log is not right.
    """
    vehicle = with_observer(load_config(config), observer)
    _check(logs, out, cycles, stood)
    check_outputs(
        out,
        (out, brakes_path(out)),
        [*logs, *config_files(config), *([map] if map else []), *([cycles] if cycles else [])],
    )
    source = load_source(map)
    detail(f"{vehicle.name}, {vehicle.observer.kind}, {map or 'the database of the ECU'}")
    notes = [source.left_out] if source.left_out else []
    notes += [line for log in logs if map and (line := check_map(map, source, log))]
    recording = read_recording(cycles) if cycles else None
    params = new_params(vehicle)
    notes += [line for line in (radius_line(map, source, params[0]), delay_line(source, params[0])) if line]
    learned = _restore(state, vehicle, params, stood)
    before = new_state(params, learned)["learned"].tobytes()
    learns = force or recording is not None or any(kind_of(log) == "recording" for log in logs)
    size = sum(log_size(path) for path in logs)
    with (
        ResultWriter(out, params) as writer,
        progress_bar("replay", size, progress) as advance,
        ThreadPoolExecutor(1, "brake-ecu hashes logs") as side,
    ):
        inputs = side.submit(lambda: [{"name": path.name, "sha256": log_hash(path)} for path in logs])
        provenance = {
            "version": __version__,
            "vehicle": vehicle.name,
            "observer": vehicle.observer.kind,
            "config_hash": config_hash(vehicle),
            CAR: car_of(vehicle),
            "database_hash": source.database_hash,
            "inputs": inputs.result,
        }
        for again, findings in enumerate(runs(logs, params, learns)):
            writer.restart()
            heard = (lambda size: None) if again else advance
            after = _run(writer, findings, params, learned, source, provenance, heard, recording)
        wrong = contradiction_lines(findings)
        held = bool(wrong) and not learns
        writer.quality = [quality_counts(found, source.plan) for found in findings]
        writer.frames = drive_frames(findings)
        writer.pads = [] if after is None else pads_of(params, after, vehicle)
    if state and not held and after is not None and after.tobytes() != before:
        with closing(open_store(state)) as store:
            save(store, store_key(vehicle), after)
    notes = [*wrong, *([HELD] if held else []), *notes]
    notes += _notes(findings, source.plan, vehicle.observer.kind)
    return Replayed(writer, findings, notes, params[0]["mu_nominal"])


def _run(
    writer: ResultWriter,
    findings: Sequence[Findings],
    params: RecordArray,
    learned: RecordArray | None,
    source: Source,
    provenance: dict[str, Any],
    advance: Advance,
    recording: Recording | None,
) -> RecordArray | None:
    """Write the rows of a drive and return what is learned after it.

    `provenance`: for the writer, but a function that returns the logs' hashes, which are computed meanwhile.
    """
    writer.provenance = provenance.copy()

    def write(t: NDArray[np.float64], rows: NDArray[np.float64]) -> None:
        writer.provenance["inputs"] = provenance["inputs"]()
        if (began_ns := findings[0].began_ns) is not None:
            writer.provenance.setdefault("start_time_ns", str(began_ns))
        writer.write(t, rows)

    after = replay_drive(findings, params, learned, source, write, writer.brakes.end_log, advance, recording)
    writer.provenance["inputs"] = provenance["inputs"]()
    return after


def _check(logs: Sequence[Path], out: Path, cycles: Path | None, stood: float | None) -> None:
    if out.suffix not in (".parquet", *EXPORTS):
        remedy = f"results are Parquet, MDF4 or MCAP; let the name end in .parquet, {' or '.join(EXPORTS)}"
        raise UserError("--out", str(out), remedy)
    for log in logs:
        if not log.exists():
            raise UserError(str(log), "", "no such file; give an existing log")
        kind = kind_of(log)
        if stood is not None and (cycles or kind == "recording"):
            remedy = "a recording has the temperatures that its discs began with; leave --stood out"
            raise UserError("--stood", f"{stood:g}", remedy)
        if cycles and kind != "frames":
            raise UserError(
                str(log), "", "only a log of frames can take its cycles from a recording; leave --cycles out"
            )
    if cycles and len(logs) > 1:
        raise UserError("--cycles", str(cycles), "belongs to one log; replay the logs one by one")


def _restore(
    state: Path | None, vehicle: Config, params: RecordArray, stood: float | None
) -> RecordArray | None:
    found = restored(state, vehicle, params) if state else None
    learned = found[1] if found else None
    if stood is not None:
        learned = new_state(params, learned)["learned"].copy()
        cool_discs(learned, params, 3600.0 * stood)
    return learned


def _notes(findings: Sequence[Findings], plan: ReceivePlan, observer: str) -> list[str]:
    lines: list[str] = []
    for found in findings:
        about = (
            *(quality_lines(found, plan), needed_lines(found), request_line(found)),
            *(transducer_line(found, observer), lacking_line(found), fault_lines(found)),
        )
        flaws = (f"{found.path}: {line}" for line in found.physics.flaws)
        lines += chain(*about, flaws, [line for line in (found.calibrated, found.late) if line])
    return lines


def _tell(done: Replayed) -> None:
    writer, findings, _, nominal = done
    console = new_console(WIDTH)
    frames = sum(found.log.frames for found in findings)
    samples = sum(found.signals.samples for found in findings)
    give(result=writer.path, rows=writer.rows, frames=frames, samples=samples, brakes=writer.brakes.rows)
    give(prediction=prediction_errors(writer.brakes.rows))
    written = f"{writer.path}: {writer.rows} rows from {frames} frames and {samples} samples"
    if not any(has_pressure(found) for found in findings):
        print(f"no brakings and no friction: {NO_PRESSURE.partition(',')[0]} in this drive\n{written}")
        return
    brakings = writer.brakes.rows
    short = taps(brakings)
    last, before = listed(brakings, policy().level == Level.VERBOSE)
    if last:
        console.print(brakings_table(last, nominal))
    else:
        print("no braking in this drive")
    if before:
        print(f"{before} brakings before these are in {brakes_path(writer.path).name}; -v lists them too")
    if short:
        print(f"{short} applications shorter than {SHORT} s are in {brakes_path(writer.path).name} only")
    for line in prediction_lines(brakings):
        print(line)
    print(written)
