"""Recorded drives as samples of 10 ms, each signal twice: from its even and from its odd samples.

Noise of the two halves of a signal is independent. A derivative by one half and a residual by the other have
no noise in common, so a regression over them is not attenuated (`fit`).
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector
from brakelab.logs.physics.judge import judge
from brakelab.logs.physics.line import MOVING
from brakelab.logs.physics.samples import ANY_CAR, SAMPLED, Collector, InputSeries, car_of
from brakelab.replay.engine import new_ecu
from brakelab.replay.log import log_size, replay_log
from brakelab.replay.needed import nothing_usable
from brakelab.replay.quality import Findings
from brakelab.replay.source import announced, check_map, load_source
from brakelab.results.progress import progress_bar
from ecu.contract.records import RecordArray
from ecu.contract.signals import CORNERS, INPUT_SIGNALS
from ecu.errors import UserError
from ecu.output import say

RATE: Final = 100.0  # Hz, of the grid
GAP: Final = 0.15  # s to the nearest sample, beyond which a signal is not known
SLOW_GAP: Final = 0.3  # s, of the speed reference, which may come ten times a second
FEWEST_SAMPLES: Final = 500  # samples of a signal that counts as there
SHORTEST_DRIVE: Final = 15.0  # s of driving
PRESENT: Final = {INPUT_SIGNALS[place].name: column for column, place in enumerate(SAMPLED)}

Rows = NDArray[np.bool_]


class DriveSamples(NamedTuple):
    """One drive on the grid; what the car does not send is not in `halves`."""

    name: str
    halves: dict[str, Vector]
    """Each signal from its even and its odd samples, shape (2, n)."""
    known: dict[str, Rows]
    """Where a sample is near, shape (n,)."""
    spread: dict[str, float]
    """Standard deviation of a sample's noise, by second differences."""

    def __contains__(self, name: object) -> bool:
        return name in self.halves

    def __len__(self) -> int:
        return len(next(iter(self.known.values())))

    def mean(self, name: str) -> Vector:
        """Return a signal by all of its samples, shape (n,)."""
        return np.asarray(self.halves[name].mean(axis=0))

    def has(self, stem: str) -> bool:
        """Return whether all four of a wheel's quantity are there."""
        return all(f"{stem}_{corner}" in self for corner in CORNERS)

    def corners(self, stem: str) -> Vector:
        """Return the four of a wheel's quantity, shape (4, 2, n)."""
        return np.stack([self.halves[f"{stem}_{corner}"] for corner in CORNERS])


def drive_of(name: str, samples: Vector) -> DriveSamples:
    """Return a drive by its samples, shape (n, len(SAMPLED)), NaN: none in this cycle."""
    grid = np.arange(len(samples))
    halves, known, spread = {}, {}, {}
    for signal, column in PRESENT.items():
        there = np.flatnonzero(np.isfinite(samples[:, column]))
        if len(there) < FEWEST_SAMPLES:
            continue
        values = samples[there, column]
        halves[signal] = np.stack([np.interp(grid, there[k::2], values[k::2]) for k in range(2)])
        after = np.minimum(np.searchsorted(there, grid), len(there) - 1)
        near = np.minimum(np.abs(there[after] - grid), np.abs(grid - there[np.maximum(after - 1, 0)]))
        known[signal] = near <= RATE * (SLOW_GAP if signal == "vehicle_speed" else GAP)
        bend = values[2:] - 2.0 * values[1:-1] + values[:-2]
        spread[signal] = float(1.4826 * np.median(np.abs(bend)) / np.sqrt(6.0))
    return DriveSamples(name, halves, known, spread)


def read_drives(paths: Sequence[Path], params: RecordArray, map: Path | None) -> list[DriveSamples]:
    """Read logs or files of decoded signals; `params` is one `PARAMS` of START.

    Raises:
        UserError: a log or `map` is not right, or a drive identifies nothing: wheels missing, standing,
            too short, or an input that physics says is another one.
    """
    source, drives = announced(load_source(map)), []
    with progress_bar("identify vehicle", sum(log_size(path) for path in paths)) as advance:
        for path in paths:
            if map and (line := check_map(map, source, path)):
                say(line)
            findings, rows, collector = Findings(path), [], Collector()
            for block in replay_log(path, new_ecu(params.copy(), None), source, None, findings, advance):
                rows.append(block.samples.copy())
                collector.add(block.samples)
            if nothing_usable([findings]):
                raise UserError(
                    str(path), "", "not one sample of the needed inputs was usable; check the map"
                )
            drive = drive_of(str(path), np.concatenate(rows))
            check(drive, contradictions(collector.series(), params[0]), params[0])
            drives.append(drive)
    return drives


def contradictions(series: InputSeries, params: Any) -> list[str]:
    """Return the lines that physics has on inputs, whether the tyres are START's or any car's.

    START's may be far off, and any car's too small for a large one: a scale is wrong by both.
    """
    lines = judge(series, ANY_CAR).lines
    if not lines:
        return lines
    return min(lines, judge(series, car_of(params)._replace(brakes=None)).lines, key=len)


def check(drive: DriveSamples, wrong: Sequence[str], params: Any) -> None:
    """Refuse a drive that cannot be used; `wrong` are the lines that physics has on its inputs.

    Raises:
        UserError: with the remedy.
    """
    lost = [f"wheel_speed_{corner}" for corner in CORNERS if f"wheel_speed_{corner}" not in drive]
    if lost:
        remedy = "needs the speeds of all four wheels; map them (`map suggest`), or mend the log"
        raise UserError(drive.name, ", ".join(lost), f"{'is' if len(lost) == 1 else 'are'} missing: {remedy}")
    if "accel_x" not in drive:
        raise UserError(drive.name, "accel_x", "is missing: forces follow from it; map it (`map suggest`)")
    speed = drive.corners("wheel_speed").mean(axis=(0, 1)) * float(np.mean(params["wheel_radius"]))
    moving = float(np.count_nonzero(np.abs(speed) > MOVING)) / RATE
    if moving < SHORTEST_DRIVE:
        remedy = f"give a drive of at least {SHORTEST_DRIVE:.0f} s on the move, better ten minutes"
        raise UserError(drive.name, "", f"the car moves for {moving:.0f} s only; {remedy}")
    lines = [line for line in wrong if "offset =" not in line]
    if lines:
        more = f" ({len(lines) - 1} more: `map check`)" if len(lines) > 1 else ""
        place, _, remedy = lines[0].partition(": ")
        raise UserError(drive.name, place, remedy + more)
