"""A long run of the ECU beside the simulated car, with checks of its invariants.

    python -m brakelab.rig.soak virtual --hours 24    the loop on a clock of its own, as fast as it goes
    python -m brakelab.rig.soak live --hours 1        `brake-ecu run` with recording and store, in real time

`virtual` runs `cycle_once` with ring, recorder and state store in one process: the loop closed over
real frames. Cycle numbers and counters of frames begin half a run below 2^32; every hour the clock
oversleeps a period; every six hours the ECU ends and another one starts with the stored values.
`live` is daemon and car on a bus. Prints a table of checks; exit code 1 if one fails.
"""

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import structlog

from brakelab.rig.live import choose_bus, drive
from brakelab.rig.vehicle_node import live_through, new_node
from brakelab.simulation.closed_loop import START_NS, plans
from brakelab.simulation.configured import configured, shipped
from brakelab.simulation.vehicle_bus import N_TRUTH
from ecu.algorithm.step import INITIAL, initial_part
from ecu.bus.protocol import BusStatus
from ecu.bus.signal_map import receive_plan
from ecu.contract.records import RecordArray
from ecu.contract.signals import CYCLE_NS
from ecu.jit import CompileCounter
from ecu.recording.learned_range import out_of_range
from ecu.recording.recorder import layout, read_recording
from ecu.recording.restored import restored
from ecu.recording.ring import RingReader, close_ring, create_ring, remove_ring
from ecu.runtime.clock import Grid, TimeSource
from ecu.runtime.cycle import Progress, cycle_once
from ecu.runtime.memory import new_ecu
from ecu.runtime.side_process import Recorder
from ecu.runtime.warm_up import warm_up
from ecu.settings.config import new_params, store_key
from ecu.settings.resources import resource
from ecu.watch.daemons import pid_of

HOUR: Final = 360_000  # cycles
RESTART: Final = 6 * HOUR + 7  # no multiple of 15: its E2E counters start at another value
TURN: Final = 200  # cycles between two turns of the recorder; it reads 256 at once
SETTLED: Final = 25  # cycles: frames of 20 ms are accepted again after 0.15 s
WRAP: Final = 1 << 32
GROWTH_MB: Final = 4.0  # of a process after its warm-up: an hour of 24, a tenth of a live run
PAGE: Final = os.sysconf("SC_PAGE_SIZE")
FINE: Final = BusStatus(bus_off=False, error_passive=False, send_failures=0, dropped=0)


class Check(NamedTuple):
    """A check: its subject, its finding and its verdict."""

    what: str
    seen: str
    good: bool


def resident_mb(pid: int | str = "self") -> float:
    """Return the memory that a process has in RAM [MB]."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * PAGE / 1e6


def _growth(name: str, samples: list[float], warm: int) -> Check:
    grown = max(samples[warm:]) - samples[warm]
    seen = f"{samples[warm]:.1f} MB after warm-up, at most {grown:+.1f} MB later"
    return Check(f"memory of {name}", seen, grown < GROWTH_MB)


class Rig:
    """Bus, clock and car of a virtual run."""

    def __init__(self, scenario: str, seconds: float, seed: int) -> None:
        found = shipped(scenario)
        once = float(found.script().phases["seconds"].sum())
        self.node = new_node(found.model_copy(update={"repeat": int(seconds / once) + 2}), seed)
        self.name, self.now_ns, self.heard, self.periods, self.oversleeps = "soak", 0, 0, 0, False
        self._row = np.empty(N_TRUTH)

    def source(self) -> TimeSource:
        """Return the clocks, advanced by sleeping alone."""
        return TimeSource(lambda: self.now_ns, lambda: self.now_ns + START_NS, self._sleep)

    def _sleep(self, until_ns: int) -> None:
        self.now_ns = until_ns + (3 * CYCLE_NS // 2 if self.oversleeps else 0)
        self.oversleeps = False

    def drain(self, frames: RecordArray, start: int) -> int:
        """Advance the car to the present and return its frames."""
        count = 0
        while self.periods * CYCLE_NS < self.now_ns:
            self.periods += 1
            at_ns = self.periods * CYCLE_NS + START_NS - CYCLE_NS // 10
            side, heard, self.heard = self.node.side, self.heard, 0
            sent = live_through(
                plans(), side, self.node.noise, at_ns, heard, 1, self.periods, self._row, False
            )
            arrived = side.to_ecu.arrived[:sent]
            arrived["stamp_ns"] = at_ns
            frames[start + count : start + count + sent] = arrived
            count += sent
        return count

    def send(self, frames: RecordArray, count: int) -> int:
        """Pass frames to the car."""
        arrived = self.node.side.frames_in[self.heard : self.heard + count]
        arrived[:] = frames[:count]
        arrived["stamp_ns"] = self.now_ns + START_NS
        self.heard += count
        return count

    def rejected(self) -> int:
        """Return the number of ECU frames rejected by the car so far."""
        return int(self.node.side.reception.totals["rejected"][0])

    def status(self) -> BusStatus:
        """Return an error-free status."""
        return FINE

    def close(self) -> None:
        """Nothing is held open."""


class Life(NamedTuple):
    """One ECU from its start to its end."""

    cycles: int
    missed: int
    overslept: int
    lost: int
    """Cycles and frames that the recorder missed."""
    spoilt: int
    """Frames of either side that were not accepted, but for the car's in the first `SETTLED` cycles: whoever
    starts anew has to be accepted again."""
    wrapped: bool
    kept: str
    """Errors of the learned values, or of the stored ones."""


def run_one(rig: Rig, folder: Path, first: int, cycles: int, memory: list[float]) -> Life:
    """Run one ECU with the values stored in `folder`, from cycle number `first` on."""
    config = configured()
    params = new_params(config)
    params["transmit"] = True
    stored = restored(folder, config, params)
    sending = plans().ecu_sends
    ecu = new_ecu(params, stored[1] if stored else None, receive_plan(None), sending)
    compiled = CompileCounter()
    warm_up(ecu, compiled)
    about = {"channel": "soak", "store_key": store_key(config), "state": layout(INITIAL)}
    ring = create_ring(folder / "ring", about, initial_part(ecu.state).tobytes())
    recorder = Recorder(RingReader(ring.path), None, folder)
    progress, grid = Progress(ecu, FINE, compiled), Grid(rig.source())
    progress.number = first
    counters = ecu.reception.messages
    for name in ("received", "accepted"):
        counters[name] = first % WRAP
    overslept, resynchronising = 0, 0
    for done in range(cycles):
        if done == SETTLED:
            resynchronising = rig.rejected()
        if done % HOUR == HOUR // 2:
            rig.oversleeps, overslept = True, overslept + 1
        cycle_once(ecu, rig, ring, grid, progress)
        if done % TURN == TURN - 1:
            recorder.turn()
        if done % HOUR == HOUR - 1:
            memory.append(resident_mb())
            _tell(memory, ecu.learned, rig)
    while recorder.turn():
        pass
    learned = ecu.learned.copy()
    close_ring(ring)
    recorder.finish()
    remove_ring(ring.path)
    again = restored(folder, config, params)
    same = again is not None and again[1].tobytes() == learned.tobytes()
    wrong = out_of_range(learned, params["mu_nominal"][0])
    spoilt = (counters["received"] - counters["accepted"]).sum(dtype=np.int64)
    spoilt += rig.rejected() - resynchronising
    return Life(
        progress.number - first,
        progress.overruns,
        overslept,
        recorder.reader.lost_cycles + recorder.reader.lost_frames,
        int(spoilt),
        first < WRAP <= progress.number and int(counters["received"].min()) < first,
        wrong or ("" if same else "stored is not what was learned"),
    )


def _tell(memory: list[float], learned: RecordArray, rig: Rig) -> None:
    km = 1e-3 * float(learned["wear"]["odometer"][0])
    friction = np.array2string(learned["mu_b"][0], precision=3)
    true = np.array2string(rig.node.side.vehicle.state["mu_b"][0], precision=3)
    print(
        f"{len(memory):3d} h  {memory[-1]:6.1f} MB  {km:7.1f} km  learned friction {friction}, now {true}",
        flush=True,
    )


def soak_virtual(hours: float, seed: int, folder: Path) -> list[Check]:
    """Run hours of virtual time; return the checks."""
    total = round(hours * HOUR)
    rig = Rig("real-driving", 1e-2 * total, seed)
    memory: list[float] = []
    lives: list[Life] = []
    began_s, first = time.monotonic(), WRAP - total // 2
    while first < WRAP + total - total // 2:
        cycles = min(RESTART, WRAP + total - total // 2 - first)
        lives.append(run_one(rig, folder, first, cycles, memory))
        first += cycles
    took_s = time.monotonic() - began_s
    config = configured()
    end = restored(folder, config, new_params(config))
    odometer = float(end[1]["wear"]["odometer"][0]) if end else 0.0
    driven = float(rig.node.side.vehicle.state["distance"][0])
    kept = [life.kept for life in lives if life.kept]
    missed, overslept = sum(life.missed for life in lives), sum(life.overslept for life in lives)
    lost, spoilt = sum(life.lost for life in lives), sum(life.spoilt for life in lives)
    checks = [
        Check("cycles", f"{total} in {took_s:.0f} s, {1e6 * took_s / total:.0f} us each", True),
        Check("lives of the ECU, each with what the one before stored", str(len(lives)), not kept),
        Check("what was learned and stored", kept[0] if kept else "in range, and the same bytes", not kept),
        Check("periods missed", f"{missed}, overslept {overslept}", missed == overslept),
        Check("cycles and frames that the recorder lost", str(lost), lost == 0),
        Check("frames that either side did not accept", str(spoilt), spoilt == 0),
        Check(
            "counters past 2^32",
            f"{sum(life.wrapped for life in lives)} time",
            any(life.wrapped for life in lives),
        ),
        Check(
            "odometer",
            f"{1e-3 * odometer:.1f} of {1e-3 * driven:.1f} km",
            abs(odometer / max(driven, 1.0) - 1.0) < 0.01,
        ),
    ]
    return [*checks, _growth("all in one process", memory, 0)] if memory else checks


def _family(pid: int) -> list[int]:
    """Return a process and its descendants."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [pid, *(one for child in children for one in _family(int(child)))]


class Looks:
    """Memory of a daemon's processes, sampled as its cycles pass."""

    def __init__(self) -> None:
        self.samples: dict[int, list[float]] = {}
        self._next_s = 0.0

    def __call__(self, reader: RingReader) -> None:
        """Take a sample a second."""
        now_s = time.monotonic()
        if now_s < self._next_s:
            return
        self._next_s = now_s + 1.0
        for pid in _family(pid_of(reader.ring.path)):
            self.samples.setdefault(pid, []).append(resident_mb(pid))


def soak_live(hours: float, seed: int, folder: Path) -> list[Check]:
    """Run `brake-ecu run` for hours of real time; return the checks."""
    text = resource("config/scenarios/demo.toml").read_text("utf-8")
    once = 56.0  # s, about
    scenario = folder / "soak.toml"
    scenario.write_text(f"repeat = {max(1, round(3600.0 * hours / once))}\n{text}", "utf-8")
    looks, bus = Looks(), choose_bus()
    left = drive(bus, scenario, resource("config/suv.toml"), [], folder, seed, looks)
    recorded = read_recording(left.recordings[0])
    cycles = recorded.cycles
    lines = sum(block.count(b"\n") for block in _blocks(recorded.frames))
    frames = int(cycles["frames"].sum(dtype=np.int64))
    number = cycles["number"]
    mode = recorded.outputs["mode"]
    seconds = 1e-9 * float(cycles["t_mono_ns"][-1] - cycles["t_mono_ns"][0])
    lateness = np.percentile(cycles["lateness_ns"], [50, 99, 99.9]) * 1e-3
    missed = int(cycles["missed"].sum())
    steps = np.diff(cycles["t_mono_ns"]) == (cycles["missed"][1:] + 1) * CYCLE_NS
    said = (folder / "daemon.log").read_text("utf-8", errors="replace")
    overtaken = said.count("ring_overtaken")
    names = ("loop", "supervisor", "recorder")
    grown = [
        _growth(name, samples, len(samples) // 10)
        for name, samples in zip(names, looks.samples.values(), strict=True)
    ]
    return [
        Check("cycles", f"{len(cycles)} in {seconds:.0f} s on {bus.interface}", True),
        Check("cycles recorded without a gap", str(len(number)), bool(np.all(np.diff(number) == 1))),
        Check("frames recorded", f"{lines} of {frames}", lines == frames),
        Check("ring overtaken", str(overtaken), overtaken == 0),
        Check("every cycle on the grid, missed ones counted", f"{missed} missed", bool(np.all(steps))),
        Check("frames dropped", str(int(cycles["dropped"][-1])), int(cycles["dropped"][-1]) == 0),
        Check("lateness p50, p99, p99.9", " ".join(f"{value:.0f} us" for value in lateness), True),
        Check("cycles degraded or failed", str(int(np.sum(mode >= 3))), True),
        *grown,
    ]


def _blocks(path: Path) -> Any:
    with path.open("rb") as file:
        yield from iter(lambda: file.read(1 << 24), b"")


def main(arguments: list[str] | None = None) -> int:
    """Run and print the table."""
    parser = argparse.ArgumentParser(prog="python -m brakelab.rig.soak", description=__doc__.splitlines()[0])
    parser.add_argument("kind", choices=["virtual", "live"])
    parser.add_argument("--hours", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=1, help="of the drawn car and its noise")
    parser.add_argument("--out", type=Path, help="folder for recording and store, kept")
    wanted = parser.parse_args(arguments)
    if wanted.kind == "virtual":  # hours of events, none of interest
        structlog.configure(wrapper_class=structlog.make_filtering_bound_logger(50))
    soak = soak_virtual if wanted.kind == "virtual" else soak_live
    with tempfile.TemporaryDirectory() as scratch:
        folder = wanted.out or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        checks = soak(wanted.hours, wanted.seed, folder)
    for check in checks:
        print(f"{'ok  ' if check.good else 'FAIL'} {check.what}: {check.seen}")
    return 0 if all(check.good for check in checks) else 1


if __name__ == "__main__":
    sys.exit(main())
