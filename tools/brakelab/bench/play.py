"""Lateness of frames on a bus: `brake-ecu play` beside canplayer and python-can, at several speeds.

All play the same log one after another, with the same real-time rights. Arrival times are kernel stamps of a
socket of the bench's own.
"""

import json
import os
import select
import shutil
import socket
import struct
import subprocess
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, NamedTuple

import can
import numpy as np
from can.interfaces.udp_multicast.utils import unpack_message
from numpy.typing import NDArray

from brakelab.replay.quality import Findings
from brakelab.results.text_table import Table
from brakelab.results.verdict import Goal, verdict
from brakelab.rig.live import Bus, choose_bus
from brakelab.rig.play.command import Sent, send_on_schedule
from brakelab.rig.play.play_log import timed_frames
from brakelab.simulation.priority import PRIORITY, ask_for_priority
from brakelab.studies.measure import installed, machine
from brakelab.studies.study import Asked, Measured, Study
from ecu.runtime.clock import system_time
from ecu.runtime.warm_up import Silence

SPEEDS: Final = (0.1, 1.0, 5.0, 20.0)
GOAL_US: Final = 100
SHARES: Final = (0.5, 0.99, 0.999, 1.0)
SEED: Final = 1
FRAME_US: Final = 250
"""Eight bytes on a bus of 500 kbit/s."""
PERIODS_MS: Final = {10: 8, 20: 10, 50: 10, 100: 12}
"""How many identifiers have which period: 1620 frames a second, 40 % of such a bus."""
JITTER: Final = 0.1  # of a period
PORT: Final = 43113  # python-can's, of UDP multicast
QUIET_S: Final = 0.3
BUFFER: Final = 64 << 20  # bytes: on a single-core machine nobody listens while a player keeps it busy

_SO_RCVBUFFORCE, _SO_TIMESTAMPNS, _IP_MULTICAST_ALL = 33, 35, 49  # asm-generic/socket.h, linux/in.h


def bus_times(seconds: float) -> NDArray[np.int64]:
    """Return the start times of the frames of a busy bus [us], one after another, shape (n,)."""
    draw = np.random.default_rng(SEED)
    wanted = []
    for period_ms, identifiers in PERIODS_MS.items():
        period = 1000 * period_ms
        regular = np.arange(0.0, 1e6 * seconds, period) + draw.uniform(0, period, (identifiers, 1))
        wanted.append((regular + draw.uniform(0, JITTER * period, regular.shape)).ravel())
    wanted_us = np.sort(np.concatenate(wanted)).astype(np.int64)
    free = FRAME_US * np.arange(len(wanted_us))
    times: NDArray[np.int64] = np.maximum.accumulate(wanted_us - free) + free
    return times[times < 1e6 * seconds]


def write_log(path: Path, times_us: NDArray[np.float64] | NDArray[np.int64], channel: str) -> None:
    """Write a candump log; each frame carries its number."""
    lines = [
        f"({1_600_000_000 + round(t) // 1_000_000}.{round(t) % 1_000_000:06d}) {channel} "
        f"{0x100 + number % 40:03X}#{number.to_bytes(8, 'big').hex().upper()}\n"
        for number, t in enumerate(times_us.tolist())
    ]
    path.write_text("".join(lines), encoding="ascii")


class Listener:
    """A socket on the bus whose frames the kernel stamps."""

    def __init__(self, bus: Bus) -> None:
        self._multicast = bus.interface == "udp_multicast"
        if self._multicast:
            self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
            self._socket.setsockopt(socket.IPPROTO_IP, _IP_MULTICAST_ALL, 0)  # no frames of other groups
            self._socket.bind(("", PORT))
            group = socket.inet_aton(bus.channel) + socket.inet_aton("0.0.0.0")
            self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group)
        else:
            self._socket = socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
            self._socket.bind((bus.channel,))
        with suppress(PermissionError):
            self._socket.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, BUFFER)
        self._socket.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
        self._socket.setblocking(False)

    def wait(self) -> None:
        """Wait for a frame."""
        select.select([self._socket], [], [])

    def hear(self, player: "subprocess.Popen[str]") -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Listen until `player` has ended; return numbers and stamps [ns] of its frames, in their order."""
        heard: list[tuple[bytes, bytes]] = []
        while True:
            ended = player.poll() is not None
            if not select.select([self._socket], [], [], QUIET_S)[0] and ended:
                break
            with suppress(BlockingIOError):
                while True:
                    content, [(_, _, stamp)], *_ = self._socket.recvmsg(512, 64)
                    heard.append((content, stamp))
        stamps = np.array([struct.unpack("@qq", stamp) for _, stamp in heard], np.int64).reshape(-1, 2)
        numbers = [int.from_bytes(self._payload(content), "big") for content, _ in heard]
        return np.array(numbers, np.int64), stamps @ np.array([1_000_000_000, 1])

    def _payload(self, content: bytes) -> bytes:
        return bytes(unpack_message(content).data) if self._multicast else content[8:16]

    def close(self) -> None:
        """Leave the bus."""
        self._socket.close()


class Player(NamedTuple):
    """A program that plays logs."""

    name: str
    command: Callable[[Bus, str, float], list[str]]
    """(bus, log, speed) -> command line."""
    own_speed: bool
    """It has an option for the speed; if not, its log's stamps are divided by it."""
    needs_socketcan: bool = False


def play_in_memory(log: str, interface: str, channel: str, options: str) -> None:
    """Play a log read in advance with python-can's `MessageSync`."""
    messages = list(can.LogReader(log))
    with can.Bus(interface=interface, channel=channel, **_bus_options(options)) as bus:
        for message in can.MessageSync(messages):
            bus.send(message)


def play_nowhere(log: str, speed: float) -> None:
    """Follow the times of a log and send nothing; print quantiles of the lateness [us], as JSON."""
    blocks = list(timed_frames(Path(log), None, "", speed, Findings(Path(log))))
    ask_for_priority()
    sent = Sent()
    send_on_schedule(blocks, Silence(), system_time(), sent)
    print(json.dumps([1e-3 * sent.late.quantile(share) for share in SHARES]))


def _bus_options(options: str) -> dict[str, Any]:
    return {name: int(value) for name, _, value in (option.partition("=") for option in options.split())}


def _own_machine(bus: Bus) -> str:
    return "hop_limit=0" if bus.interface == "udp_multicast" else ""


def _ours(bus: Bus, log: str, speed: float) -> list[str]:
    where = ["-i", bus.interface, "-c", bus.channel]
    return [sys.executable, "-m", "ecu.cli", "play", log, *where, "--speed", f"{speed:g}"]


def _canplayer(bus: Bus, log: str, speed: float) -> list[str]:
    return ["canplayer", "-I", log]


def _python_can(bus: Bus, log: str, speed: float) -> list[str]:
    where = ["-i", bus.interface, "-c", bus.channel]
    options = ["--bus-kwargs", _own_machine(bus)] if _own_machine(bus) else []
    return [sys.executable, "-m", "can.player", *options, *where, log]


def _message_sync(bus: Bus, log: str, speed: float) -> list[str]:
    call = f"import sys; from {__name__} import play_in_memory; play_in_memory(*sys.argv[1:])"
    return [sys.executable, "-c", call, log, bus.interface, bus.channel, _own_machine(bus)]


PLAYERS: Final = (
    Player("brake-ecu play", _ours, own_speed=True),
    Player("canplayer", _canplayer, own_speed=False, needs_socketcan=True),
    Player("python-can: can.player", _python_can, own_speed=False),
    Player("python-can: MessageSync, log in memory", _message_sync, own_speed=False),
)


def _with_priority() -> None:
    """Acquire, in the child, the real-time rights that ours requests itself."""
    with suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))


def _granted() -> bool:
    check = [sys.executable, "-c", "import os; print(os.sched_getscheduler(0) == os.SCHED_FIFO)"]
    asked = subprocess.run(check, preexec_fn=_with_priority, capture_output=True, text=True, check=True)
    return asked.stdout.strip() == "True"


def errors_us(
    times_us: NDArray[np.int64], speed: float, numbers: NDArray[np.int64], stamps_ns: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return the lateness of each received frame [us], relative to the earliest one."""
    wanted = (times_us[numbers] - times_us[0]) / speed
    late = 1e-3 * (stamps_ns - stamps_ns.min()) - wanted
    return np.asarray(late - late.min())


def _row(player: Player, bus: Bus, speed: float, seconds: float, folder: Path) -> tuple[str, ...]:
    begin = (f"{speed:g}", player.name)
    if player.needs_socketcan and bus.interface != "socketcan":
        return (*begin, *["–"] * 5, "needs SocketCAN")
    if player.needs_socketcan and not shutil.which(player.name):
        return (*begin, *["–"] * 5, "not installed: apt-get install can-utils")
    times = bus_times(speed * seconds)
    log = folder / "play.log"
    write_log(log, times / (1.0 if player.own_speed else speed), bus.channel)
    listener = Listener(bus)
    try:
        with subprocess.Popen(
            player.command(bus, str(log), speed),
            preexec_fn=None if player.own_speed else _with_priority,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        ) as process:
            numbers, stamps = listener.hear(process)
            assert process.stderr is not None
            said = process.stderr.read().strip().splitlines()
    finally:
        listener.close()
    if not len(numbers):
        return (*begin, "0", *["–"] * 4, said[-1] if said else "nothing came")
    late = errors_us(times, speed, numbers, stamps)
    notes = [] if (np.diff(numbers) > 0).all() else ["not in order"]
    if player is PLAYERS[0]:
        notes.append(verdict(Goal("p99", float(np.quantile(late, 0.99)), GOAL_US)))
    figures = [f"{np.quantile(late, share):.0f}" for share in SHARES]
    return (*begin, f"{len(numbers)} of {len(times)}", *figures, ", ".join(notes))


def _floor(bus: Bus, speed: float, seconds: float, folder: Path) -> tuple[str, ...]:
    log = folder / "play.log"
    write_log(log, bus_times(speed * seconds), bus.channel)
    call = f"import sys; from {__name__} import play_nowhere; play_nowhere(sys.argv[1], float(sys.argv[2]))"
    command = [sys.executable, "-c", call, str(log), f"{speed:g}"]
    said = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    figures = [f"{late:.0f}" for late in json.loads(said.stdout)]
    return (f"{speed:g}", "nothing sent", "–", *figures, "what the machine allows")


def play_tables(seconds: float) -> list[Table]:
    """Return the table of this machine's bus; all runs together send for `seconds`."""
    bus = choose_bus()
    each = seconds / (len(SPEEDS) * (1 + len(PLAYERS)))
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for speed in SPEEDS:
            rows.append(_floor(bus, speed, each, Path(folder)))
            rows += [_row(player, bus, speed, each, Path(folder)) for player in PLAYERS]
    rights = f"SCHED_FIFO {PRIORITY}" if _granted() else "no real-time rights, which were refused"
    below = (
        f"µs late, {each:.1f} s each on {bus.why}, all with {rights}; goal of ours: p99 ≤ {GOAL_US}. "
        f"{installed('python-can')}. {machine()}."
    )
    columns = ("speed", "player", "frames", "p50", "p99", "p99.9", "worst", "note")
    return [Table(f"play on {bus.interface}", columns, rows, below)]


TEXT: Final = (
    "Traffic of a bus of 500 kbit/s with 40 % load: 40 identifiers every 10 to 100 ms with jitter, one frame "
    "after another, 1620 a second. Only ours has an option for the speed; the others get the log with its "
    "stamps divided by it. How late a frame was is the kernel's stamp of its arrival at a socket of the "
    "bench's own against its stamp in the log over the speed; 0 is the frame of the run that came earliest "
    "against the log, for every player alike. Nothing sent: ours on a bus that takes every frame and does "
    "nothing, against the schedule itself."
)


def _run(asked: Asked) -> Measured:
    return Measured(play_tables(asked.seconds))


STUDY: Final = Study("How late frames are played", TEXT, _run, keep=True)
