"""Results of `observers` as tables: measured beside the goal."""

import math
from typing import Any, Final

import numpy as np

from brakelab.results.text_table import Table, cell
from brakelab.studies.accuracy.observers import JOINT, NEVER, Row
from brakelab.studies.accuracy.observers_cases import (
    ACCURACY,
    EVENTS,
    LONGEST_EFFECT,
    LOST_IN_GAPS,
    ROBUSTNESS,
    SENSORS,
    TRANSDUCERS,
    Goal,
    goals,
)
from brakelab.studies.accuracy.observers_picture import Consistency, mean_ratio
from brakelab.studies.measure import Figure

AXLES: Final = ("front", "rear")
HONEST: Final = (93.0, 99.0)
"""Share of the truth [%] that ±2σ should hold; 95 if errors were Gaussian and σ exact."""
ROUNDING: Final = 0.05  # %
ROUNDING_S: Final = 0.005

Rows = dict[tuple[str, str, bool], Row]


def finite(value: Any) -> Any:
    """Return JSON content with null for non-finite values."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, Figure):
        return finite(value._asdict())
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _medians(pair: tuple[Figure, Figure]) -> str:
    return f"{pair[0].median:.2f}/{pair[1].median:.2f}"


def _with_worst(pair: tuple[Figure, Figure]) -> str:
    return f"{_medians(pair)} ({pair[0].high:.1f}/{pair[1].high:.1f})"


def _shares(inside_2_sigma: tuple[float, float]) -> str:
    return f"{inside_2_sigma[0]:.0f}/{inside_2_sigma[1]:.0f}"


def _verdict(missed: list[str]) -> str:
    return f"missed: {', '.join(missed)}" if missed else "met"


def _above(row: Row, goal: Goal | None) -> list[str]:
    """Return the axles whose median exceeds the goal, or the constant without one, and by how much."""
    limits = goal or tuple(figure.median for figure in row.nominal)
    return [
        f"{axle} by {reached.median - limit:.2g}"
        for axle, reached, limit in zip(AXLES, row.nrmse, limits, strict=True)
        if reached.median > limit + ROUNDING
    ]


def _goal(goal: Goal | None) -> str:
    return "constant" if goal is None else f"{goal[0]:g}/{goal[1]:g}"


def _accuracy(rows: Rows, draw: str) -> Table:
    lines = []
    for name, case in ACCURACY.items():
        cold, adapted = rows[name, JOINT, False], rows[name, JOINT, True]
        cold_goal, adapted_goal = goals(name, draw)
        lines.append(
            (
                name,
                case.thesis,
                _medians(cold.nominal),
                _with_worst(cold.nrmse),
                _goal(cold_goal),
                _verdict(_above(cold, cold_goal)),
                _with_worst(adapted.nrmse),
                _goal(adapted_goal),
                _verdict(_above(adapted, adapted_goal)),
            )
        )
    met = [sum(line[place] == "met" for line in lines) for place in (5, 8)]
    return Table(
        "Joint observer: nRMSE [%]",
        ("case", "thesis, Obs. 2", "constant", "cold", "goal", "", "adapted", "goal", " "),
        lines,
        f"Median (worst car). Goals met: cold {met[0]}, adapted {met[1]} of {len(lines)}. Constant: the "
        "configured 0.45 taken as the estimate. Thesis: Tables 4.3, 5.1, 6.1 (tuned) and 6.3. Pedal: stops "
        "from 100 km/h at about 1, 1.5 and 3 m/s², as Table 6.1 has them; the pedal maps differ.",
    )


def _others(rows: Rows) -> Table:
    lines = [
        (
            name,
            *(
                _with_worst(rows[name, observer, adapted].nrmse) if (name, observer, adapted) in rows else "–"
                for observer in ("observer1", "observer2")
                for adapted in (False, True)
            ),
        )
        for name in (*ACCURACY, *TRANSDUCERS)
    ]
    columns = ("case", "Obs. 1 cold", "Obs. 1 adapted", "Obs. 2 cold", "Obs. 2 adapted")
    return Table(
        "The thesis's observers: nRMSE [%]",
        columns,
        lines,
        "Observer 1 alone has the wheel transducers; the noise of their forces is that of Table 4.1. "
        "Last row: each wheel's zero within 0.5 % of 35 kN, and 1 % of crosstalk as an error of scale (Table "
        "D.2).",
    )


def _honesty(shares: tuple[float, float]) -> list[str]:
    """Return the axles whose ±2σ contains too little or too much, and by how much."""
    return [
        f"{axle} {'small' if share < HONEST[0] else 'large'} by {_beyond(share)}"
        for axle, share in zip(AXLES, shares, strict=True)
        if not HONEST[0] <= round(share) <= HONEST[1]
    ]


def _beyond(share: float) -> int:
    return round(max(HONEST[0] - round(share), round(share) - HONEST[1]))


def _uncertainty(rows: Rows) -> Table:
    def cells(name: str, shares: list[tuple[float, float]]) -> tuple[str, ...]:
        observer2, cold, adapted = shares
        words = _verdict(_honesty(cold)), _verdict(_honesty(adapted))
        return name, _shares(observer2), _shares(cold), words[0], _shares(adapted), words[1]

    keys = (("observer2", False), (JOINT, False), (JOINT, True))
    shares = {name: [rows[name, *key].inside_2_sigma for key in keys] for name in ACCURACY}
    lines = [cells(name, found) for name, found in shares.items()]
    means = np.mean(list(shares.values()), axis=0)
    lines.append(cells("all", [(float(front), float(rear)) for front, rear in means]))
    met = [sum(line[place] == "met" for line in lines[:-1]) for place in (3, 5)]
    return Table(
        "Truth inside 2σ [%]",
        ("case", "Obs. 2 cold", "joint cold", "", "joint adapted", " "),
        lines,
        f"Share of all rows of all cars. Goal: {HONEST[0]:.0f} to {HONEST[1]:.0f} on each axle; met cold by "
        f"{met[0]}, adapted by {met[1]} of {len(ACCURACY)}. Small, large: so is σ beside the errors. An "
        "error hardly changes within a stop, so each car counts about once.",
    )


def _robust_line(name: str, rows: Rows, draw: str) -> tuple[str, ...]:
    cold, adapted = rows[name, JOINT, False], rows[name, JOINT, True]
    _, goal = goals(name, draw)
    missed = [f"cold {axle}" for axle in _above(cold, None)]
    missed += [f"adapted {axle}" for axle in _above(adapted, goal)]
    missed += [
        f"σ {word} {axle} by {_beyond(share)}"
        for word, row in (("cold", cold), ("adapted", adapted))
        for axle, share in zip(AXLES, row.inside_2_sigma, strict=True)
        if round(share) < HONEST[0]
    ]
    return (
        name,
        _medians(cold.nominal),
        _with_worst(cold.nrmse),
        _shares(cold.inside_2_sigma),
        _with_worst(adapted.nrmse),
        _goal(goal),
        _shares(adapted.inside_2_sigma),
        _verdict(missed),
    )


def _robustness(rows: Rows, draw: str) -> Table:
    lines = [_robust_line(name, rows, draw) for name in ROBUSTNESS]
    met = sum(line[-1] == "met" for line in lines)
    return Table(
        "Joint observer, disturbed: nRMSE [%] and truth inside 2σ [%]",
        ("case", "constant", "cold", "inside 2σ", "adapted", "goal", "inside 2σ ", ""),
        lines,
        f"Stop #1 unless said otherwise, one car of four; met by {met} of {len(lines)}. Goals: cold better "
        "than the constant, adapted within twice the goal of stop #1, at least 93 % of the truth inside "
        "2σ. Signs change from car to car. Wrong masses, stiffnesses, gradients and heights stand in the "
        "configuration, the car keeps its own. A disturbance of car or sensors is there in the ten minutes "
        "before, one of the road, and the loss of a wheel sensor, is not. Samples are lost sensor by sensor, "
        "whole frames are not; in gaps of 180 ms each sensor loses "
        f"{100.0 * LOST_IN_GAPS:.0f} % of them.",
    )


def _quarter_more(pair: tuple[Figure, Figure]) -> Goal:
    return 1.25 * pair[0].median, 1.25 * pair[1].median


def _sensors(rows: Rows) -> Table:
    lines = []
    for name, case in SENSORS.items():
        line, missed = [name, case.beside or "–"], []
        for state, adapted in (("cold", False), ("adapted", True)):
            row = rows[name, JOINT, adapted]
            line += [_with_worst(row.nrmse), _shares(row.inside_2_sigma)]
            if case.beside:
                limit = _quarter_more(rows[case.beside, JOINT, adapted].nrmse)
                missed += [f"{state} {axle}" for axle in _above(row, limit)]
        lines.append((*line, _verdict(missed) if case.beside else "–"))
    return Table(
        "Joint observer with sensors as cars have them: nRMSE [%] and truth inside 2σ [%]",
        ("case", "beside", "cold", "inside 2σ", "adapted", "inside 2σ ", ""),
        lines,
        "One car of four, stops of 4 m/s² unless said otherwise. Goal: within a quarter of the case beside "
        "it. Cruises are at 100 km/h, with that noise of each wheel's motor torque. A case with less of a "
        "signal has it in the ten minutes before too.",
    )


def _seconds(figure: Figure) -> str:
    def words(value: float) -> str:
        return "not" if value == NEVER else f"{value:.2f}"

    return f"{words(figure.median)} ({words(figure.high)})"


def _event_verdict(row: Row, rows: Rows) -> str:
    """Return whether the time is met and the force error half that of Observer 2; "–" without a goal."""
    longest = LONGEST_EFFECT.get(row.case)
    if longest is None or row.observer != JOINT:
        return "–"
    half = 0.5 * rows[row.case, "observer2", row.adapted].force.median
    late, force = row.seconds.median - longest, row.force.median - half
    missed = [f"time by {late:.2g}"] if late > ROUNDING_S else []
    return _verdict(missed + ([f"force by {force:.2g}"] if force > 0.0 else []))


def _events(rows: Rows) -> Table:
    lines = []
    for row in rows.values():
        if row.case not in EVENTS:
            continue
        longest = LONGEST_EFFECT.get(row.case)
        lines.append(
            (
                f"{row.case}, {row.observer}, {'adapted' if row.adapted else 'cold'}",
                _seconds(row.seconds),
                f"{longest:.2f}" if longest is not None else "–",
                cell(row.force.median, ".1f"),
                _with_worst(row.nrmse),
                _event_verdict(row, rows),
            )
        )
    return Table(
        "How long it takes",
        ("event", "until within 5 % [s]", "goal", "force, nRMSE [%]", "friction, nRMSE [%]", ""),
        lines,
        "Linings 25 % off: nominal friction configured a quarter above that of the car's file, from the "
        "first 2 bar until the mean friction of both axles stays within 5 % of the truth; adapted, the "
        "linings are new and the rest is known. The other two (Figures 4.11 and 5.5): from the change, or "
        "from when the last wheel slides by less than 12 %, until no axle's error differs by more than 5 % "
        "from what it was before. Goals of the joint observer: these times, and half the force error of "
        "Observer 2. Force: front wheels, from the change on, or on the patch, until a second later. Not: "
        "not before the end of the stop.",
    )


def _times(times: dict[str, Figure]) -> Table:
    lines = [(name, f"{time.median:.2f}", f"{time.low:.2f}–{time.high:.2f}") for name, time in times.items()]
    return Table(
        "Processor time of a whole cycle [µs]",
        ("observer", "median", "least–greatest"),
        lines,
        "`step` with everything before and after the observer, while braking (stop #1).",
    )


def _consistency(cars: list[Consistency]) -> Table:
    lines = [
        (state, f"{mean_ratio(cars, place, slice(0, 2)):.2f}", f"{mean_ratio(cars, place, slice(2, 4)):.2f}",
         f"{mean_ratio(cars, place, slice(4, 5)):.2f}")
        for place, state in enumerate(("cold", "adapted"))
    ]  # fmt: skip
    return Table(
        "Squared innovations over their variance, mean",
        ("stop #1", "front wheels", "rear wheels", "total force"),
        lines,
        "1 where the assumed noise is that of the car. Below: it is taken as larger than it is.",
    )


def observer_tables(
    rows: list[Row], times: dict[str, Figure], cars: list[Consistency], draw: str
) -> list[Table]:
    """Return all tables."""
    found = {(row.case, row.observer, row.adapted): row for row in rows}
    return [
        _accuracy(found, draw),
        _others(found),
        _uncertainty(found),
        _robustness(found, draw),
        _sensors(found),
        _events(found),
        _consistency(cars),
        _times(times),
    ]
