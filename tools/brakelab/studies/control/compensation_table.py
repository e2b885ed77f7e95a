"""The tables of docs/results/compensation.md."""

from typing import Final

import numpy as np

from brakelab.arrays import Matrix, Vector
from brakelab.results.text_table import Table, cell
from brakelab.results.verdict import Goal, met, verdict
from brakelab.studies.control.compensation import (
    CURVES,
    FADE_RUNS,
    LEVELS,
    MANOEUVRES,
    RUNS,
    SETTLED_S,
    Car,
)
from brakelab.studies.measure import Figure, figure

FIRST_WITHIN: Final = 5.0  # %, first application
WITHIN: Final = 3.0  # %, later ones
FADE_WITHIN: Final = 4.0  # %


def _cell(value: Figure) -> str:
    return f"{value.median:.1f} ({value.high:.1f})"


def _mean_and_worst(errors: Vector) -> str:
    known = errors[np.isfinite(errors)]
    return f"{known.mean():.1f} ({known.max():.1f})" if len(known) > 0 else "–"


FIGURES: Final = (
    ("5.9", "repeated", "effective compensation even with large changes of friction"),
    ("5.10", "repeated, motors take 70 %", "the same with motors at f = 0.7"),
    ("5.11a", CURVES[0], "under- and over-braking far from the ideal curve, compensated close to it"),
    ("5.11b", CURVES[2], "with motors friction disturbs far less"),
    ("5.12a", CURVES[1], "at 50 mm/s compensated on the desired curve as well"),
    ("5.12b", CURVES[3], "the same with motors"),
)
"""Of section 5.7: number, manoeuvre, statement."""


def _mean_error(cars: list[Car], name: str, kind: str) -> float:
    """Return the mean size [%] of a manoeuvre's errors to the ideal, from the second application on."""
    if name in CURVES:
        errors = np.concatenate([car.levels[name, kind][0].ravel() for car in cars])
    else:
        errors = np.concatenate([car.errors[name, kind][1:] for car in cars])
    return float(np.nanmean(np.abs(errors)))


def _figure_table(cars: list[Car]) -> Table:
    rows = [
        (number, claim, *(f"{_mean_error(cars, name, kind):.1f}" for kind in list(RUNS)[1:]))
        for number, name, claim in FIGURES
    ]
    return Table(
        "Figures of section 5.7: what the thesis says of them, and our mean error to the ideal [%]",
        ("figure", "the thesis", *list(RUNS)[1:]),
        rows,
        f"Mean over {len(cars)} cars and the applications from the second on: of the deceleration over "
        "time (5.9, 5.10), at equal pedal over 1 to 6 m/s² (5.11, 5.12). Of 5.8 (compensation abates the "
        "error at every f, and motors the disturbance) the five cars stand in "
        "[blending.md](blending.md). The thesis's figures have no numbers to compare with.",
    )


def _application_table(cars: list[Car]) -> Table:
    rows = []
    for name in MANOEUVRES:
        count = min(len(car.errors[name, kind]) for car in cars for kind in list(RUNS)[1:])
        for place in range(count):
            cells = (
                _cell(figure([car.errors[name, kind][place] for car in cars])) for kind in list(RUNS)[1:]
            )
            reached = figure([car.errors[name, "compensated"][place] for car in cars])
            goal = verdict(Goal("", reached.median, FIRST_WITHIN if place == 0 else WITHIN))
            rows.append((f"{name}, {place + 1}", *cells, goal))
    return Table(
        "Deceleration of each application: mean relative error to the ideal [%]",
        ("manoeuvre, application", *list(RUNS)[1:], "goal, compensated"),
        rows,
        f"Median over {len(cars)} cars (worst). Counted from 1 m/s² until the pedal is released. Goals of "
        f"the median: from the second application on within {WITHIN:g}, the first within {FIRST_WITHIN:g}; "
        f"met by {met(row[-1] for row in rows)}.",
    )


def _level_table(cars: list[Car]) -> Table:
    rows = []
    for name in CURVES:
        for kind in ("compensated", "uncompensated"):
            for place, what in enumerate(("deceleration at equal pedal", "pedal at equal deceleration")):
                errors = np.abs(np.concatenate([car.levels[name, kind][place] for car in cars]))
                most = float(np.nanmax(_known_mean(errors)[::2]))
                goal = verdict(Goal("", most, WITHIN)) if kind == "compensated" else "–"
                rows.append((f"{name}: {kind}, {what}", *map(_mean_and_worst, errors.T[::2]), goal))
    return Table(
        "Curve of deceleration over pedal (Figures 5.11, 5.12): relative error to the ideal [%]",
        ("pedal, run", *(f"{level:.0f} m/s²" for level in LEVELS[::2]), "goal"),
        rows,
        "Mean over cars and applications from the second on (worst). The pedal goes to 78 % instead of "
        "60, so that the curve reaches 6 m/s²; – where it had arrived before the car did. Goal of the mean, "
        f"compensated: within {WITHIN:g} at every level.",
    )


def _known_mean(values: Matrix) -> Vector:
    """Return the mean of each column without nan, which is nan where there is no other."""
    count = np.isfinite(values).sum(axis=0)
    return np.asarray(np.nansum(values, axis=0) / np.where(count > 0, count, np.nan))


def mass_table(cars: list[Car]) -> Table:
    """Return the curve's errors beside the cars' masses, which the ECU does not know."""
    rows, rest = [], []
    for seed, car in enumerate(cars):
        means = [_known_mean(car.levels[name, "compensated"][0])[::2] for name in CURVES[:2]]
        chosen = np.concatenate([mean[[0, 2, 5]] for mean in means])
        rest.append(chosen - car.excess)
        cells = (cell(value, "+.1f") for value in chosen)
        rows.append((f"car {seed}", f"{car.excess:+.1f}", *cells))
    left = _known_mean(np.array(rest))
    scatter = np.sqrt(_known_mean((np.array(rest) - left) ** 2))
    rows.append(
        ("mean less mass (σ)", "", *(f"{a:+.1f} ({b:.1f})" for a, b in zip(left, scatter, strict=True)))
    )
    return Table(
        "What the curve's error consists of: with its sign, compensated [%]",
        ("", "mass", *(f"{pedal} mm/s: {level} m/s²" for pedal in (150, 50) for level in (1, 3, 6))),
        rows,
        "Mean over the applications from the second on; mass beyond the configured one. An estimate "
        "learned from deceleration makes the car keep what the pedal asks for whatever it weighs; the ideal "
        "knows friction and not mass, so beside it such a car is off by its mass. What that leaves differs "
        f"between cars by {scatter.min():.1f} to {scatter.max():.1f} % (σ): friction at the beginning of a "
        "brake application, see [control.md](../control.md). –: this car did not get there.",
    )


def _fade_table(cars: list[Car]) -> Table:
    rows, most = [], 0.0
    count = min(len(car.fade[kind][0]) for car in cars for kind in FADE_RUNS)
    for stop in range(count):
        friction = np.mean([car.fade["compensated"][1][stop] for car in cars])
        pedals = [figure([car.fade[kind][0][stop] for car in cars]) for kind in FADE_RUNS]
        change = [
            100.0 * (car.fade["compensated"][0][stop] / car.fade["compensated"][0][0] - 1.0) for car in cars
        ]
        most = max(most, *np.abs(change))
        rows.append(
            (
                str(stop + 1),
                f"{friction:.3f}",
                *(f"{p.median:.1f} ({p.low:.1f}–{p.high:.1f})" for p in pedals),
                f"{min(change):+.1f} to {max(change):+.1f}",
            )
        )
    return Table(
        "Fade (section 6.2.3): pedal [%] that keeps 3.4 m/s²",
        ("stop", "front friction", *FADE_RUNS, "compensated, change since stop 1 [%]"),
        rows,
        f"Median over {len(cars)} cars (least–greatest); the pedal from {SETTLED_S} s after the first "
        f"touch on. Goal: every car within {FADE_WITHIN:g} % of its first stop; "
        f"{verdict(Goal('', most, FADE_WITHIN))}.",
    )


def compensation_tables(cars: list[Car]) -> list[Table]:
    """Return the tables of the page."""
    return [
        _figure_table(cars),
        _application_table(cars),
        _level_table(cars),
        mass_table(cars),
        _fade_table(cars),
    ]
