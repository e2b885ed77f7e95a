"""What a fleet costs beyond its replays, and how long 30,000 km take.

```
python -m brakelab.fleet.measure scaling MANIFEST [--rounds 3] [--drives 100]
python -m brakelab.fleet.measure distance [--kilometres 30000] [--minutes 5] [--workers 2]
```
`scaling` replays the same drives without Dask, by one worker and by two, in turn. `distance` simulates drives
of ten minutes, replays and forgets them one by one; what it does not reach in its time it extrapolates.
"""

import argparse
import os
import resource
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np
from distributed import Client

from brakelab.fleet.cluster import connect
from brakelab.fleet.command import plan
from brakelab.fleet.generate import plant_of, simulate_and_replay
from brakelab.fleet.manifest import Drive, find_drives
from brakelab.fleet.run import Chain, Planned, run_fleet
from brakelab.fleet.task import replay_job
from brakelab.replay.source import load_source
from ecu.config import load_config
from ecu.resources import named

SECONDS: Final = 600
"""Of a simulated drive."""
VEHICLES: Final = 30


@contextmanager
def _warm(workers: int, chains: Sequence[Chain]) -> Iterator[Client]:
    """Give a client whose workers have all the code loaded."""
    with connect(None, workers) as client:
        job = chains[0].job(Path(), rows=False)
        for worker in client.nthreads():
            client.submit(replay_job, job, workers=[worker], pure=False).result()
        yield client


def _peak_megabytes() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def _by_workers(workers: int, drives: Sequence[Drive]) -> dict[str, float]:
    with TemporaryDirectory() as folder, _warm(workers, plan(drives, None)) as client:
        chains = plan(drives, None)
        work = sum(client.run(time.process_time).values())
        began, parent = time.perf_counter(), time.process_time()
        done = [summary for _, summary, _ in run_fleet(client, chains, Path(folder))]
        wall, parent = time.perf_counter() - began, time.process_time() - parent
        work = sum(client.run(time.process_time).values()) - work
        busy = sum(summary["replay_seconds"] for summary in done)
        peaks = client.run(_peak_megabytes).values()
    return {
        "wall": wall,
        "busy": busy / (workers * wall),
        "parent": 1e3 * parent / len(drives),
        "work": 1e3 * work / len(drives),
        "peak": max(peaks),
    }


def _alone(drives: Sequence[Drive]) -> tuple[float, float]:
    """Replay without Dask; returns wall time and processor time in all."""
    began, work = time.perf_counter(), time.process_time()
    for chain in plan(drives, None):
        while chain.place < len(chain.drives):
            chain.finish(replay_job(chain.job(Path(), rows=False)))
    return time.perf_counter() - began, time.process_time() - work


def scaling(manifest: Path, rounds: int, count: int) -> None:
    """Print times of the same drives without Dask, by one worker and by two.

    Wall times hold where nothing else runs. Of processor time others take none: the share of the replays in
    all that was spent is what a machine with nothing else to do would come to.
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
                f"CPU each {took['work']:.0f} ms workers, {took['parent']:.0f} ms client and scheduler; "
                f"peak {took['peak']:.0f} MB a worker",
                flush=True,
            )
    walls, works = 100.0 * np.median(shares, axis=0)
    print(f"efficiency in the median: {walls:.0f} % by wall time, {works:.0f} % by processor time")


def _simulated(kilometres: float) -> list[Chain]:
    """Return chains that hold more drives than needed."""
    source = load_source(None)
    drives = int(kilometres / 5.0 / VEHICLES) + 1
    chains = []
    for vehicle in range(VEHICLES):
        path = named(plant_of(vehicle), "config")
        config, chain = load_config(path), Chain()
        for k in range(drives):
            drive = Drive(f"{vehicle}", f"{k}", (f"{vehicle}/{k}/{SECONDS}",), path, None)
            chain.add(Planned(drive, config, source, SECONDS, f"{k}", ""))
        chains.append(chain)
    return chains


def distance(kilometres: float, minutes: float, workers: int) -> None:
    """Print how far simulated drives came in `minutes`, and what `kilometres` would take."""
    done: list[dict[str, Any]] = []
    with TemporaryDirectory() as folder, connect(None, workers) as client:
        chains = _simulated(kilometres)
        began = time.perf_counter()
        for _, summary, _ in run_fleet(client, chains, Path(folder), task=simulate_and_replay):
            done.append(summary)
            wall = time.perf_counter() - began
            if wall > 60.0 * minutes or sum(row["distance"] for row in done) > 1e3 * kilometres:
                break
        peaks = client.run(_peak_megabytes).values()
        kept = sum(file.stat().st_size for file in Path(folder).rglob("*.parquet"))
    driven, hours = (sum(row[name] for row in done) for name in ("distance", "duration"))
    replayed, simulated = (sum(row[f"{name}_seconds"] for row in done) for name in ("replay", "simulate"))
    share = 1e3 * kilometres / driven
    errors = [row["prediction_error"] for row in done if row.get("prediction_error") is not None]
    print(
        f"{len(done)} drives, {1e-3 * driven:.0f} km, {hours / 3600:.1f} h in {wall:.0f} s, "
        f"{workers} workers, load {os.getloadavg()[0]:.1f}\n"
        f"simulated {hours / simulated:.0f} times, replayed {hours / replayed:.0f} times as fast as driven; "
        f"in tasks {100 * (replayed + simulated) / (workers * wall):.1f} % of the time\n"
        f"prediction off by {100 * float(np.median(errors)):.1f} % (median), "
        f"failed {sum(bool(row['fault']) for row in done)}; peak {max(peaks):.0f} MB a worker, "
        f"{1e-3 * kept / len(done):.0f} kB kept a drive\n"
        f"{kilometres:.0f} km: {share * wall / 3600:.1f} h at this rate, replay alone "
        f"{share * replayed / workers / 3600:.1f} h"
    )


def main() -> None:
    """Measure what the command line asks for."""
    parser = argparse.ArgumentParser(prog="python -m brakelab.fleet.measure")
    what = parser.add_subparsers(dest="what", required=True)
    one = what.add_parser("scaling")
    one.add_argument("manifest", type=Path)
    one.add_argument("--rounds", type=int, default=3)
    one.add_argument("--drives", type=int, default=100)
    two = what.add_parser("distance")
    two.add_argument("--kilometres", type=float, default=30_000.0)
    two.add_argument("--minutes", type=float, default=5.0)
    two.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    if given.what == "scaling":
        scaling(given.manifest, given.rounds, given.drives)
    else:
        distance(given.kilometres, given.minutes, given.workers)


if __name__ == "__main__":
    main()
