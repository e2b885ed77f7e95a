"""One scenario in real time: daemon and vehicle as processes of their own on a common bus.

The vehicle (`vehicle_node.py`) sets off when it hears the ECU. It applies a scenario's faults of frames,
sensors and actuators; faults of the daemon are applied here, with the same T_0.
"""

import ctypes
import math
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any, Final, NamedTuple

import can

from brakelab.rig.wire import CHANNEL, Wire, lay_wire
from brakelab.simulation.faults import Fault
from ecu.bus.channel import open_channel
from ecu.errors import RunFault, UserError
from ecu.recording.ring import RingReader, ring_path
from ecu.runtime.clock import monotonic_s
from ecu.runtime.start import raise_priority

MULTICAST: Final = f"239.74.163.{os.getpid() % 250 + 2}"  # a group of its own: two rigs do not interfere
PATIENCE_S: Final = 180.0  # start-up time of a slow machine
TURN_S: Final = 0.05
LIBC: Final = ctypes.CDLL(None)
PR_SET_PDEATHSIG: Final = 1


def make_folder(out: Path) -> None:
    """Create the folder `out`. Raises UserError if nothing can be written into it."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        reason = "" if os.access(out, os.W_OK | os.X_OK) else "permission denied"
    except OSError as error:
        reason = error.strerror or str(error)
    if reason:
        raise UserError("--out", str(out), f"cannot be written ({reason}); choose another folder")


def end_with_parent() -> None:
    """Arrange for SIGTERM when the parent process ends, however it ends: between fork and exec."""
    LIBC.prctl(PR_SET_PDEATHSIG, signal.SIGTERM)


def start_as_service() -> None:
    """Start as a service manager would start the daemon, and end with the parent: between fork and exec."""
    end_with_parent()
    raise_priority()


class Bus(NamedTuple):
    """Bus between daemon and vehicle."""

    interface: str
    channel: str
    why: str
    wire: Wire | None = None
    """Its first end is the daemon's `channel`, the vehicle is at the second."""

    def close(self) -> None:
        """Remove everything that it created."""
        if self.wire is not None:
            self.wire.close()


def named_bus(interface: str, channel: str) -> Bus:
    """Return the bus of python-can's names, or a wire of two controllers for `socketcan slcan`.

    Raises:
        UserError: no such wire is possible here.
    """
    if (interface, channel) != ("socketcan", CHANNEL):
        return Bus(interface, channel, f"{interface} {channel}")
    wire = lay_wire()
    return Bus(interface, wire.ends[0].name, "a wire of two slcan controllers", wire)


def choose_bus() -> Bus:
    """Return the best bus of this machine."""
    if Path("/sys/class/net/vcan0").exists():
        return Bus("socketcan", "vcan0", "vcan0")
    try:
        open_channel("udp_multicast", MULTICAST, receive_ids=[]).close()
    except (OSError, can.CanError, UserError) as error:
        return Bus(
            "virtual", "demo", f"python-can's virtual bus in one process (no vcan0, no multicast: {error})"
        )
    return Bus("udp_multicast", MULTICAST, "UDP multicast that stays on this machine (there is no vcan0)")


class Recorded(NamedTuple):
    """Recordings of a drive in real time."""

    truth: Path
    recordings: list[Path]
    """Of the daemons that drove, in the order of their starts; a standby's last."""


class Processes:
    """Vehicle and daemons of one drive."""

    def __init__(self, bus: Bus, config: Path, out: Path, log: IO[bytes]) -> None:
        self.out, self.truth = out, out / "truth.parquet"
        self.daemons: list[subprocess.Popen[bytes]] = []
        self._bus, self._config, self._log = bus, config, log
        self.vehicle: subprocess.Popen[str] | None = None

    def start_vehicle(self, scenario: Path, seed: int, plant: str | None = None) -> None:
        """Start the vehicle and wait until it is on the bus.

        Raises:
            RunFault: it did not start.
        """
        wire = self._bus.wire
        command = [sys.executable, "-m", "ecu.cli", "vehicle", str(scenario)]
        command += ["-i", self._bus.interface]
        command += ["-c", self._bus.channel] if wire is None else ["-c", wire.ends[1].name, "--bus-goes-off"]
        command += [] if plant is None else ["--plant", plant]
        command += ["--seed", str(seed), "--truth", str(self.truth)]
        self.vehicle = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=self._log, text=True, preexec_fn=end_with_parent
        )
        self._line("ready")

    def start_daemon(self, folder: str, *options: str) -> RingReader | None:
        """Start a daemon that records into `folder` and wait for its ring; None: it ended at once."""
        command = [sys.executable, "-m", "ecu.cli", "run", "--armed", "--config", str(self._config)]
        command += ["-i", self._bus.interface, "-c", self._bus.channel]
        command += ["--record", str(self.out / folder), "--state", str(self.out / folder / "state")]
        daemon = subprocess.Popen([*command, *options], stderr=self._log, preexec_fn=start_as_service)
        self.daemons.append(daemon)
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline and daemon.poll() is None:
            if ring_path(daemon.pid).exists():
                return RingReader(ring_path(daemon.pid))
            time.sleep(0.01)
        return None

    def departure(self) -> float:
        """Wait until the vehicle sets off; return T_0 on the cycle's monotonic clock [s]."""
        return 1e-9 * int(self._line("driving").split()[1])

    def _line(self, begin: str) -> str:
        assert self.vehicle is not None
        assert self.vehicle.stdout is not None
        line = self.vehicle.stdout.readline()
        if not line.startswith(begin):
            raise RunFault("the vehicle did not set off; its log says why")
        return line

    def driving(self) -> bool:
        """Return whether the drive continues."""
        assert self.vehicle is not None
        return self.vehicle.poll() is None and not self.truth.exists()

    def end(self) -> list[int]:
        """End the processes still running; return the daemons' exits."""
        for daemon in self.daemons:
            if daemon.poll() is None:
                daemon.send_signal(signal.SIGTERM)
        exits = [daemon.wait() for daemon in self.daemons]
        if self.vehicle is not None:
            self.vehicle.terminate()
            self.vehicle.wait()
        return exits


def drive(
    bus: Bus,
    scenario: Path,
    config: Path,
    faults: list[Fault],
    out: Path,
    seed: int,
    look: Callable[[RingReader], Any] = lambda ring: None,
    plant: str | None = None,
) -> Recorded:
    """Drive a scenario with the ECU of `config`, armed; `look` sees its ring every 50 ms and at the end.

    `plant`: the car's file, None: the scenario's.

    Raises:
        RunFault: a daemon or the vehicle ended early.
    """
    kills = [fault for fault in faults if fault.kind == "daemon_killed"]
    for left in ("drive", "standby"):
        shutil.rmtree(out / left, ignore_errors=True)
    log = out / "daemon.log"
    with log.open("wb") as file:
        processes = Processes(bus, config, out, file)
        processes.truth.unlink(missing_ok=True)
        try:
            processes.start_vehicle(scenario, seed, plant)
            if any(fault.standby for fault in kills):
                processes.start_daemon("standby", "--standby")
            ring = processes.start_daemon("drive")
            if ring is None:
                raise RunFault(f"the daemon did not become ready; {log} says why")
            ring = _act(processes, _actions(faults, bus.wire), bus.wire, ring, look)
        finally:
            exits = processes.end()
            if bus.wire is not None:
                bus.wire.ends[0].restart()
    look(ring)  # what came after the last turn
    _check(exits, faults, log)
    if not processes.truth.exists():
        raise RunFault(f"the vehicle ended early; {log} says why")
    recordings = [path.parent for name in ("drive", "standby") for path in _recordings(out / name)]
    return Recorded(processes.truth, recordings)


def _recordings(folder: Path) -> list[Path]:
    """Return the recordings in a folder that hold a cycle, in the order of their starts."""
    filled = [path for path in folder.glob("*/cycles.bin") if path.stat().st_size]
    return sorted(filled, key=lambda path: (path.parent / "recording.json").stat().st_mtime_ns)


def _actions(faults: list[Fault], wire: Wire | None) -> list[tuple[float, str]]:
    """Return the actions with their times [s after T_0], in order."""
    actions = []
    for fault in faults:
        if fault.kind == "daemon_killed":
            actions += [(fault.t, "kill"), (fault.end, "start")]
        elif fault.kind == "bus_off" and wire is not None:
            actions += [(fault.t, "off"), (fault.end, "on")]
    return sorted(action for action in actions if math.isfinite(action[0]))


def _act(
    processes: Processes,
    actions: list[tuple[float, str]],
    wire: Wire | None,
    ring: RingReader,
    look: Callable[[RingReader], Any],
) -> RingReader:
    """Kill and restart daemons, and their controller, on time until the drive has ended or failed.

    Returns the ring of the last daemon.
    """
    t_0 = processes.departure()
    victim, may_end = processes.daemons[-1], bool(actions)
    while processes.driving() and (may_end or victim.poll() is None):
        if actions and monotonic_s() >= t_0 + actions[0][0]:
            match actions.pop(0)[1]:
                case "kill":
                    victim.kill()
                case "start":
                    victim.wait()
                    ring = processes.start_daemon("drive") or ring
                    victim = processes.daemons[-1]
                case "off" if wire is not None:
                    wire.ends[0].go_off()
                case "on" if wire is not None:
                    wire.ends[0].restart()
            continue
        look(ring)
        due = t_0 + actions[0][0] - monotonic_s() if actions else TURN_S
        time.sleep(min(max(due, 0.0), TURN_S))
    return ring


def _check(exits: list[int], faults: list[Fault], log: Path) -> None:
    """Raise `RunFault` if a daemon ended unexpectedly."""
    allowed = {0}
    for fault in faults:
        if fault.kind == "bus_off" and fault.duration is None:
            allowed.add(1)
        if fault.kind == "daemon_killed":
            allowed.add(-signal.SIGKILL)
            if fault.standby and fault.duration is not None:
                allowed.add(2)  # it hears the standby and refuses
    for code in exits:
        if code not in allowed:
            raise RunFault(f"a daemon ended with {code}; {log} says why")
