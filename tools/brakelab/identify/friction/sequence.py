"""A programme of sections, as SAE J2522 (AK Master) is one: `config/rig/ak-master.toml`.

A section is a row of applications at one speed.
"""

from collections.abc import Callable
from itertools import cycle, islice, product
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from brakelab.identify.friction.dynamometer import Bench
from brakelab.identify.friction.recording import Recording, joined
from brakelab.plant.description import PlantFileError, read_file
from brakelab.plant.dynamometer import DECELERATION, PRESSURE, RAMP, new_stop
from brakelab.plant.dynamometer_programme import BAR, KMH, Gate, Levels, Programme, load_programme
from brakelab.plant.friction.law import Positive, Section
from ecu.errors import UserError


class Applications(Section):
    """One section: `level` is a pressure [bar] or a deceleration [m/s^2], as `control` says."""

    name: Annotated[str, Field(min_length=1)]
    control: Literal["pressure", "deceleration"] = "pressure"
    speed: Positive  # km/h
    end_speed: Positive  # km/h
    level: Levels
    temperature: Levels  # degC
    times: Annotated[int, Field(ge=1)] = 1
    ramp: Positive = RAMP  # s, until the level is reached

    def each(self) -> list[tuple[float, float]]:
        """Return level and initial temperature of every application, in order."""
        count = max(len(self.level), len(self.temperature))
        row = zip(cycle(self.level), cycle(self.temperature), strict=False)
        return list(islice(row, count)) * self.times


class Sequence(Section):
    """A programme file of sections."""

    title: str
    mass: Positive | None = None  # kg, that the flywheel stands for; without, the rig's own
    gate: Gate
    section: Annotated[tuple[Applications, ...], Field(min_length=1)]


def load_sequence(path: Path) -> Sequence:
    """Return the programme of a file; of a full factorial a section is a row of levels at one condition.

    Raises `PlantFileError`, one line.
    """
    if "[[section]]" in path.read_text("utf-8"):
        return read_file(path, Sequence)
    return factorial(load_programme(path))


def read_sequence(path: Path) -> Sequence:
    """Return the programme of a user's file. Raises UserError for a file that is none."""
    try:
        return load_sequence(path)
    except PlantFileError as error:
        raise UserError(str(path), error.place, error.remedy) from None
    except (OSError, UnicodeDecodeError):
        raise UserError(str(path), "", "is no text; give a programme as in config/rig") from None


def factorial(programme: Programme) -> Sequence:
    """Return a full factorial as sections, in the order in which it is run."""
    sections = tuple(
        Applications(
            name=f"{temperature:g} °C, {speed:g} km/h",
            control=programme.control,
            speed=speed,
            end_speed=programme.end_speed,
            level=programme.level,
            temperature=(temperature,),
        )
        for temperature, speed in product(programme.temperature, programme.speed)
    )
    return Sequence(title=programme.title, gate=programme.gate, section=sections)


def run_sequence(bench: Bench, sequence: Sequence, advance: Callable[[float], None]) -> Recording:
    """Return the recording of a programme; `advance` hears the share of each stop."""
    parts: list[Recording] = []
    total = sum(len(section.each()) for section in sequence.section)
    for section in sequence.section:
        start, end = KMH * section.speed, KMH * section.end_speed
        for level, wanted in section.each():
            bench.bring_to(sequence.gate, wanted)
            if section.control == "pressure":
                stop = new_stop(PRESSURE, start, end, bench.temperature, pressure=BAR * level)
            else:
                stop = new_stop(DECELERATION, start, end, bench.temperature, deceleration=level)
            stop["ramp"] = section.ramp
            parts.append(bench.measure(stop))
            advance(1.0 / total)
    return joined(parts)
