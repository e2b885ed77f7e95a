"""Check of machine, configuration and bus (`brake-ecu doctor`): every deficiency with its remedy.

The rights are requested in a separate process, so that the check changes nothing.
"""

import json
import os
import platform
import subprocess
import sys
import time
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from ecu import jit
from ecu.bus.channel import open_channel
from ecu.bus.freshness import NEVER, begin_cycle
from ecu.bus.load import received_load, sent_load
from ecu.bus.output_map import refuse_fd, transmit_plan
from ecu.bus.protocol import Channel
from ecu.bus.receive import Reception, new_reception, receive
from ecu.bus.receive_plan import ReceivePlan, accepted_ids
from ecu.bus.signal_map import receive_plan
from ecu.bus.transmit import TransmitPlan
from ecu.compiling import report_compiling
from ecu.contract.records import FRAME, INPUTS, new_record
from ecu.contract.signals import CYCLE_NS, INPUT_SIGNALS
from ecu.errors import UserError
from ecu.output import give, say
from ecu.recording.ring import RingReader
from ecu.runtime.memory import new_ecu
from ecu.runtime.warm_up import warm_up
from ecu.settings.config import config_of, load_config, new_params
from ecu.settings.resources import resource
from ecu.unit_lateness import VERBS, lateness_line, sure_lateness
from ecu.watch.daemons import running

LISTEN_S: Final = 2.0
SLEEPS: Final = 50
USUAL_BIT_RATE: Final = 500_000
FULL_BUS: Final = 0.5
"""Share of a bus that is left to these frames: the slowest of them still arrive in time, and others do."""
OPTIONAL: Final = {
    "VehicleSpeed": "the speed is that of the wheels",
    "WheelForce": "friction is estimated without measured forces",
    "Motor": "no motor brakes or drives, and nothing is learned of the mass",
    "HydraulicStatus": "the hydraulic unit counts as ready, its accumulator as full",
    "Ambient": "the ambient temperature is that of CONFIG, and it does not rain",
}
"""What holds without the frames of these inputs."""


UNIT_FOLDERS: Final = tuple(
    map(Path, ("/etc/systemd/system", "/run/systemd/system", "/usr/lib/systemd/system"))
)
UNIT_NEEDS: Final = ("Type=notify", "WatchdogSec=", "Restart=always", "ExecStopPost=")


class Check(NamedTuple):
    """One line of the table."""

    name: str
    good: bool
    found: str
    remedy: str = ""


def doctor(config: Path | None, map: Path | None, interface: str | None, channel: str | None) -> int:
    """Print every check; return 0 if all are good, 1 if not.

    Raises:
        UserError: configuration, map or database are not usable, or only one of the two defines a bus.
    """
    if (interface is None) != (channel is None):
        raise UserError("doctor", "-i, -c", "give both or none")
    plan = receive_plan(map, say)
    sending = transmit_plan(map, plan)
    if config is not None:
        refuse_fd(sending, load_config(config).can_fd, config)
    with report_compiling():
        checks = [*machine(), kernels(config, plan, sending), bus_load(interface, channel, plan, sending)]
    if interface is not None and channel is not None:
        say(f"listening to {channel} for {LISTEN_S:.0f} s")
        checks += bus(interface, channel, plan, config)
        checks += [hydraulics(RingReader(one.path)) for one in running() if one.on_bus(interface, channel)]
    _show(checks)
    give(checks=[check._replace(remedy="") if check.good else check for check in checks])
    return 0 if all(check.good for check in checks) else 1


def machine() -> list[Check]:
    """Check Python, the rights for real time, the clock and the cache of compiled kernels."""
    version = sys.version_info[:2]
    return [
        Check("Python", (3, 11) <= version <= (3, 14), platform.python_version(), "use Python 3.11 to 3.14"),
        *rights(),
        _clock_source(),
        _wake_up(),
        _cache(),
        unit(),
    ]


_ASK: Final = """
import structlog
structlog.configure(logger_factory=structlog.ReturnLoggerFactory())
from ecu.runtime.realtime import make_realtime
for verdict in make_realtime():
    print(verdict.name, int(verdict.granted), verdict.reason, verdict.remedy, sep="\\t")
"""


def rights() -> list[Check]:
    """Ask for the rights of real time."""
    paths = filter(None, (str(Path(jit.__file__).parents[1]), os.environ.get("PYTHONPATH")))
    asked = subprocess.run(
        [sys.executable, "-P", "-c", _ASK],  # not the `ecu` of a clone in which one stands
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
        check=False,
    )
    if asked.returncode:
        return [
            Check("real time", False, f"not checked: {asked.stderr.strip()[-200:]}", "mend the installation")
        ]
    verdicts = (line.split("\t") for line in asked.stdout.splitlines())
    return [
        Check(name, granted == "1", "granted" if granted == "1" else reason, remedy)
        for name, granted, reason, remedy in verdicts
    ]


def _clock_source() -> Check:
    source = Path("/sys/devices/system/clocksource/clocksource0/current_clocksource")
    name = source.read_text().strip() if source.exists() else "unknown"
    resolution_s = time.clock_getres(time.CLOCK_MONOTONIC)
    good = resolution_s <= 1e-6 and name not in ("jiffies", "refined-jiffies")
    return Check("clock", good, f"{name}, {resolution_s * 1e9:.0f} ns", "boot with another clocksource=")


def _wake_up() -> Check:
    """Sleep a few times without any rights: the lateness measured is the machine's load."""
    late_ns = []
    for _ in range(SLEEPS):
        deadline = time.monotonic_ns() + 2_000_000
        time.sleep(0.002)
        late_ns.append(time.monotonic_ns() - deadline)
    median, worst = float(np.median(late_ns)) / 1e3, max(late_ns) / 1e3
    return Check(
        "wake-up",
        median < CYCLE_NS / 1e3 / 10,
        f"{median:.0f} us late (median), {worst:.0f} us at worst",
        "take load off the machine",
    )


def _cache() -> Check:
    """Name numba's cache; whether it may be read-only, because it is complete, `kernels` finds."""
    folder = jit.CACHE_ROOT
    written = "can be written" if os.access(folder, os.W_OK) else "is read-only: nothing can be compiled"
    return Check("kernel cache", True, f"{folder} {written}")


def unit(folders: tuple[Path, ...] = UNIT_FOLDERS) -> Check:
    """Check the settings of an installed systemd unit that the daemon needs; point to ours if none."""
    ours = resource("tools/deploy/brake-ecu.service")
    installed = [path for folder in folders for path in sorted(folder.glob("brake-ecu*.service"))]
    if not installed:
        return Check("systemd unit", True, f"not installed; {ours} is one")
    for path in installed:
        lines = {line.partition("#")[0].strip() for line in path.read_text("utf-8").splitlines()}
        missing = [key for key in UNIT_NEEDS if not any(line.startswith(key) for line in lines)]
        if missing:
            found = f"{path} lacks {', '.join(missing)}"
            return Check("systemd unit", False, found, f"take them from {ours}")
    return Check("systemd unit", True, ", ".join(map(str, installed)))


def kernels(config: Path | None, plan: ReceivePlan, sending: TransmitPlan) -> Check:
    """Prepare every kernel; good if none had to be compiled."""
    compiled = jit.CompileCounter()
    began = time.monotonic()
    params = new_params(load_config(config or resource("config/suv.toml")))
    try:
        warm_up(new_ecu(params, None, plan, sending), compiled)
    except UserError as error:
        return Check("kernels", False, error.where, error.remedy)
    taken = jit.library_of("ecu.algorithm.step")
    source = "numba's cache" if taken is None else f"{taken.folder}, for {taken.processor}"
    found = f"from {source}; {compiled.count} compiled, ready after {time.monotonic() - began:.1f} s"
    return Check("kernels", compiled.count == 0, found, "they are cached now; a second look will find none")


def bus_load(interface: str | None, channel: str | None, plan: ReceivePlan, sending: TransmitPlan) -> Check:
    """Reckon what the frames sent and expected take of the bus at worst stuffing."""
    known = bit_rate(channel) if interface == "socketcan" and channel is not None else None
    rate = known or USUAL_BIT_RATE
    sends, receives = sent_load(sending), received_load(plan)
    share = (sends + receives) / rate
    found = f"{share:.0%} of {rate / 1e3:.0f} kbit/s{'' if known else ' (assumed)'} at worst"
    found += f": sends {sends / 1e3:.0f}, receives {receives / 1e3:.0f} kbit/s"
    remedy = "take a faster bus, longer periods in the map, or own_frames = false"
    return Check("bus load", share <= FULL_BUS, found, remedy)


def bit_rate(channel: str) -> int | None:
    """Return the nominal bit rate of a SocketCAN interface [bit/s], None where `ip` does not show it."""
    try:
        answer = subprocess.run(
            ["ip", "-details", "-json", "link", "show", channel], capture_output=True, check=True
        )
        return int(json.loads(answer.stdout)[0]["linkinfo"]["info_data"]["bittiming"]["bitrate"])
    except (OSError, subprocess.CalledProcessError, LookupError, ValueError):
        return None


def bus(interface: str, channel: str, plan: ReceivePlan, config: Path | None) -> list[Check]:
    """Listen for two seconds and check every message of the plan."""
    fd = load_config(config).can_fd if config else False
    opened = open_channel(interface, channel, receive_ids=accepted_ids(plan.messages), fd=fd)
    try:
        reception = listen(opened, plan, LISTEN_S)
        status = opened.status()
    finally:
        opened.close()
    off = "off" if status.bus_off else "error passive" if status.error_passive else "active"
    line = Check(
        f"bus {channel}", off == "active", off, "check wiring, termination, bit rate; ip -details link"
    )
    return [line, *messages(plan, reception, LISTEN_S)]


def hydraulics(reader: RingReader) -> Check:
    """Compare [hydraulics] with how late a running daemon has found the pressures behind its demands."""
    name, last = f"hydraulics of {reader.description['name']}", reader.newest()
    outputs = None if last is None else last["outputs"][0]
    if outputs is None or not np.isfinite([outputs[f"pressure_lateness_{verb}"] for verb in VERBS]).any():
        return Check(name, True, "lateness of pressures not learned in this run: an armed car has to brake")
    params = new_params(config_of(reader.description["configuration"], name))
    line = lateness_line(params[0], outputs)
    if not line:
        return Check(name, True, "pressures follow as [hydraulics] says")
    kept = reader.read(len(reader.ring.slots))
    zero = kept.beside["estimate"]["pressure_zero"]
    sure = sure_lateness(params[0], kept.records["outputs"], kept.beside["inputs"], zero)
    found, _, remedy = lateness_line(params[0], sure).rpartition(": ")
    if found:
        return Check(name, False, found, remedy)
    doubt = "not certain; to be, it needs two brakings in 24 s that agree, with all frames in time"
    return Check(name, True, f"{line.rpartition(': ')[0]}: {doubt}")


def listen(channel: Channel, plan: ReceivePlan, seconds: float) -> Reception:
    """Return the frames received in that time."""
    reception, inputs, frames = new_reception(plan), new_record(INPUTS), new_record(FRAME, 4096)
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        count = channel.drain(frames, 0)
        begin_cycle(inputs[0], time.time_ns(), CYCLE_NS)
        receive(plan, reception, frames, 0, count, inputs[0])
        time.sleep(0.01)
    return reception


def messages(plan: ReceivePlan, reception: Reception, seconds: float) -> list[Check]:
    """Judge each expected message by its reception."""
    return [
        _message(plan, expected, counters, seconds)
        for expected, counters in zip(plan.messages, reception.messages, strict=True)
        if not expected["foreign"]
    ]


def _message(plan: ReceivePlan, expected: np.void, counters: np.void, seconds: float) -> Check:
    name, first = str(expected["name"]), int(expected["first"])
    places = plan.signals["place"][first : first + int(expected["count"])]
    received, accepted = int(counters["received"]), int(counters["accepted"])
    if counters["stamp_ns"] == NEVER:
        without = {_without(place) for place in places.tolist()}
        if "" not in without:
            return Check(name, True, f"not seen, optional: {'; '.join(sorted(without))}")
        return Check(name, False, "not seen", "check its sender, the channel, --map")
    rate = f"{received / seconds:.0f}/s"
    wrong = {
        "checksum": int(counters["checksum_errors"]),
        "length": int(counters["length_errors"]),
        "sequence": int(counters["sequence_errors"]),
        "repeated": int(counters["repeated"]),
    }
    taken = {"late": int(counters["late"]), "gaps": int(counters["lost"])}
    rate += "".join(f", {count} {kind}" for kind, count in taken.items() if count)
    if accepted < received:
        kinds = ", ".join(f"{count} {kind}" for kind, count in wrong.items() if count)
        return Check(
            name, False, f"{rate}, {received - accepted} of {received} refused: {kinds}", "see its sender"
        )
    longest_ns = float(plan.expected["longest_ns"][places].max(initial=0.0))
    if longest_ns and received < int(seconds * 1e9 / longest_ns):
        return Check(name, False, f"{rate}, {1e9 / longest_ns:.1f}/s is the least", "is the bus overloaded?")
    return Check(name, True, f"{rate}, all accepted")


def _without(place: int) -> str:
    """Return what holds without an input, "": it is needed."""
    message = INPUT_SIGNALS[place].message
    return next((held for begin, held in OPTIONAL.items() if message.startswith(begin)), "")


def _show(checks: list[Check]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table("", "check", "found", "remedy", box=None, pad_edge=False)
    for check in checks:
        mark = "[green]ok[/]" if check.good else "[red]no[/]"
        table.add_row(mark, check.name, check.found, "" if check.good else check.remedy)
    Console(width=None if sys.stdout.isatty() else 120).print(table)
