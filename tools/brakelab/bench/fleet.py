"""Cost of a fleet: time beyond its replays, time for 30,000 km, memory for a long log.

```
python -m brakelab.bench.fleet scaling MANIFEST [--rounds 3] [--drives 100]
python -m brakelab.bench.fleet distance [--kilometres 30000] [--minutes 5] [--workers 2]
python -m brakelab.bench.fleet length [--gigabytes 10]
```
`scaling` replays the same drives in its own process, by one worker and by two, in turn. `distance` simulates
drives of ten minutes, replays and discards them one by one, and keeps their brake applications until its end;
distance not reached in time, or before Ctrl-C, is extrapolated. `length` replays one log that long: a drive
of ten minutes again and again, with a jump of speed and counters at each seam.
"""

import argparse
import os
import re
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, wait
from contextlib import contextmanager, redirect_stdout, suppress
from multiprocessing import active_children, get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np

from brakelab.bench.fleet_drives import plant_of, simulate_and_replay, write_drive
from brakelab.fleet.cluster import Workers, connect
from brakelab.fleet.command import plan
from brakelab.fleet.manifest import VehicleDrive, find_drives
from brakelab.fleet.run import Chain, Planned, Task, run_fleet
from brakelab.fleet.task import replay_job
from brakelab.logs.candump_text import candump_text
from brakelab.logs.formats import read_frames
from brakelab.logs.log_quality import LogQuality
from brakelab.replay.command import replay
from brakelab.replay.source import load_source
from brakelab.simulation.closed_loop import VEHICLE_BUS
from ecu.contract.signals import CYCLE_NS
from ecu.settings.config import load_config
from ecu.settings.resources import named

SECONDS: Final = 600
"""Of a simulated drive."""
VEHICLES: Final = 30
TELL_S: Final = 30.0
"""Between lines of progress."""


@contextmanager
def _warm(count: int, chains: Sequence[Chain], task: Task = replay_job) -> Iterator[Workers]:
    """Yield workers that have all the code loaded."""
    with connect(None, count) as workers:
        job = chains[0].job(Path(), rows=False)
        wait([workers.executor.submit(task, job) for _ in range(count)])
        yield workers


def _peak_megabytes(process: int | str = "self") -> float:
    """Return the peak memory of a process, without that of its parent."""
    held = re.search(r"VmHWM:\s*(\d+) kB", Path(f"/proc/{process}/status").read_text("ascii"))
    return int(held[1]) / 1024.0 if held else float("nan")


def _of_workers() -> tuple[float, float]:
    """Return the processor time [s] that the workers have used up to now, and the greatest peak [MB]."""
    pids = [child.pid for child in active_children() if child.pid]
    times = [Path(f"/proc/{pid}/stat").read_text("ascii").rpartition(")")[2].split() for pid in pids]
    ticks = sum(int(user) + int(system) for *_, user, system in (row[:13] for row in times))
    return ticks / os.sysconf("SC_CLK_TCK"), max(map(_peak_megabytes, pids))


def _by_workers(workers: int, drives: Sequence[VehicleDrive]) -> dict[str, float]:
    with TemporaryDirectory() as folder, _warm(workers, plan(drives, None)) as crew:
        chains = plan(drives, None)
        before, _ = _of_workers()
        began, parent = time.perf_counter(), time.process_time()
        done = [summary for _, summary, _ in run_fleet(crew, chains, Path(folder))]
        wall, parent = time.perf_counter() - began, time.process_time() - parent
        work, peak = _of_workers()
        busy = sum(summary["replay_seconds"] for summary in done)
    return {
        "wall": wall,
        "busy": busy / (workers * wall),
        "parent": 1e3 * parent / len(drives),
        "work": 1e3 * (work - before) / len(drives),
        "peak": peak,
    }


def _alone(drives: Sequence[VehicleDrive]) -> tuple[float, float]:
    """Replay without workers; return wall time and total processor time."""
    began, work = time.perf_counter(), time.process_time()
    for chain in plan(drives, None):
        while chain.place < len(chain.drives):
            chain.finish(replay_job(chain.job(Path(), rows=False)))
    return time.perf_counter() - began, time.process_time() - work


def scaling(manifest: Path, rounds: int, count: int) -> None:
    """Print times of the same drives in this process, by one worker and by two.

    Wall times are valid on an idle machine. Processor time is not affected by others: the replays' share in
    its total is the efficiency of an idle machine.
    """
    drives = find_drives([str(manifest)], None, None, Path("out"))[:count]
    _alone(drives[:1])
    shares = []
    for _ in range(rounds):
        wall, work = _alone(drives)
        one, two = _by_workers(1, drives), _by_workers(2, drives)
        mine = 1e3 * work / len(drives)
        shares.append([one["wall"] / (2 * two["wall"]), mine / (two["work"] + two["parent"])])
        print(
            f"{len(drives)} drives, load {os.getloadavg()[0]:.1f}; alone {wall:.1f} s, {mine:.0f} ms CPU each"
        )
        for workers, took in ((1, one), (2, two)):
            print(
                f"  {workers} workers {took['wall']:.1f} s, {100 * took['busy']:.1f} % of it in replays; "
                f"CPU each {took['work']:.0f} ms workers, {took['parent']:.0f} ms client; "
                f"peak {took['peak']:.0f} MB a worker",
                flush=True,
            )
    walls, works = 100.0 * np.median(shares, axis=0)
    print(f"efficiency in the median: {walls:.0f} % by wall time, {works:.0f} % by processor time")


def _simulated(kilometres: float) -> list[Chain]:
    """Return chains with more drives than needed."""
    source = load_source(None)
    drives = int(kilometres / 5.0 / VEHICLES) + 1
    chains = []
    for vehicle in range(VEHICLES):
        path = named(plant_of(vehicle), "config")
        config, chain = load_config(path), Chain()
        for k in range(drives):
            drive = VehicleDrive(f"{vehicle}", f"{k}", (f"{vehicle}/{k}/{SECONDS}",), path, None)
            chain.add(Planned(drive, config, source, SECONDS, f"{k}", ""))
        chains.append(chain)
    return chains


def distance(kilometres: float, minutes: float, workers: int) -> None:
    """Print the distance simulated in `minutes` or until Ctrl-C, and the time needed for `kilometres`."""
    done: list[dict[str, Any]] = []
    driven = wall = due = 0.0
    chains = _simulated(kilometres)
    with TemporaryDirectory() as folder, _warm(workers, chains, simulate_and_replay) as crew:
        work = time.process_time() + _of_workers()[0]
        began = time.perf_counter()
        with suppress(KeyboardInterrupt):
            for _, summary, _ in run_fleet(crew, chains, Path(folder), task=simulate_and_replay):
                done.append(summary)
                driven += 1e-3 * summary.get("distance", 0.0)
                wall = time.perf_counter() - began
                if wall > due:
                    due = wall + TELL_S
                    print(f"{wall:.0f} s: {len(done)} drives, {driven:.0f} km", file=sys.stderr, flush=True)
                if wall > 60.0 * minutes or driven >= kilometres:
                    break
        used, peak = _of_workers()
        work = time.process_time() + used - work
        kept = sum(file.stat().st_size for file in Path(folder).rglob("*.parquet"))
    good = [row for row in done if not row["fault"]]
    if not good:
        print(f"{len(done)} drives, none replayed")
        return
    hours = sum(row["duration"] for row in good) / 3600.0
    replayed, simulated = (sum(row[f"{name}_seconds"] for row in good) for name in ("replay", "simulate"))
    errors = [row["prediction_error"] for row in good if row["prediction_error"] is not None]
    share = kilometres / driven
    print(
        f"{len(done)} drives, {len(done) - len(good)} failed; {driven:.0f} km in {hours:.1f} h of driving, "
        f"{driven / hours:.0f} km/h on the mean\n"
        f"{wall:.0f} s with {workers} workers, load {os.getloadavg()[0]:.1f}: {3600.0 * hours / wall:.0f} "
        f"times as fast as driven; {100.0 * (replayed + simulated) / (workers * wall):.1f} % of it in tasks, "
        f"of which {100.0 * replayed / (replayed + simulated):.0f} % in replays\n"
        f"CPU {work / len(done):.2f} s a drive, {work / 3600.0:.2f} h in all, for simulation, replay and "
        f"client\n"
        f"prediction off by {100.0 * float(np.median(errors)):.1f} % (median); peak {peak:.0f} MB a "
        f"worker, {1e-3 * kept / len(done):.0f} kB kept a drive\n"
        f"{kilometres:.0f} km: {share * wall / 3600.0:.2f} h at this rate, {share * work / 3600.0:.2f} h of "
        f"processor time"
    )


def _write_long(log: Path, size: float) -> float:
    """Write a log of `size` bytes; return the hours in it."""
    write_drive(0, 0, SECONDS, log)
    frames = np.concatenate(list(read_frames(log, [], LogQuality())))
    length_ns = int(frames["stamp_ns"].max() - frames["stamp_ns"].min()) + CYCLE_NS
    drives = 1
    with log.open("ab") as file:
        while file.tell() < size:
            frames["stamp_ns"] += length_ns
            file.write(candump_text(frames, VEHICLE_BUS))
            drives += 1
    return 1e-9 * drives * length_ns / 3600.0


def _replay_long(log: Path) -> tuple[float, float]:
    """Replay as the command does; return processor time [s] and peak of memory [MB]."""
    work = time.process_time()
    with open(os.devnull, "w") as nowhere, redirect_stdout(nowhere):
        replay([log], named(plant_of(0), "config"), None, None, None, log.with_suffix(".parquet"))
    return time.process_time() - work, _peak_megabytes()


def length(gigabytes: float) -> None:
    """Print the cost of replaying a log of `gigabytes`, in a process of its own."""
    spawn = get_context("spawn")
    with TemporaryDirectory() as folder:
        log = Path(folder, "long.log")
        with ProcessPoolExecutor(1, spawn) as pool:
            hours = pool.submit(_write_long, log, 1e9 * gigabytes).result()
        began = time.perf_counter()
        with ProcessPoolExecutor(1, spawn) as pool:
            work, peak = pool.submit(_replay_long, log).result()
        wall = time.perf_counter() - began
        print(
            f"{1e-9 * log.stat().st_size:.2f} GB, {hours:.1f} h: {work:.0f} s CPU, {wall:.0f} s, "
            f"peak {peak:.0f} MB; {1e-6 * log.with_suffix('.parquet').stat().st_size:.0f} MB of rows"
        )


def main() -> None:
    """Run the measurement requested on the command line."""
    parser = argparse.ArgumentParser(prog="python -m brakelab.bench.fleet")
    what = parser.add_subparsers(dest="what", required=True)
    one = what.add_parser("scaling")
    one.add_argument("manifest", type=Path)
    one.add_argument("--rounds", type=int, default=3)
    one.add_argument("--drives", type=int, default=100)
    two = what.add_parser("distance")
    two.add_argument("--kilometres", type=float, default=30_000.0)
    two.add_argument("--minutes", type=float, default=5.0)
    two.add_argument("--workers", type=int, default=2)
    three = what.add_parser("length")
    three.add_argument("--gigabytes", type=float, default=10.0)
    given = parser.parse_args()
    if given.what == "length":
        length(given.gigabytes)
    elif given.what == "scaling":
        scaling(given.manifest, given.rounds, given.drives)
    else:
        distance(given.kilometres, given.minutes, given.workers)


if __name__ == "__main__":
    main()
