"""`brake-ecu demo`: daemon and simulated vehicle on a bus of their own, in real time; a report at the end.

On vcan0 where it exists, else over UDP multicast that stays on the machine, as two processes. Where neither
is to be had, both sides run as threads of one process on python-can's `virtual` bus.
"""

import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final, NamedTuple

import can
import numpy as np
from rich.console import Console

from brakelab.closed_loop import plans
from brakelab.replay.command import replay
from brakelab.report.command import report
from brakelab.scenario import load_scenario
from brakelab.vehicle_node import drive_in_real_time, new_node, wait_for_ecu, warm_up, write_truth_file
from ecu.bus.channel import open_channel
from ecu.clock import system_time
from ecu.errors import RunFault, UserError
from ecu.recorder import read_recording
from ecu.records import RecordArray
from ecu.resources import resource
from ecu.ring import RingReader, ring_path
from ecu.service import RunOptions, run
from ecu.warm import warm

SCENARIO: Final = "config/scenarios/demo.toml"
SEED: Final = 1
MULTICAST: Final = f"239.74.163.{os.getpid() % 250 + 2}"  # a group of its own: two demos do not meet
MEASURED_ABOVE: Final = 15 / 3.6  # m/s
PATIENCE_S: Final = 180.0  # for a slow machine to get ready

say = Console(highlight=False, soft_wrap=True).print


class Bus(NamedTuple):
    """Where daemon and vehicle meet."""

    interface: str
    channel: str
    why: str


def choose_bus() -> Bus:
    """Return the best bus this machine has."""
    if Path("/sys/class/net/vcan0").exists():
        return Bus("socketcan", "vcan0", "vcan0")
    try:
        open_channel("udp_multicast", MULTICAST, receive_ids=[]).close()
    except (OSError, can.CanError, UserError) as error:
        return Bus(
            "virtual", "demo", f"python-can's virtual bus in one process (no vcan0, no multicast: {error})"
        )
    return Bus("udp_multicast", MULTICAST, "UDP multicast that stays on this machine (there is no vcan0)")


def armed_config(out: Path) -> Path:
    """Write the SUV's configuration with the demands armed into `out` and return its path."""
    text = resource("config/suv.toml").read_text(encoding="utf-8")
    path = out / "suv.toml"
    path.write_text(
        re.sub(r"^transmit = false.*$", "transmit = true", text, flags=re.MULTILINE), encoding="utf-8"
    )
    return path


def braking_line(number: int, duration: float, rows: RecordArray) -> str:
    """Return what one braking of `duration` [s] was like, from its outputs (`OUTPUTS`, shape (n,))."""
    last = rows[-1]
    demand = np.nan_to_num(rows["decel_demand_total"])
    rolling = rows["vehicle_speed"] > MEASURED_ABOVE
    held = rows[rolling & (demand >= 0.9 * demand[rolling].max(initial=0.0))]
    friction = ", ".join(
        f"{axle} friction {last['mu_b'][i]:.3f} ± {2 * last['sigma_mu_b'][i]:.3f} (2σ)"
        for axle, i in (("front", 0), ("rear", 2))
    )
    return (
        f"braking {number}: {rows[0]['vehicle_speed'] * 3.6:5.1f} to {last['vehicle_speed'] * 3.6:5.1f} km/h "
        f"in {duration:4.1f} s, asked {np.mean(held['decel_demand_total']):.2f}, "
        f"achieved {-np.mean(held['accel_x_road']):.2f} m/s²; {friction}"
    )


def brakings(reader: RingReader, going_on: Callable[[], bool]) -> Iterator[str]:
    """Yield a line per braking as it ends, while `going_on`."""
    number = 0
    t: list[float] = []
    rows: list[np.void] = []
    while going_on():
        for record in reader.read().records:
            if record["outputs"]["braking"]:
                t.append(1e-9 * record["cycle"]["t_mono_ns"])
                rows.append(record["outputs"])
            elif rows:
                number += 1
                yield braking_line(number, t[-1] - t[0], np.array(rows))
                t, rows = [], []
        time.sleep(0.1)


def demo(out: Path) -> int:
    """Run the demonstration; leave report, recording, truth and results in `out`; return the exit code 0.

    Raises:
        UserError: `out` cannot be written.
        RunFault: daemon or vehicle ended with an error.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        config = armed_config(out)
    except OSError as error:
        raise UserError(
            "--out", str(out), f"cannot be written ({error.strerror}); choose another folder"
        ) from None
    bus = choose_bus()
    say(f"bus: {bus.why}")
    say("compiling what is not in the cache yet, about a minute the first time")
    warm_up(load_scenario(resource(SCENARIO)))
    warm()
    say("driving: a staircase of 1 to 5 m/s² and three stops, about 70 s")
    (_in_one_process if bus.interface == "virtual" else _in_two_processes)(bus, config, out)
    recording = read_recording(out / "drive").folder
    result, page = out / "result.parquet", out / "report.html"
    replay([recording], config, None, None, None, result)
    report(result, out / "truth.parquet", page, recording)
    say(f"report: {page.resolve()}")
    return 0


def _await_ring(pid: int, ended: Callable[[], bool]) -> RingReader:
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline and not ended():
        if ring_path(pid).exists():
            return RingReader(ring_path(pid))
        time.sleep(0.05)
    raise RunFault("the daemon did not become ready; its log says why")


def _in_two_processes(bus: Bus, config: Path, out: Path) -> None:
    python, meeting = sys.executable, ["-i", bus.interface, "-c", bus.channel]
    truth, log = out / "truth.parquet", out / "daemon.log"
    truth.unlink(missing_ok=True)
    command = [python, "-m", "brakelab.vehicle_node", str(resource(SCENARIO)), *meeting, "--with-ecu"]
    with log.open("wb") as file:
        vehicle = subprocess.Popen(
            [*command, "--seed", str(SEED), "--truth", str(truth)], stdout=subprocess.PIPE, stderr=file
        )
        assert vehicle.stdout is not None
        vehicle.stdout.readline()
        command = [python, "-m", "ecu.cli", "run", "--config", str(config), *meeting]
        daemon = subprocess.Popen([*command, "--record", str(out / "drive")], stderr=file)
        try:
            reader = _await_ring(daemon.pid, lambda: daemon.poll() is not None)
            for line in brakings(reader, lambda: vehicle.poll() is None and not truth.exists()):
                say(line)
        finally:
            daemon.send_signal(signal.SIGTERM)
            code = daemon.wait()
            vehicle.terminate()
            vehicle.wait()
    if code or not truth.exists():
        raise RunFault(f"daemon or vehicle ended early; {log} says why")


def _in_one_process(bus: Bus, config: Path, out: Path) -> None:
    def drive_then_stop() -> None:
        reader = _await_ring(os.getpid(), lambda: False)
        threading.Thread(
            target=lambda: [say(line) for line in brakings(reader, lambda: not over.is_set())]
        ).start()
        node = new_node(load_scenario(resource(SCENARIO)), SEED)
        channel = open_channel(bus.interface, bus.channel, receive_ids=plans().vehicle_hears.ids.tolist())
        wait_for_ecu(node, channel, over.is_set)
        truth = drive_in_real_time(node, channel, system_time())
        write_truth_file(out / "truth.parquet", truth, Path(SCENARIO).stem, SEED)
        over.set()
        os.kill(os.getpid(), signal.SIGTERM)

    over = threading.Event()
    threading.Thread(target=drive_then_stop).start()
    run(RunOptions(config, bus.interface, bus.channel, record=out / "drive"))
