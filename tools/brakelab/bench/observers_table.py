"""Results of `observers` as tables: measured beside the goal."""

import math
from typing import Any, Final

from brakelab.bench.measure import Figure
from brakelab.bench.observers import JOINT, NEVER, Row
from brakelab.bench.observers_cases import ACCURACY, EVENTS, ROBUSTNESS, Case, Goal
from brakelab.bench.observers_picture import Consistency, mean_ratio
from brakelab.bench.table import Table

AXLES: Final = ("front", "rear")
HONEST: Final = (93.0, 99.0)
"""Share of the truth [%] that ±2σ should hold; 95 if errors were Gaussian and σ exact."""
ROUNDING: Final = 0.05  # %

Rows = dict[tuple[str, str, bool], Row]


def finite(value: Any) -> Any:
    """Return JSON content with null for what is not finite."""
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


def _shares(row: Row) -> str:
    return f"{row.inside_2_sigma[0]:.0f}/{row.inside_2_sigma[1]:.0f}"


def _verdict(missed: list[str]) -> str:
    return f"missed: {', '.join(missed)}" if missed else "met"


def _above(row: Row, goal: Goal | None) -> list[str]:
    """Return the axles whose median is above the goal, or not below the constant where there is none."""
    limits = goal or tuple(figure.median for figure in row.nominal)
    return [
        axle
        for axle, reached, limit in zip(AXLES, row.nrmse, limits, strict=True)
        if reached.median > limit + ROUNDING
    ]


def _goal(goal: Goal | None) -> str:
    return "constant" if goal is None else f"{goal[0]:g}/{goal[1]:g}"


def _accuracy(rows: Rows) -> Table:
    lines = []
    for name, case in ACCURACY.items():
        cold, driven_in = rows[name, JOINT, False], rows[name, JOINT, True]
        lines.append(
            (
                name,
                case.thesis,
                _medians(cold.nominal),
                _with_worst(cold.nrmse),
                _goal(case.cold),
                _verdict(_above(cold, case.cold)),
                _with_worst(driven_in.nrmse),
                _goal(case.driven_in),
                _verdict(_above(driven_in, case.driven_in)),
            )
        )
    met = [sum(line[place] == "met" for line in lines) for place in (5, 8)]
    return Table(
        "Joint observer: nRMSE [%]",
        ("case", "thesis, Obs. 2", "constant", "cold", "goal", "", "driven in", "goal", " "),
        lines,
        f"Median (worst car). Goals met: cold {met[0]}, driven in {met[1]} of {len(lines)}. Constant: the "
        "configured 0.45 taken as the estimate. Thesis: Tables 4.3, 5.1, 6.1 (tuned) and 6.3. Pedal: stops "
        "from 100 km/h at about 1, 1.5 and 3 m/s², as Table 6.1 has them; the pedal maps differ.",
    )


def _others(rows: Rows) -> Table:
    lines = [
        (
            name,
            *(
                _with_worst(rows[name, observer, driven_in].nrmse)
                for observer in ("observer1", "observer2")
                for driven_in in (False, True)
            ),
        )
        for name in ACCURACY
    ]
    columns = ("case", "Obs. 1 cold", "Obs. 1 driven in", "Obs. 2 cold", "Obs. 2 driven in")
    return Table(
        "The thesis's observers: nRMSE [%]",
        columns,
        lines,
        "Observer 1 has the wheel transducers, whose force noise is that of Table 4.1; no other observer has.",
    )


def _uncertainty(rows: Rows) -> Table:
    lines, met = [], [0, 0]
    for name in ACCURACY:
        cells = [_shares(rows[name, "observer2", False])]
        for place, driven_in in enumerate((False, True)):
            row = rows[name, JOINT, driven_in]
            missed = [
                axle
                for axle, share in zip(AXLES, row.inside_2_sigma, strict=True)
                if not HONEST[0] <= round(share) <= HONEST[1]
            ]
            met[place] += not missed
            cells += [_shares(row), _verdict(missed)]
        lines.append((name, *cells))
    return Table(
        "Truth inside 2σ [%]",
        ("case", "Obs. 2 cold", "joint cold", "", "joint driven in", " "),
        lines,
        f"Share of all rows of all cars. Goal: {HONEST[0]:.0f} to {HONEST[1]:.0f} on each axle; met cold by "
        f"{met[0]}, driven in by {met[1]} of {len(lines)}. Above it σ is larger than the errors are.",
    )


def _robust_line(name: str, case: Case, rows: Rows) -> tuple[str, ...]:
    cold, driven_in = rows[name, JOINT, False], rows[name, JOINT, True]
    missed = [f"cold {axle}" for axle in _above(cold, None)]
    missed += [f"driven in {axle}" for axle in _above(driven_in, case.driven_in)]
    missed += [
        f"σ {word} {axle}"
        for word, row in (("cold", cold), ("driven in", driven_in))
        for axle, share in zip(AXLES, row.inside_2_sigma, strict=True)
        if round(share) < HONEST[0]
    ]
    return (
        name,
        _medians(cold.nominal),
        _with_worst(cold.nrmse),
        _shares(cold),
        _with_worst(driven_in.nrmse),
        _goal(case.driven_in),
        _shares(driven_in),
        _verdict(missed),
    )


def _robustness(rows: Rows) -> Table:
    lines = [_robust_line(name, case, rows) for name, case in ROBUSTNESS.items()]
    met = sum(line[-1] == "met" for line in lines)
    return Table(
        "Joint observer, disturbed: nRMSE [%] and truth inside 2σ [%]",
        ("case", "constant", "cold", "inside 2σ", "driven in", "goal", "inside 2σ ", ""),
        lines,
        f"Stop #1 unless said otherwise, one car of four; met by {met} of {len(lines)}. Goals: cold better than "
        "the constant, driven in within twice the goal of stop #1, at least 93 % of the truth inside 2σ. Signs "
        "change from car to car. Wrong masses, stiffnesses and heights stand in the configuration, the car "
        "keeps its own. A disturbance of car or sensors is there in the ten minutes before, one of the road "
        "is not. Samples are lost sensor by sensor; whole frames are not.",
    )


def _seconds(figure: Figure) -> str:
    def words(value: float) -> str:
        return "not" if value == NEVER else f"{value:.2f}"

    return f"{words(figure.median)} ({words(figure.high)})"


def _events(rows: Rows) -> Table:
    lines = []
    for name in EVENTS:
        for key, row in rows.items():
            if key[0] == name:
                force = f"{row.force.median:.1f}" if math.isfinite(row.force.median) else "–"
                state = "driven in" if row.driven_in else "cold"
                lines.append(
                    (f"{name}, {row.observer}, {state}", _seconds(row.seconds), force, _with_worst(row.nrmse))
                )
    return Table(
        "How long it takes",
        ("event", "until within 5 % [s]", "force, nRMSE [%]", "friction, nRMSE [%]"),
        lines,
        "Linings 25 % off: nominal friction configured a quarter above that of the car's file, from the first "
        "2 bar until the mean friction of both axles stays within 5 % of the truth; driven in, the linings are "
        "new and the rest is known. The other two (Figures 4.11 and 5.5): from the change, or from when the "
        "last wheel slides by less than 12 %, until no axle's error differs by more than 5 % from what it was "
        "before; the thesis has 100 and 300 ms, read off figures. Force: front wheels, from the change on, or "
        "on the patch, until a second later. Not: not before the end of the stop.",
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
        for place, state in enumerate(("cold", "driven in"))
    ]  # fmt: skip
    return Table(
        "Squared innovations over their variance, mean",
        ("stop #1", "front wheels", "rear wheels", "total force"),
        lines,
        "1 where the assumed noise is that of the car. Below: it is taken as larger than it is.",
    )


def observer_tables(rows: list[Row], times: dict[str, Figure], cars: list[Consistency]) -> list[Table]:
    """Return all tables."""
    found = {(row.case, row.observer, row.driven_in): row for row in rows}
    return [
        _accuracy(found),
        _others(found),
        _uncertainty(found),
        _robustness(found),
        _events(found),
        _consistency(cars),
        _times(times),
    ]
