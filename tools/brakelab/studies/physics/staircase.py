"""Staircase of the electro-hydraulic brake (A.2.3): dead time and rise time of 13 pressure steps.

Dead time: until the pressure has moved by 1 bar. Rise time: until it has 90 % of the step.
Both count from the demand on. The thesis gives them as figures only. Its 13 steps "with 10 bar pressure
increase across consecutive manoeuvres" can be read as a staircase 0, 10, … 130 bar, or as steps from zero
that grow; both are measured.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.plant.hydraulics import BUILD_UP, RELEASE, advance_pressure
from brakelab.plant.records import HISTORY, PARAMS, STATE, new_record
from brakelab.results.text_table import Table

BAR: Final = 1e5  # Pa
STEPS: Final = 13
DT: Final = 1e-3  # s
HOLD: Final = 0.6  # s, after a step


class Step(NamedTuple):
    """Answer to one step of the demand."""

    start: float  # bar
    end: float
    dead_time: float  # s
    rise_time: float  # s
    overshoot: float  # bar


def respond(start: float, end: float) -> NDArray[np.float64]:
    """Return the pressure [bar] of a calliper after every step of 1 ms, from rest at `start` [bar]."""
    params, state = new_record(PARAMS), new_record(STATE)
    params["pressure_limit"] = 180.0 * BAR
    params["build_up"], params["release"] = BUILD_UP, RELEASE
    params["rise_limit"] = params["fall_limit"] = np.inf
    state["pressure"] = state["turning_point"] = state["demand_history"] = start * BAR
    pressure = np.empty(round(HOLD / DT))
    for place in range(len(pressure)):
        state["place"] = (place + 1) % HISTORY
        state["demand_history"][0, state["place"][0]] = end * BAR
        advance_pressure(params[0], state[0], DT)
        pressure[place] = state["pressure"][0, 0] / BAR
    return pressure


def measure_step(start: float, end: float) -> Step:
    """Return the response to a step of the demand from `start` to `end` [bar]."""
    moved = (respond(start, end) - start) * np.sign(end - start)
    dead = (int(np.argmax(moved >= 1.0)) + 1) * DT
    rise = (int(np.argmax(moved >= 0.9 * abs(end - start))) + 1) * DT
    return Step(start, end, dead, rise, float(moved.max()) - abs(end - start))


def staircase_table() -> Table:
    """Return dead times and rise times of both readings, for build-up and release."""
    rows = []
    for number in range(1, STEPS + 1):
        low, high = 10.0 * (number - 1), 10.0 * number
        cells = []
        for start, end in ((low, high), (high, low), (0.0, high), (high, 0.0)):
            step = measure_step(start, end)
            cells.append(f"{1e3 * step.dead_time:.0f} / {1e3 * step.rise_time:.0f}")
        rows.append((f"{number} ({high:.0f} bar)", *cells))
    return Table(
        "Electro-hydraulic brake: dead time / rise time [ms] of the 13 steps",
        ("step", "up 10 bar", "down 10 bar", "up from zero", "down to zero"),
        rows,
        "Figure A.9 has no numbers. The text says that build-up and release differ in dead time: they do. It "
        "says that they do not differ clearly in rise time: the published models do, by a sixth. It says "
        "that both times depend on the demanded pressure: linear models cannot show that for equal steps "
        "(left); for steps that grow (right) the time to 1 bar falls with the step, the rise time stays.",
    )
