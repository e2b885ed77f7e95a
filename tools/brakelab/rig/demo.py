"""Demonstration (`brake-ecu demo`): one scenario on the rig (`brakelab.rig`), in real time, with a report.

On vcan0 where it exists, else over UDP multicast that stays on the machine, as two processes. Where neither
is available, both sides run as threads of one process on python-can's `virtual` bus.
"""

import os
import signal
import threading
import time
from pathlib import Path
from typing import Final

import numpy as np
from rich.console import Console

from brakelab.report.command import report
from brakelab.rig.live import Bus, choose_bus, drive, make_folder
from brakelab.rig.results import write_recorded
from brakelab.rig.vehicle_node import drive_in_real_time, new_node, wait_for_ecu, warm_up, write_truth_file
from brakelab.simulation.closed_loop import plans
from brakelab.simulation.scenario import load_scenario
from ecu.bus.channel import open_channel
from ecu.contract.records import RecordArray
from ecu.output import Level, give, policy
from ecu.recording.recorder import read_recording
from ecu.recording.ring import RingReader, ring_path
from ecu.runtime.clock import system_time
from ecu.runtime.prepare import RunOptions
from ecu.runtime.service import run
from ecu.settings.config import load_config
from ecu.settings.resources import resource
from ecu.warm import warm

SCENARIO: Final = "config/scenarios/demo.toml"
SEED: Final = 1
MEASURED_ABOVE: Final = 15 / 3.6  # m/s

say = Console(highlight=False, soft_wrap=True).print


def braking_line(number: int, duration: float, rows: RecordArray) -> str:
    """Return a line on one brake application of `duration` [s], from its outputs (`OUTPUTS`, shape (n,))."""
    last = rows[-1]
    demand = np.nan_to_num(rows["decel_demand_total"])
    rolling = rows["vehicle_speed"] > MEASURED_ABOVE
    held = rows[rolling & (demand >= 0.9 * demand[rolling].max(initial=0.0))]
    friction = ", ".join(
        f"{axle} friction {last['mu_b'][i]:.3f} ± {2 * last['sigma_mu_b'][i]:.3f} (2σ)"
        for axle, i in (("front", 0), ("rear", 2))
    )
    reached = ""
    if len(held):
        asked, achieved = np.mean(held["decel_demand_total"]), -np.mean(held["accel_x_road"])
        reached = f", asked {asked:.2f}, achieved {achieved:.2f} m/s²"
    return (
        f"braking {number}: {rows[0]['vehicle_speed'] * 3.6:5.1f} to {last['vehicle_speed'] * 3.6:5.1f} km/h "
        f"in {duration:4.1f} s{reached}; {friction}"
    )


class Brakings:
    """Printer of one line per brake application, at its end."""

    def __init__(self) -> None:
        self._number = 0
        self._t: list[float] = []
        self._rows: list[np.void] = []

    def look(self, reader: RingReader) -> None:
        """Process the cycles since the last look."""
        for record in reader.read().records:
            if record["outputs"]["braking"]:
                self._t.append(1e-9 * record["cycle"]["t_mono_ns"])
                self._rows.append(record["outputs"])
            else:
                self.end()

    def end(self) -> None:
        """Print the application that lasts, if there is one."""
        if self._rows:
            self._number += 1
            say(braking_line(self._number, self._t[-1] - self._t[0], np.array(self._rows)))
            self._t, self._rows = [], []


def _say_progress(line: str) -> None:
    if policy().level > Level.QUIET:
        say(line)


def demo(out: Path) -> None:
    """Run the demonstration; leave report, recording, truth and results in `out`.

    Raises:
        UserError: `out` cannot be written.
        RunFault: daemon or vehicle ended with an error.
    """
    make_folder(out)
    config, bus = resource("config/suv.toml"), choose_bus()
    _say_progress(f"bus: {bus.why}")
    _say_progress("compiling what is not in the cache yet, about a minute the first time")
    warm_up(load_scenario(resource(SCENARIO)))
    warm()
    _say_progress("driving: a staircase of 1 to 5 m/s² and three stops, about 70 s")
    if bus.interface == "virtual":
        recordings = _in_one_process(bus, config, out)
    else:
        brakings = Brakings()
        recordings = drive(bus, resource(SCENARIO), config, [], out, SEED, brakings.look).recordings
        brakings.end()
    written = write_recorded(recordings, load_config(config), out)
    page = out / "report.html"
    report(written.result, out / "truth.parquet", page, recordings[0])
    say(f"report: {page.resolve()}")
    give(written=[page, written.result, out / "truth.parquet"])


def _in_one_process(bus: Bus, config: Path, out: Path) -> list[Path]:
    def drive_then_stop() -> None:
        while not ring_path(os.getpid()).exists():
            time.sleep(0.05)
        reader, said = RingReader(ring_path(os.getpid())), Brakings()

        def follow() -> None:
            while not over.wait(0.1):
                said.look(reader)

        threading.Thread(target=follow).start()
        node = new_node(load_scenario(resource(SCENARIO)), SEED)
        channel = open_channel(bus.interface, bus.channel, receive_ids=plans().vehicle_hears.ids.tolist())
        wait_for_ecu(node, channel, over.is_set)
        truth = drive_in_real_time(node, channel, system_time())
        write_truth_file(out / "truth.parquet", truth, Path(SCENARIO).stem, SEED)
        over.set()
        os.kill(os.getpid(), signal.SIGTERM)

    over = threading.Event()
    threading.Thread(target=drive_then_stop).start()
    run(RunOptions(config, bus.interface, bus.channel, record=out / "drive", armed=True))
    return [read_recording(out / "drive").folder]
