"""Fleet of simulated cars, as test data for `brake-ecu fleet`.

```
python -m brakelab.bench.fleet_drives --vehicles 20 --drives 10 --seconds 60 --out FOLDER [--damage]
```
writes `FOLDER/<vehicle>/<drive>.log` (of every fourth vehicle `.parquet`, decoded) and a `manifest.toml`.
A car is drawn once; its drives, half a week apart, differ in route, weather and noise.
"""

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np

from brakelab.fleet.job import Job, Outcome
from brakelab.fleet.task import replay_job
from brakelab.logs.candump_text import candump_text
from brakelab.results.processes import new_pool
from brakelab.results.progress import progress_bar
from brakelab.simulation.closed_loop import START_NS, VEHICLE_BUS, new_loop, run, run_blocks
from brakelab.simulation.scenario import Scenario
from brakelab.simulation.simulate import write_columns
from ecu.settings.config import load_config
from ecu.settings.resources import named

PLANTS: Final = ("suv", "sedan", "lcv")
FIRST_NS: Final = 1_767_600_000_000_000_000  # Monday, 5 January 2026, 08:00 UTC
BETWEEN_NS: Final = 302_400_000_000_000  # half a week


def plant_of(vehicle: int) -> str:
    """Return the model of a car: its name in config/ and config/plant."""
    return PLANTS[vehicle % len(PLANTS)]


def scenario_of(vehicle: int, drive: int, seconds: float) -> Scenario:
    """Return a drive of about `seconds` with a brake application every 10 to 30 s (assumption)."""
    draw = np.random.default_rng([vehicle, drive, 7])
    speed = float(draw.uniform(8.0, 25.0))
    initial, left = speed, seconds
    phases: list[dict[str, Any]] = []
    while left > 0.0:
        cruise, coast = float(draw.uniform(6.0, 18.0)), float(draw.uniform(0.5, 3.0))
        decel, end = float(draw.uniform(1.0, 5.0)), float(draw.uniform(0.0, 0.6)) * speed
        phases += [
            {"kind": "cruise", "speed": speed, "seconds": cruise},
            {"kind": "coast", "seconds": coast},
            {"kind": "brake", "kept_decel": decel, "until_speed": end, "seconds": 15.0},
        ]
        left -= cruise + coast + (speed - end) / decel
        speed = float(draw.uniform(8.0, 33.0))
    ambient = float(draw.uniform(-5.0, 30.0))
    discs = [ambient + float(draw.uniform(0.0, 150.0)) for _ in range(2)]
    return Scenario.model_validate(
        {
            "plant": plant_of(vehicle),
            "initial_speed": initial,
            "initial_disc_temperature": discs,
            "ambient_temperature": ambient,
            "wetness": float(draw.random() < 0.1),
            "phase": phases,
        }
    )


def write_drive(vehicle: int, drive: int, seconds: float, path: Path) -> None:
    """Simulate one drive into `path`: frames as `.log`, or decoded signals as `.parquet`."""
    loop = new_loop(
        scenario_of(vehicle, drive, seconds), load_config(named(plant_of(vehicle), "config")), vehicle
    )
    loop = loop._replace(noise=np.random.default_rng([vehicle, drive, 1]))
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".parquet":
        result = run(loop)
        write_columns(path, result.t, result.inputs, {})
        return
    with path.open("wb") as log:
        for block in run_blocks(loop):
            block.frames["stamp_ns"] += FIRST_NS + drive * BETWEEN_NS - START_NS
            log.write(candump_text(block.frames, VEHICLE_BUS))


def simulate_and_replay(job: Job) -> Outcome:
    """Simulate the drive `<vehicle>/<drive>/<seconds>` of the job, replay it and discard it.

    The summary has `simulate_seconds` too.
    """
    vehicle, drive, seconds = (int(part) for part in job.logs[0].split("/"))
    with TemporaryDirectory(prefix="brake-ecu-fleet-") as folder:
        log = Path(folder, f"{drive}.log")
        began = time.perf_counter()
        write_drive(vehicle, drive, seconds, log)
        simulated = time.perf_counter() - began
        outcome = replay_job(replace(job, logs=(str(log),)))
    outcome.summary["simulate_seconds"] = simulated
    return outcome


def damage(logs: list[Path]) -> None:
    """Damage five logs, each differently: cut, bytes flipped, emptied, another suffix, garbage."""
    draw = np.random.default_rng(5)
    cut, flipped, emptied, renamed, garbage = logs
    cut.write_bytes(cut.read_bytes()[: cut.stat().st_size // 2 + 7])
    content = np.frombuffer(flipped.read_bytes(), np.uint8).copy()
    content[draw.integers(0, len(content), 500)] ^= 0x11
    flipped.write_bytes(content.tobytes())
    emptied.write_bytes(b"")
    renamed.rename(renamed.with_suffix(".dat"))
    garbage.write_bytes(draw.bytes(200_000))


def _task(task: tuple[int, int, float, Path]) -> None:
    write_drive(*task)


def main() -> None:
    """Write the fleet requested on the command line."""
    parser = argparse.ArgumentParser(prog="python -m brakelab.bench.fleet_drives")
    for name, default in (("vehicles", 20), ("drives", 10), ("workers", 2)):
        parser.add_argument(f"--{name}", type=int, default=default)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--damage", action="store_true", help="spoil five of the drives")
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    paths: dict[int, list[Path]] = {
        vehicle: [
            Path(f"{plant_of(vehicle)}-{vehicle:03d}", f"{drive:03d}{'.log' if vehicle % 4 else '.parquet'}")
            for drive in range(given.drives)
        ]
        for vehicle in range(given.vehicles)
    }
    tasks = [
        (vehicle, drive, given.seconds, given.out / path)
        for vehicle, drives in paths.items()
        for drive, path in enumerate(drives)
    ]
    with (
        new_pool(given.workers) as pool,
        progress_bar("simulate", len(tasks)) as advance,
    ):
        for _ in pool.map(_task, tasks):
            advance(1)
    if given.damage:
        spoiled = [(given.out / drives[len(drives) // 2]) for drives in list(paths.values())[:5]]
        damage(spoiled)
        paths[3][given.drives // 2] = paths[3][given.drives // 2].with_suffix(".dat")
    lines = [
        f'[[vehicle]]\nname = "{drives[0].parent}"\nconfig = "{plant_of(vehicle)}"\n'
        f"drives = {json.dumps([path.as_posix() for path in drives])}\n"
        for vehicle, drives in paths.items()
    ]
    (given.out / "manifest.toml").write_text("\n".join(lines), "utf-8")


if __name__ == "__main__":
    main()
