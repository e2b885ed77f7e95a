"""Times of two programs in one run, in alternating rounds: medians with their spread."""

import gc
import os
import platform
import time
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from brakelab.results.processes import cores
from ecu.jit import compiler_version

NOT_INSTALLED: Final = "{} not installed: in the repository pip install '.[dev]'"


class Figure(NamedTuple):
    """Median, least and greatest value over the rounds."""

    median: float
    low: float
    high: float


class Row(NamedTuple):
    """One line of a table."""

    what: str
    ours: Figure
    peer: Figure | None
    unit: str
    note: str

    @property
    def ratio(self) -> float | None:
        """Ratio of the peer's median to ours; None without a peer."""
        return None if self.peer is None else self.peer.median / self.ours.median


def plain_row(row: Any) -> dict[str, Any]:
    """Return a row for JSON: figures become objects, times get their ratio."""
    values = row._asdict().items()
    plain = {key: value._asdict() if isinstance(value, Figure) else value for key, value in values}
    return plain | {"ratio": row.ratio} if isinstance(row, Row) else plain


Task = Callable[[], float]
"""Runs once; returns the processor time of its thread per item [µs]: other programs count little."""


def timed(run: Callable[[], object], items: int, prepare: Callable[[], object] | None = None) -> Task:
    """Return the task that times `run`, which handles `items`; `prepare` runs before it, untimed."""

    def task() -> float:
        if prepare is not None:
            prepare()
        start = time.thread_time_ns()
        run()
        return (time.thread_time_ns() - start) / (1e3 * items)

    return task


def figure(values: ArrayLike) -> Figure:
    """Return median, least and greatest of `values`."""
    array = np.asarray(values, np.float64)
    return Figure(float(np.median(array)), float(array.min()), float(array.max()))


def alternate(rounds: int, tasks: Sequence[Task]) -> list[Figure]:
    """Run every task once to warm it up, then all of them in turn for `rounds`; return a figure for each."""
    for task in tasks:
        task()
    collecting = gc.isenabled()
    gc.disable()
    try:
        values = [[task() for task in tasks] for _ in range(rounds)]
    finally:
        if collecting:
            gc.enable()
    return [figure(column) for column in zip(*values, strict=True)]


def installed(package: str) -> str:
    """Return "package version"."""
    return f"{package} {version(package)}"


def machine() -> str:
    """Return one line: processor, cores, load, Python, numba, numpy."""
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    return (
        f"{_processor()}, {cores()} cores{load}; {platform.system()} {platform.release()}; "
        f"Python {platform.python_version()}, numba {compiler_version()}, numpy {np.__version__}"
    )


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith(("model name", "Model"))]
    return names[0] if names else platform.machine()
