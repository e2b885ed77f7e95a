"""Loop timing of a recording: lateness of each cycle and duration of its stages."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from brakelab.arrays import Vector
from ecu.contract.records import STAGES
from ecu.errors import UserError
from ecu.recording.recorder import read_recording


class Timing(NamedTuple):
    """Durations in µs, shape (cycles,)."""

    lateness: Vector
    stages: dict[str, Vector]
    missed: int
    """Periods missed in the whole recording."""


class Spread(NamedTuple):
    """Quantiles of a duration [µs]."""

    p50: float
    p99: float
    p999: float
    worst: float


def spread(durations: Vector) -> Spread:
    """Return median, tails and maximum."""
    return Spread(*map(float, np.quantile(durations, [0.5, 0.99, 0.999, 1.0])))


def spreads(timing: Timing) -> dict[str, Spread]:
    """Return the spread of the lateness and of every stage by name."""
    return {name: spread(values) for name, values in {"lateness": timing.lateness, **timing.stages}.items()}


def read_timing(path: Path) -> Timing:
    """Return the times in a recording, given as its folder or its `cycles.bin`.

    Raises UserError when there is no recording, when it is damaged or has no cycle.
    """
    cycles = read_recording(path.parent if path.is_file() else path).cycles
    if len(cycles) == 0:
        raise UserError(str(path), "no cycle in it", "give a recording of `brake-ecu run --record`")
    stages = cycles["stage_ns"] * 1e-3
    return Timing(
        lateness=cycles["lateness_ns"] * 1e-3,
        stages={name: stages[:, place] for place, name in enumerate(STAGES)},
        missed=int(cycles["missed"].sum()),
    )
