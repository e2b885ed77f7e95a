"""Time of replaying a drive from a log of every format, beside python-can, cantools, asammdf and numpy.

Ten minutes of closed loop (config/scenarios/ordinary.toml) are written as a log of every format by
python-can's and asammdf's writers. Programs in Python get its first 20 s, whose time per frame is
representative.
"""

import contextlib
import io
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import can
import numpy as np
from asammdf import MDF

from brakelab.bench.log_formats import FORMATS, convert
from brakelab.bench.python_ecu import PythonEcu
from brakelab.bench.step import run_steps
from brakelab.logs.candump_text import candump_text
from brakelab.logs.formats import read_frames
from brakelab.logs.log_quality import LogQuality
from brakelab.replay.command import replay
from brakelab.results.text_table import Table
from brakelab.simulation.closed_loop import VEHICLE_BUS, new_loop, run
from brakelab.simulation.configured import configured, shipped
from brakelab.studies.accuracy.table import time_table
from brakelab.studies.measure import Figure, Row, Task, alternate, installed, machine
from brakelab.studies.study import Asked, Measured, Study
from ecu.algorithm.step import new_state
from ecu.bus.freshness import begin_cycle, end_cycle
from ecu.bus.receive import new_reception, receive
from ecu.bus.receive_plan import ReceivePlan, contract_receive_plan
from ecu.contract.records import INPUTS, OUTPUTS, RecordArray, new_record
from ecu.contract.signals import CYCLE_NS
from ecu.settings.config import new_params
from ecu.settings.resources import resource

ROUNDS: Final = 3
SCENARIO: Final = "ordinary"
PART_S: Final = 20.0
"""Length of drive for the programs in Python [s]."""
LONGEST_THREAD: Final = "candump: the longest thread"
_DBC: Final = "dbc/brake_ecu.dbc"
_NAMES: Final = {".log": "candump", ".asc": "ASC", ".blf": "BLF", ".trc": "TRC", ".mf4": "MDF4"}


def _task(work: Callable[[], object], items: int, clock: Callable[[], int] = time.process_time_ns) -> Task:
    """Return the task that times `work` over `items`: by `clock`, processor time [µs an item]."""

    def task() -> float:
        start = clock()
        work()
        return (clock() - start) / (1e3 * items)

    return task


def _blocks(log: Path) -> Iterator[RecordArray]:
    return read_frames(log, [], LogQuality())


def _decode(log: Path, plan: ReceivePlan) -> None:
    reception, inputs = new_reception(plan), new_record(INPUTS)
    inputs["t_ns"] = np.iinfo(np.int64).max
    for block in _blocks(log):
        receive(plan, reception, block, 0, len(block), inputs[0])


def _replay(log: Path, out: Path) -> None:
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        replay([log], resource("config/suv.toml"), None, None, None, out)


def _messages(log: Path) -> Iterator[can.Message]:
    options: Any = {"relative_timestamp": False} if log.suffix == ".asc" else {}
    yield from can.LogReader(log, **options)


def _python_decode(log: Path, ecu: PythonEcu) -> None:
    for message in _messages(log):
        if message.arbitration_id in ecu.known:
            ecu.receive([message])


def _python_replay(log: Path, ecu: PythonEcu) -> None:
    due = None
    for message in _messages(log):
        due = message.timestamp if due is None else due
        while message.timestamp > due:
            if "decel_demand" in ecu.latest and "vehicle_speed" in ecu.latest:
                ecu.step()
            due += 1e-9 * CYCLE_NS
        if message.arbitration_id in ecu.known:
            ecu.receive([message])


def _asammdf_decode(log: Path) -> None:
    with MDF(log) as mdf:
        database: Any = {"CAN": [(str(resource(_DBC)), 0)]}
        mdf.extract_bus_logging(database_files=database).close()


def _asammdf_read(log: Path) -> None:
    unindexed: Any = MDF
    with unindexed(log, process_bus_logging=False) as mdf:
        mdf.get("CAN_DataFrame", group=0, raw=True)


def _inputs_of_cycles(log: Path) -> RecordArray:
    """Return the inputs of `step` in every cycle of a drive, shape (cycles,)."""
    plan = contract_receive_plan(resource(_DBC))
    reception, inputs = new_reception(plan), new_record(INPUTS)
    frames = np.concatenate(list(_blocks(log)))
    start_ns, cursor = int(frames["stamp_ns"][0]), 0
    cycles = new_record(INPUTS, (int(frames["stamp_ns"][-1]) - start_ns) // CYCLE_NS + 1)
    for k in range(len(cycles)):
        begin_cycle(inputs[0], start_ns + k * CYCLE_NS, CYCLE_NS)
        cursor = receive(plan, reception, frames, cursor, len(frames), inputs[0])
        end_cycle(inputs[0], reception.freshness)
        cycles[k] = inputs[0]
    return cycles


def _step(cycles: RecordArray, params: RecordArray) -> None:
    run_steps(params, new_state(params), cycles, new_record(OUTPUTS))


def _rows(tasks: dict[str, tuple[Task, Task | None, str, str]], rounds: int) -> list[Row]:
    """Measure by name: (ours, the peer's, unit, note)."""
    flat = [task for ours, peer, _, _ in tasks.values() for task in (ours, peer) if task is not None]
    figures: Iterator[Figure] = iter(alternate(rounds, flat))
    return [
        Row(what, next(figures), None if peer is None else next(figures), unit, note)
        for what, (_, peer, unit, note) in tasks.items()
    ]


def replay_tables(rounds: int = ROUNDS, scenario: str = SCENARIO, part_s: float = PART_S) -> list[Table]:
    """Return the tables: from bytes to frames and signals, and whole replays."""
    with tempfile.TemporaryDirectory(prefix="brake-ecu-") as name:
        return _tables(Path(name), rounds, scenario, part_s)


def _write(log: Path, frames: RecordArray) -> dict[str, Path]:
    """Write a log in every format; return the paths by suffix."""
    log.write_bytes(candump_text(frames, VEHICLE_BUS))
    return {end: log if end == ".log" else convert(log, log.with_suffix(end)) for end in FORMATS}


def _tables(folder: Path, rounds: int, scenario: str, part_s: float) -> list[Table]:
    config = configured()
    drive = run(new_loop(shipped(scenario), config, 0))
    frames, cycles = drive.frames, len(drive.t)
    part = frames[frames["stamp_ns"] < frames["stamp_ns"][0] + round(part_s * 1e9)]
    part_cycles = min(cycles, round(part_s * 1e9) // CYCLE_NS)
    logs, parts = _write(folder / "drive.log", frames), _write(folder / "part.log", part)
    params = new_params(config)
    whole, few, out = len(frames), len(part), folder / "out.parquet"
    bus, codec, mdf = installed("python-can"), installed("cantools"), installed("asammdf")

    plan = contract_receive_plan(resource(_DBC))
    ecu = PythonEcu(None, params, (0,))  # type: ignore[arg-type]

    reading: dict[str, tuple[Task, Task | None, str, str]] = {}
    for end, log in logs.items():
        ours = _task(lambda log=log: sum(map(len, _blocks(log))), whole)  # type: ignore[misc]
        if end == ".mf4":
            peer, note = _task(lambda: _asammdf_read(logs[".mf4"]), whole), f"{mdf}, all records at once"
        else:
            peer = _task(lambda log=parts[end]: sum(1 for _ in _messages(log)), few)  # type: ignore[misc]
            note = bus
        reading[f"{_NAMES[end]}: frames"] = (ours, peer, "µs", note)
    reading["candump: signals"] = (
        _task(lambda: _decode(logs[".log"], plan), whole),
        _task(lambda: _python_decode(parts[".log"], ecu), few),
        "µs",
        f"{bus}, {codec}",
    )
    reading["MDF4: signals"] = (
        _task(lambda: _decode(logs[".mf4"], plan), whole),
        _task(lambda: _asammdf_decode(parts[".mf4"]), few),
        "µs",
        f"{mdf}, extract_bus_logging",
    )
    replays: dict[str, tuple[Task, Task | None, str, str]] = {}
    for end, log in logs.items():
        ours = _task(lambda log=log: _replay(log, out), cycles)  # type: ignore[misc]
        other, note = None, mdf
        if end != ".mf4":
            note = f"{bus}, {codec}, numpy: four filters only"
            other = _task(lambda log=parts[end]: _python_replay(log, ecu), part_cycles)  # type: ignore[misc]
        replays[_NAMES[end]] = (ours, other, "µs", note)
    longest = _task(lambda: _replay(logs[".log"], out), cycles, time.thread_time_ns)
    replays[LONGEST_THREAD] = (longest, None, "µs", "the bound where cores are free")
    steps = _inputs_of_cycles(logs[".log"])
    replays["step alone"] = (_task(lambda: _step(steps, params), len(steps)), None, "µs", "the bound")
    read_rows, replay_rows = _rows(reading, rounds), _rows(replays, rounds)
    return [
        time_table("from bytes to frames and signals", read_rows, _below_reading(read_rows, whole)),
        time_table("whole replays", replay_rows, _below_replays(replay_rows)),
    ]


def _below_reading(rows: list[Row], frames: int) -> str:
    by_name = {row.what: row.ours.median for row in rows}
    return (
        f"Processor time of a frame, {frames} frames of the contract. Signals: with CRC, counter and "
        "freshness, the peers without. candump gives "
        f"{1 / by_name['candump: signals']:.1f} million frames a second as signals; frames of BLF take "
        f"{by_name['BLF: frames'] / by_name['candump: frames']:.1f}, of MDF4 "
        f"{by_name['MDF4: frames'] / by_name['candump: frames']:.1f} times as long as those of candump. "
        f"Peers but `get` of asammdf: the first {PART_S:.0f} s, scaled."
    )


def _below_replays(rows: list[Row]) -> str:
    seconds = 1e-9 * CYCLE_NS
    speed = {row.what: seconds / (1e-6 * row.ours.median) for row in rows}
    share = 100.0 * next(row.ours.median for row in rows if row.what == "step alone")
    share /= next(row.ours.median for row in rows if row.what == "candump")
    shown = ", ".join(f"{name} {times:.0f}" for name, times in speed.items() if name in _NAMES.values())
    return (
        "Processor time of 10 ms of the drive, on one core: everything that `brake-ecu replay` does, in a "
        "process that has started and knows the contract's database: configuration, SHA-256 of the log, "
        f"reading, decoding, step, results in Parquet, the table. Times real time: {shown}; candump "
        f"at most {speed[LONGEST_THREAD]:.0f} where reading, hash and Parquet have their own cores. "
        f"The step alone takes {share:.0f} % of a replay of candump. The peer reads the first "
        f"{PART_S:.0f} s: no CRC, no counter, no time-out, four filters, no results."
    )


TEXT: Final = (
    "One drive of ten minutes in closed loop (config/scenarios/ordinary.toml) as a log of every format, "
    "written by python-can and asammdf."
)


def _run(asked: Asked) -> Measured:
    return Measured(replay_tables(), f". {machine()}")


STUDY: Final = Study("Speed of replay", TEXT, _run, "replay-speed")
