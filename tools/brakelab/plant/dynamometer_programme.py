"""Programmes of the dynamometer: `config/rig/*.toml`, a full factorial of stops with temperature gates.

Before every stop the disc is brought to the stop's initial temperature: by drags of 5 s if it is colder, by
the air if it is hotter.
"""

from itertools import product
from pathlib import Path
from typing import Annotated, Final, Literal, NamedTuple

from pydantic import Field

from brakelab.plant.description import read_file
from brakelab.plant.dynamometer import (
    AMBIENT,
    DECELERATION,
    DRAG,
    PRESSURE,
    STEP,
    cool,
    mean_friction,
    new_stop,
    run_stop,
)
from brakelab.plant.friction.law import NotNegative, Positive, Section
from brakelab.plant.records import RecordArray

KMH: Final = 1.0 / 3.6  # m/s
BAR: Final = 1e5  # Pa
DRAG_TIME: Final = 5.0  # s
MOST_DRAGS: Final = 100

Levels = Annotated[tuple[Positive, ...], Field(min_length=1)]


class Gate(Section):
    """Preparation of the disc's temperature."""

    warm_speed: Positive  # km/h
    warm_pressure: Positive  # bar
    cool_speed: NotNegative  # km/h


class Programme(Section):
    """A programme file. `level` is a pressure [bar] or a deceleration [m/s^2], as `control` says."""

    title: str
    control: Literal["pressure", "deceleration"]
    speed: Levels  # km/h
    end_speed: Positive  # km/h
    level: Levels
    temperature: Annotated[tuple[Annotated[float, Field(gt=AMBIENT)], ...], Field(min_length=1)]  # degC
    gate: Gate


class StopResult(NamedTuple):
    """One stop of a programme."""

    speed: float  # km/h
    level: float
    temperature: float  # degC, demanded
    start_temperature: float  # degC, reached by the gate
    end_temperature: float  # degC
    mean_by_distance: float


class Gated(NamedTuple):
    seconds: float
    temperature: float  # degC


def load_programme(path: Path) -> Programme:
    """Return the programme of a file. Raises `PlantFileError`, one line."""
    return read_file(path, Programme)


def bring_to(rig: RecordArray, gate: Gate, temperature: float, wanted: float) -> Gated:
    """Return the time to bring the disc from `temperature` to `wanted` [degC], and the temperature reached.

    The attempt ends after 100 drags, for a brake that fades before it is warm enough.
    """
    if temperature > wanted:
        return Gated(cool(rig, KMH * gate.cool_speed, temperature, wanted), wanted)
    seconds = 0.0
    for _ in range(MOST_DRAGS):
        if temperature >= wanted:
            break
        drag = new_stop(
            DRAG,
            KMH * gate.warm_speed,
            0.0,
            temperature,
            pressure=BAR * gate.warm_pressure,
            end_temperature=wanted,
        )
        trace = run_stop(rig, drag, longest=DRAG_TIME)
        seconds += len(trace) * STEP
        temperature = float(trace["temperature"][-1])
        if len(trace) < round(DRAG_TIME / STEP):
            return Gated(seconds, wanted)
    return Gated(seconds, temperature)


def run_programme(programme: Programme, rig: RecordArray) -> list[StopResult]:
    """Run all stops of a programme on `rig`, temperatures outermost; the disc starts at ambient."""
    results = []
    temperature = float(rig[0]["ambient"])
    for wanted, speed, level in product(programme.temperature, programme.speed, programme.level):
        gated = bring_to(rig, programme.gate, temperature, wanted)
        ends = KMH * speed, KMH * programme.end_speed, gated.temperature
        if programme.control == "pressure":
            stop = new_stop(PRESSURE, *ends, pressure=BAR * level)
        else:
            stop = new_stop(DECELERATION, *ends, deceleration=level)
        trace = run_stop(rig, stop)
        temperature = float(trace["temperature"][-1])
        mean = mean_friction(trace, by_distance=True)
        results.append(StopResult(speed, level, wanted, gated.temperature, temperature, mean))
    return results
