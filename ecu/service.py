"""`brake-ecu run`: everything is prepared before READY, then nothing is compiled or allocated any more.

Configuration, learned values, kernels, bus, listening, ring and side process, rights: in that order.
Whatever is not the cycle (`ecu/cycle.py`) happens in the side process (`ecu/recorder.py`). It leaves in
order on SIGTERM and SIGINT.
"""

import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from types import FrameType
from typing import Any, Final, NamedTuple

import numba
import numpy as np
import structlog

from ecu import __version__
from ecu.bus.channel import Channel, open_channel
from ecu.bus.foreign import listen_before_send
from ecu.bus.signal_map import receive_plan
from ecu.bus.transmit import contract_transmit_plan
from ecu.clock import Grid, system_time
from ecu.config import Config, config_hash, load_config, new_params, store_key
from ecu.cycle import Ecu, Progress, Watch, cycle_once, new_ecu, send_farewell
from ecu.diagnostics.log import configure_logging
from ecu.diagnostics.restored import restored
from ecu.errors import RunFault, UserError
from ecu.jit import CompileCounter
from ecu.realtime import Verdict, make_realtime, settle
from ecu.recorder import interface_name, layout
from ecu.records import STAGES, RecordArray
from ecu.resources import resource
from ecu.ring import Ring, close_ring, create_ring, remove_ring, ring_path
from ecu.signals import CYCLE_NS, INPUT_SIGNALS, OUTPUT_SIGNALS
from ecu.standby import Standby, learned_by_first
from ecu.start import like_others
from ecu.step import STATE
from ecu.warm import warm_up

LISTEN_S: Final = 1.0
LOOK_AT_RECORDER_CYCLES: Final = 100
RECORDER_PATIENCE_S: Final = 30.0  # to write out the ring


class RunOptions(NamedTuple):
    """Arguments of `brake-ecu run`."""

    config: Path
    interface: str
    channel: str
    map: Path | None = None
    record: Path | None = None
    state: Path | None = None
    standby: bool = False


class Session(NamedTuple):
    """Everything that a run holds open."""

    ecu: Ecu
    channel: Channel
    ring: Ring
    recorder: "subprocess.Popen[str]"
    verdicts: list[Verdict]
    compiled: CompileCounter
    standby: Standby | None


def _prepare(options: RunOptions) -> Session:
    compiled = CompileCounter(like_others)  # minutes of compiling are not worth anyone's standing still
    config = load_config(options.config)
    receiving = receive_plan(options.map)
    sending = contract_transmit_plan(resource("dbc/brake_ecu.dbc"), "BrakeEcu")
    params = new_params(config)
    description = _describe(options, config)
    path = ring_path(os.getpid())
    channel = open_channel(
        options.interface,
        options.channel,
        receive_ids=[*receiving.ids.tolist(), *sending.ids.tolist()],
        fd=config.can_fd,
    )
    began = time.monotonic()  # what comes from here on waits in the channel and is listened to below
    recorder = _start_recorder(path, options)
    try:
        learned = _restored(options.state, config, params)
        if options.standby:
            from_first = learned_by_first(description, params["mu_nominal"][0])
            learned = learned if from_first is None else from_first
        ecu = new_ecu(params, learned, receiving, sending)
        warm_up(ecu, compiled)
        settle()  # here it costs nothing: whoever does not stand by listens for a second all the same
        warm_s = time.monotonic() - began
        if not options.standby:
            where = f"{options.interface} {options.channel}"
            listen_before_send(channel, where, sending, LISTEN_S - warm_s)
        ring = create_ring(path, description, ecu.state.tobytes())
        _await_recorder(recorder)
    except BaseException:
        remove_ring(path)
        recorder.kill()
        channel.close()
        raise
    verdicts = make_realtime()
    structlog.get_logger("ecu").info(
        "ready",
        channel=options.channel,
        armed=config.transmit,
        standby=options.standby,
        warm_up_s=round(warm_s, 2),
        compiled=compiled.count,
        realtime={verdict.name: verdict.granted for verdict in verdicts},
        ring=str(path),
    )
    _notify("READY=1")
    return Session(ecu, channel, ring, recorder, verdicts, compiled, Standby() if options.standby else None)


def _restored(folder: Path | None, config: Config, params: RecordArray) -> RecordArray | None:
    """Return what was learned before, None if there is nothing to go by."""
    if folder is None:
        return None
    found = restored(folder, config, params)
    if found is None:
        return None
    revision, learned = found
    structlog.get_logger("ecu").info(
        "restored", revision=revision, mu_b=learned["mu_b"][0].tolist(), brakings=int(learned["brakings"][0])
    )
    return learned


def _describe(options: RunOptions, config: Config) -> dict[str, Any]:
    """Return what a recording says of itself."""
    return {
        "name": config.name,
        "channel": interface_name(options.channel),
        "interface": options.interface,
        "start_ns": time.time_ns(),
        "period_ns": CYCLE_NS,
        "config": str(options.config),
        "map": None if options.map is None else str(options.map),
        "config_hash": config_hash(config),
        "store_key": store_key(config),
        "versions": {
            "brake-ecu": __version__,
            "python": ".".join(map(str, sys.version_info[:3])),
            "numpy": np.__version__,
            "numba": numba.__version__,
        },
        "units": {signal.name: signal.unit for signal in OUTPUT_SIGNALS},
        "input_units": {signal.name: signal.unit for signal in INPUT_SIGNALS},
        "state": layout(STATE),
    }


def _start_recorder(ring: Path, options: RunOptions) -> "subprocess.Popen[str]":
    """Start the side process, which loads while we do."""
    command = [sys.executable, "-m", "ecu.recorder", "--ring", str(ring), "--parent", str(os.getpid())]
    for name in ("record", "state"):
        folder = getattr(options, name)
        if folder is not None:
            command += [f"--{name}", str(folder)]
    package = str(Path(__file__).parent.parent)
    paths = [package, *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    return subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
    )


def _await_recorder(recorder: "subprocess.Popen[str]") -> None:
    """Let the side process open the ring and what it writes.

    Raises:
        UserError: it could not.
    """
    assert recorder.stdin is not None
    assert recorder.stdout is not None
    with suppress(BrokenPipeError):  # it ended: no answer comes either
        recorder.stdin.write("go\n")
        recorder.stdin.close()
    answer = recorder.stdout.readline().strip()
    recorder.stdout.close()
    if answer != "ready":
        recorder.wait()
        raise UserError("", "", answer or "the side process did not start; see the line before")


def _notify(state: str) -> None:
    """Tell the service manager, if there is one that asked; one that is gone does not stop the brakes."""
    address = os.environ.get("NOTIFY_SOCKET")
    if not address:
        return
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as notify:
            notify.sendto(state.encode(), "\0" + address[1:] if address.startswith("@") else address)
    except OSError as error:
        structlog.get_logger("ecu").warning(
            "not_notified", reason=str(error), remedy=f"NOTIFY_SOCKET is {address}: unset it or mend it"
        )


def run(options: RunOptions) -> int:
    """Run the ECU on a bus until a signal comes; return the exit code 0.

    Raises:
        UserError: bad arguments or configuration, a bus that cannot be opened, or someone else already sends
            one of our frames.
        RunFault: no frame that the ECU knows came in the whole run, or the bus was off at its end.
    """
    configure_logging()
    stopping: list[int] = []

    def stop(number: int, frame: FrameType | None) -> None:
        stopping.append(number)

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, stop)
    session = _prepare(options)
    try:
        progress = _cycle_until(session, stopping)
        if progress.speaks:
            send_farewell(session.ecu, session.channel, progress.number)
        off = session.channel.status().bus_off
    finally:
        _leave(session)
    if not progress.number:  # stopped before the first cycle
        return 0
    _summarise(progress)
    where = f"{options.interface} {options.channel}"
    if off:
        raise RunFault(f"{where}: the bus was off at the end: check wiring, bit rate and ip -details link")
    if not int(session.ecu.reception.messages["received"].sum()):
        raise RunFault(f"{where}: no frame of the database came in: check channel, bit rate and --map")
    return 0


def _cycle_until(session: Session, stopping: list[int]) -> Progress:
    ecu, channel, ring, recorder, _, compiled, standby = session
    progress = Progress(Watch(channel.status(), compiled), standby)
    grid = Grid(system_time())
    recorder_lives, spoke = True, progress.speaks
    while not stopping:
        cycle_once(ecu, channel, ring, grid, progress)
        if progress.speaks != spoke:
            spoke = progress.speaks
            structlog.get_logger("ecu").warning(
                "takes_over" if spoke else "falls_silent", cycle=progress.number
            )
        if recorder_lives and progress.number % LOOK_AT_RECORDER_CYCLES == 0 and recorder.poll() is not None:
            recorder_lives = False
            structlog.get_logger("ecu").error(
                "recorder_gone",
                exit_code=recorder.returncode,
                remedy="nothing is recorded or learned for good until a restart",
            )
    return progress


def _leave(session: Session) -> None:
    _notify("STOPPING=1")
    close_ring(session.ring)
    session.channel.close()
    try:
        session.recorder.wait(RECORDER_PATIENCE_S)
    except subprocess.TimeoutExpired:
        structlog.get_logger("ecu").error(
            "recorder_hangs", pid=session.recorder.pid, remedy="look at its disk"
        )
    remove_ring(session.ring.path)


def _summarise(progress: Progress) -> None:
    lateness = progress.timing.lateness
    structlog.get_logger("ecu").info(
        "stopped",
        cycles=progress.number,
        missed=progress.overruns,
        lateness_us={
            **{f"p{100 * share:g}": _us(lateness.quantile(share)) for share in (0.5, 0.99, 0.999)},
            "max": _us(lateness.moments.maximum),
            "mean": _us(lateness.moments.mean),
            "deviation": _us(lateness.moments.deviation),
        },
        stages_us={
            name: {
                "p50": _us(times.quantile(0.5)),
                "p99": _us(times.quantile(0.99)),
                "max": _us(times.moments.maximum),
            }
            for name, times in zip(STAGES, progress.timing.stages, strict=True)
        },
    )


def _us(duration_ns: float) -> float:
    return round(duration_ns / 1e3, 1)
