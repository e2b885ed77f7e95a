"""A programme of sections, as SAE J2522 (AK Master) is one, and its table of means.

A section is a row of applications at one speed. Friction of an application as the standard has it: mean over
distance from 90 % of the pressure on. `config/rig/ak-master.toml` is the programme.
"""

from collections.abc import Callable
from itertools import cycle, islice
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.dynamometer import Bench
from brakelab.identify.friction.recording import Recording, joined
from brakelab.identify.friction.stops import find_stops
from brakelab.plant.description import read_file
from brakelab.plant.dynamometer import DECELERATION, PRESSURE, new_stop
from brakelab.plant.dynamometer_programme import BAR, KMH, Gate, Levels
from brakelab.plant.friction.law import Positive, Section
from brakelab.results.text_table import Table


class Applications(Section):
    """One section: `level` is a pressure [bar] or a deceleration [m/s^2], as `control` says."""

    name: Annotated[str, Field(min_length=1)]
    control: Literal["pressure", "deceleration"] = "pressure"
    speed: Positive  # km/h
    end_speed: Positive  # km/h
    level: Levels
    temperature: Levels  # degC
    times: Annotated[int, Field(ge=1)] = 1

    def each(self) -> list[tuple[float, float]]:
        """Return level and initial temperature of every application, in order."""
        count = max(len(self.level), len(self.temperature))
        row = zip(cycle(self.level), cycle(self.temperature), strict=False)
        return list(islice(row, count)) * self.times


class Sequence(Section):
    """A programme file of sections."""

    title: str
    gate: Gate
    section: Annotated[tuple[Applications, ...], Field(min_length=1)]


class Means(NamedTuple):
    """One section as measured; arrays of shape (applications,)."""

    name: str
    asked: str
    mu: NDArray[np.float64]
    start: NDArray[np.float64]  # degC
    end: NDArray[np.float64]  # degC
    pressure: NDArray[np.float64]  # Pa


def has_sections(path: Path) -> bool:
    """Return whether a programme file is one of sections."""
    return "[[section]]" in path.read_text("utf-8")


def load_sequence(path: Path) -> Sequence:
    """Return the programme of a file. Raises `PlantFileError`, one line."""
    return read_file(path, Sequence)


def run_sequence(
    bench: Bench, sequence: Sequence, columns: Columns, advance: Callable[[float], None]
) -> tuple[Recording, list[Means]]:
    """Return the recording of a programme and its means; `advance` hears the share of each stop."""
    parts: list[Recording] = []
    means = []
    total = sum(len(section.each()) for section in sequence.section)
    for section in sequence.section:
        begin = len(parts)
        start, end = KMH * section.speed, KMH * section.end_speed
        for level, wanted in section.each():
            bench.bring_to(sequence.gate, wanted)
            if section.control == "pressure":
                stop = new_stop(PRESSURE, start, end, bench.temperature, pressure=BAR * level)
            else:
                stop = new_stop(DECELERATION, start, end, bench.temperature, deceleration=level)
            parts.append(bench.measure(stop))
            advance(1.0 / total)
        means.append(_means(section, parts[begin:], columns))
    return joined(parts), means


def _means(section: Applications, parts: list[Recording], columns: Columns) -> Means:
    found = [find_stops(part, columns, section.name) for part in parts]
    unit = "bar" if section.control == "pressure" else "m/s²"
    low, high = min(section.level), max(section.level)
    levels = f"{low:g}" if low == high else f"{low:g} to {high:g}"
    return Means(
        section.name,
        f"{section.speed:.0f} to {section.end_speed:.0f} km/h, {levels} {unit}",
        np.array([stops.mean[0] for stops in found]),
        np.array([stops.start_temperature[0] for stops in found]),
        np.array([float(part.temperature[-1]) for part in parts]),
        np.array([stops.held_pressure[0] for stops in found]),
    )


def means_table(title: str, means: list[Means]) -> Table:
    """Return the usual table: mean, least and greatest friction of every section."""
    rows = [
        (
            each.name,
            each.asked,
            str(len(each.mu)),
            f"{each.mu.mean():.3f}",
            f"{each.mu.min():.3f}",
            f"{each.mu.max():.3f}",
            f"{each.mu[-1]:.3f}",
            f"{each.start.min():.0f} to {each.start.max():.0f}",
            f"{each.end.max():.0f}",
        )
        for each in means
    ]
    columns = ("section", "asked", "n", "mean μ", "least", "greatest", "last", "from [°C]", "to [°C]")
    return Table(title, columns, rows, _summary(means))


def _summary(means: list[Means]) -> str:
    """Return nominal, cold and least fade friction in one line, where the programme has them."""
    of = {each.name.split(" ", 1)[-1]: each.mu for each in means}
    stated = [
        (label, float(of[name].min() if "fade" in name else of[name].mean()))
        for name, label in (
            ("characteristic value 3", "nominal"),
            ("cold", "cold"),
            ("fade 1", "least in fade 1"),
            ("fade 2", "least in fade 2"),
        )
        if name in of
    ]
    return f"Friction: {', '.join(f'{label} {mu:.3f}' for label, mu in stated)}." if stated else ""
