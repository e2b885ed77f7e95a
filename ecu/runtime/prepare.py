"""Preparation of `run` until READY: afterwards nothing is compiled, allocated, started or logged.

Configuration, bus, side process, learned values, kernels, listening, ring, rights: in that order. A signal
ends it at any time (`start.left_at_once`). Listening lasts a whole second after the kernels are ready,
without frames that waited meanwhile.
"""

import os
import sys
import time
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import structlog

from ecu import __version__
from ecu.algorithm.step import INITIAL, initial_part
from ecu.bus.addresses import check_ipv4
from ecu.bus.channel import open_channel
from ecu.bus.e2e import NO_CHECKSUM
from ecu.bus.foreign import KNOWN_BY, discard, listen_before_send
from ecu.bus.output_map import refuse_fd, transmit_plan
from ecu.bus.protocol import Channel
from ecu.bus.receive_plan import accepted_ids, messages_by_contract
from ecu.bus.signal_map import receive_plan
from ecu.bus.transmit import TransmitPlan, compile_transmit
from ecu.contract.records import RecordArray
from ecu.contract.signals import CYCLE_NS, INPUT_SIGNALS, OUTPUT_SIGNALS
from ecu.errors import UserError
from ecu.jit import CompileCounter, compiler_version
from ecu.recording.recorder import interface_name, layout
from ecu.recording.restored import restored
from ecu.recording.revisions import DAMAGED
from ecu.recording.ring import Ring, create_ring, remove_ring, ring_path
from ecu.runtime import diagnostics, xcp
from ecu.runtime.memory import Ecu, new_ecu
from ecu.runtime.notify import Manager
from ecu.runtime.realtime import PRIORITY, check_cpu, freeze_memory, make_realtime
from ecu.runtime.side import Side
from ecu.runtime.standby import learned_by_first
from ecu.runtime.start import lower_priority
from ecu.runtime.warm_up import warm_up
from ecu.runtime.xcp import Calibrating
from ecu.settings.config import Config, config_files, config_hash, load_config, new_params, store_key

LISTEN_S: Final = 1.0
TELL_PROGRESS_S: Final = 5.0
SILENCE: Final = compile_transmit([])
"""What a silent run sends."""


class RunOptions(NamedTuple):
    """Arguments of `brake-ecu run`."""

    config: Path
    interface: str
    channel: str
    map: Path | None = None
    record: Path | None = None
    record_limit: float | None = None
    """GB of all recordings in `record`."""
    state: Path | None = None
    standby: bool = False
    armed: bool = False
    """Whatever the configuration says."""
    silent: bool = False
    """A shadow that sends nothing."""
    metrics: str | None = None
    """ADDRESS:PORT on which metrics are served."""
    diagnostics: str | None = None
    """Identifiers REQUEST:RESPONSE[:ALL] on which a tester is answered."""
    diagnostics_key: Path | None = None
    """File of the secret by which a tester gets access."""
    xcp: str | None = None
    """Transport on which a master of XCP is answered."""
    calibrating: Calibrating = Calibrating()
    """What it needs to calibrate."""
    cpu: int | None = None
    """To be pinned to; None: the last one that no other daemon has."""
    priority: int = PRIORITY
    """Of SCHED_FIFO."""


class Session(NamedTuple):
    """Resources held open by a run."""

    ecu: Ecu
    channel: Channel
    ring: Ring
    side: Side
    compiled: CompileCounter
    waits: bool
    """A standby, or a silent run: it hears no first one, as it has no frames."""
    manager: Manager


class CompileProgress:
    """Report that kernels are being compiled, and the progress; silent once it `is_over`."""

    def __init__(self, manager: Manager) -> None:
        self._manager, self._reported_s, self.is_over = manager, 0.0, False

    def __call__(self, count: int) -> None:
        """Note that another compilation begins after `count`."""
        now_s = time.monotonic()
        if self.is_over or (count and now_s - self._reported_s < TELL_PROGRESS_S):
            return
        if not count:
            lower_priority()  # minutes of compiling are not worth anyone's standing still
        self._reported_s = now_s
        self._manager.tell(f"STATUS=compiling kernels, {count} done")
        structlog.get_logger("ecu").info(
            "compiling",
            done=count,
            lasts="one to four minutes, once per version",
            remedy="python -m ecu.warm compiles beforehand",
        )


def prepare(options: RunOptions) -> Session:
    """Return all resources of the cycle.

    Raises:
        UserError: bad arguments or configuration, a bus that cannot be opened, or someone else already sends
            one of our frames.
    """
    if options.metrics is not None:
        _check_metrics(options.metrics)
    if options.silent and (options.armed or options.standby):
        raise UserError("--silent", "", "sends nothing, so it is neither armed nor a standby; leave one out")
    check_cpu(options.cpu)
    manager = Manager()
    progress = CompileProgress(manager)
    compiled = CompileCounter(progress)
    config = load_config(options.config)
    if options.armed or options.silent:
        config = config.model_copy(update={"transmit": options.armed})
    log = structlog.get_logger("ecu")
    receiving = receive_plan(options.map, lambda line: log.warning("database", left_out=line))
    sending = SILENCE if options.silent else transmit_plan(options.map, receiving)
    _check_sending(options, config, sending)
    heard = accepted_ids(receiving.messages)
    side_arguments = _side_arguments(options, {*heard, *sending.ids.tolist()})
    params = new_params(config)
    description = _describe(options, config)
    if options.map is not None:
        description["messages"] = messages_by_contract(receiving)
    log.debug(
        "read",
        **{key: description[key] for key in ("name", "config", "config_hash", "map", "versions")},
        observer=config.observer.kind,
        messages=[str(message["name"]) for message in receiving.messages],
    )
    path = ring_path(os.getpid())
    remove_ring(path)  # of an earlier process with our id: the side process takes the one that appears
    channel = open_channel(
        options.interface,
        options.channel,
        receive_ids=[*heard, *sending.ids.tolist()],
        fd=config.can_fd,
    )
    began = time.monotonic()
    side = Side(path, side_arguments)
    try:
        learned = _restored(options.state, config, params)
        if options.standby:
            from_first = learned_by_first(description, params["mu_nominal"][0])
            learned = learned if from_first is None else from_first
        ecu = new_ecu(params, learned, receiving, sending)
        warm_up(ecu, compiled)
        progress.is_over = True
        freeze_memory()
        warm_s = time.monotonic() - began
        discard(channel)
        if not (options.standby or options.silent):
            stray = listen_before_send(channel, f"{options.interface} {options.channel}", sending, LISTEN_S)
            if stray:
                log.warning(
                    "stray_frames", count=stray, remedy="someone sent identifiers of ours; look for it"
                )
        ring = create_ring(path, description, initial_part(ecu.state).tobytes())
        side.await_ready()
    except BaseException:
        side.abandon()
        remove_ring(path)
        channel.close()
        raise
    verdicts = make_realtime(options.cpu, options.priority)
    structlog.get_logger("ecu").info(
        "ready",
        channel=options.channel,
        armed=config.transmit,
        standby=options.standby,
        silent=options.silent,
        warm_up_s=round(warm_s, 2),
        compiled=compiled.count,
        realtime={verdict.name: verdict.granted for verdict in verdicts},
        ring=str(path),
    )
    if not manager.tell("READY=1"):
        structlog.get_logger("ecu").warning(
            "not_notified", remedy=f"NOTIFY_SOCKET is {os.environ['NOTIFY_SOCKET']}: unset it or mend it"
        )
    return Session(ecu, channel, ring, side, compiled, options.standby or options.silent, manager)


def _check_sending(options: RunOptions, config: Config, sending: TransmitPlan) -> None:
    """Raise UserError for a map's messages that this run cannot send."""
    refuse_fd(sending, config.can_fd, options.config)
    if options.standby and np.count_nonzero(sending.messages["rule"] != NO_CHECKSUM) < KNOWN_BY:
        remedy = (
            f"knows the first one by {KNOWN_BY} messages with a checksum; set own_frames = true in the map"
        )
        raise UserError("--standby", "", remedy)


def _check_metrics(place: str) -> None:
    """Raise UserError for metrics that can never be served at `place`, ADDRESS:PORT."""
    if find_spec("prometheus_client") is None:
        install = f"{sys.executable} -m pip install prometheus-client"
        raise UserError("--metrics-port", "", f"needs prometheus-client: {install}")
    address = place.rpartition(":")[0]
    check_ipv4("--metrics-address", address, address)


def _restored(folder: Path | None, config: Config, params: RecordArray) -> RecordArray | None:
    """Return the values learned before, None without usable ones: the side process logs the reason."""
    if folder is None:
        return None
    try:
        found = restored(folder, config, params, time.time())
    except (UserError, *DAMAGED):
        return None
    if found is None:
        return None
    revision, learned = found
    structlog.get_logger("ecu").info(
        "restored", revision=revision, mu_b=learned["mu_b"][0].tolist(), brakings=int(learned["brakings"][0])
    )
    return learned


def _describe(options: RunOptions, config: Config) -> dict[str, Any]:
    """Return the description stored with a recording."""
    return {
        "name": config.name,
        "channel": interface_name(options.channel),
        "interface": options.interface,
        "start_ns": time.time_ns(),
        "period_ns": CYCLE_NS,
        "config": str(options.config),
        "map": None if options.map is None else str(options.map),
        "config_hash": config_hash(config),
        "configuration": config.model_dump(),
        "armed": config.transmit,
        "store_key": store_key(config),
        "versions": {
            "brake-ecu": __version__,
            "python": ".".join(map(str, sys.version_info[:3])),
            "numpy": np.__version__,
            "numba": compiler_version(),
        },
        "units": {signal.name: signal.unit for signal in OUTPUT_SIGNALS},
        "input_units": {signal.name: signal.unit for signal in INPUT_SIGNALS},
        "state": layout(INITIAL),
    }


def _side_arguments(options: RunOptions, taken: set[int]) -> list[str]:
    """Return the arguments of the side processes; `taken`: identifiers of messages. Raises UserError."""
    bus = options.interface, options.channel
    given = {
        "--record": options.record,
        "--record-limit": options.record_limit,
        "--state": options.state,
        "--standby": options.standby or None,
        "--metrics": options.metrics,
        "--diagnostics": diagnostics.checked_settings(
            *bus, options.diagnostics, options.diagnostics_key, taken, options.silent
        ),
        "--xcp": xcp.checked_settings(
            options.xcp,
            *bus,
            taken | diagnostics.identifiers(options.diagnostics),
            options.silent,
            options.calibrating,
            config_files(options.config),
        ),
    }
    return [word for name, value in given.items() if value is not None for word in (name, str(value))]
