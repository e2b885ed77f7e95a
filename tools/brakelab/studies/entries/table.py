"""Tables of the entries, the best first."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from brakelab.results.prediction import Errors
from brakelab.results.text_table import Table
from brakelab.studies.entries.drives import SETS
from brakelab.studies.entries.study import GROUPS, CarScore, CarScores


class Standing(NamedTuple):
    """One entry over all cars."""

    name: str
    failure: str
    """How it failed, empty if it did not; then every figure below is NaN."""
    nrmse: dict[str, tuple[float, float]]
    """By `GROUPS`: median of front and rear over cars and drives [%]."""
    worst: tuple[float, float]
    """Greatest of both axles over all of these [%]."""
    inside: tuple[float, float]
    """[%]"""
    recorded: tuple[tuple[float, float], ...]
    """By `SETS`: median and greatest over the cars [%]."""
    prediction: Errors | None
    us: float

    @property
    def rank_error(self) -> float:
        """Mean of both axles' medians over `GROUPS` [%]; an entry that failed is last."""
        return float("inf") if self.failure else float(np.mean(list(self.nrmse.values())))


def _two(values: Sequence[tuple[float, float]], greatest: bool = False) -> tuple[float, float]:
    front, rear = np.max(values, axis=0) if greatest else np.median(values, axis=0)
    return float(front), float(rear)


NAN: Final = float("nan")


def _standing(name: str, cars: list[CarScore | str], prediction: Errors | str | None) -> Standing:
    failures = [car for car in [*cars, prediction] if isinstance(car, str)]
    if failures:
        none = dict.fromkeys(GROUPS, (NAN, NAN))
        return Standing(name, failures[0], none, (NAN, NAN), (NAN, NAN), ((NAN, NAN),) * len(SETS), None, NAN)
    scores = [car for car in cars if isinstance(car, CarScore)]
    drives = {group: [drive for car in scores for drive in car.drives[group]] for group in GROUPS}
    every = [drive.inside for group in drives.values() for drive in group]
    first, second = np.mean(every, axis=0)
    recorded = np.array([car.recorded for car in scores])
    return Standing(
        name,
        "",
        {group: _two([drive.nrmse for drive in found]) for group, found in drives.items()},
        _two([drive.nrmse for group in drives.values() for drive in group], greatest=True),
        (float(first), float(second)),
        tuple((float(np.median(column)), float(column.max())) for column in recorded.T),
        prediction if isinstance(prediction, Errors) else None,
        float(np.median([car.us for car in scores])),
    )


def standings(cars: Sequence[CarScores], predictions: dict[str, Errors | str]) -> list[Standing]:
    """Return the entries, the best first and those that failed last."""
    found = [_standing(name, [car[name] for car in cars], predictions.get(name)) for name in cars[0]]
    return sorted(found, key=lambda standing: standing.rank_error)


def _number(value: float, digits: int = 1) -> str:
    return "–" if np.isnan(value) else f"{value:.{digits}f}"


def _axles(two: tuple[float, float]) -> str:
    return "–" if np.isnan(two[0]) else f"{_number(two[0])}/{_number(two[1])}"


def entry_tables(found: Sequence[Standing], cars: int, drive: str) -> list[Table]:
    """Return the tables; `drive`: name of the recorded drive, empty without."""
    friction, sigmas, others = [], [], []
    for rank, one in enumerate(found, 1):
        place = "out" if one.failure else str(rank)
        groups = [_axles(one.nrmse[group]) for group in GROUPS]
        friction.append((one.name, place, *groups, _axles(one.worst)))
        sigmas.append((one.name, *map(_number, one.inside), _number(one.us)))
        sets = [
            "–" if np.isnan(median) else f"{_number(median)} ({_number(worst)})"
            for median, worst in one.recorded
        ]
        errors = one.prediction
        real = (_number(errors.median * 100.0), _number(errors.worst * 100.0)) if errors else ("–", "–")
        others.append((one.name, *sets, *real))
    failed = [f"{one.name}: {one.failure}." for one in found if one.failure]
    counted = next((one.prediction.counted for one in found if one.prediction), 0)
    recorded = f"{drive}: {counted} braking{'' if counted == 1 else 's'}" if drive else "No recorded drive"
    noun = "car" if cars == 1 else "cars"
    return [
        Table(
            "Friction: nRMSE [%]",
            ("entry", "rank", *GROUPS, "worst"),
            friction,
            f"Front/rear, median over {cars} {noun} and their drives; worst: of all of these. Rank: by the "
            "mean of the medians." + "".join(f" {line}" for line in failed),
        ),
        Table(
            "Standard deviation, and time of a step",
            ("entry", "inside 1σ [%]", "inside 2σ [%]", "µs a step"),
            sigmas,
            "Inside: share of time and corners, mean over the same drives; normal errors have 68 and 95; "
            "–: sigma not stated. µs: processor time of `step` called from Python, mean over a drive, median "
            "over drives.",
        ),
        Table(
            "Recorded cars: error of what was known before a brake application [%]",
            ("entry", *SETS, "recorded drive, median", "recorded drive, worst"),
            others,
            f"First the brake force of all wheels, median (worst) over {cars} simulated {noun} of "
            "their median from the third application on, with the signals of a logger alone. Then the "
            f"specific force of brake applications of a real car. {recorded}.",
        ),
    ]
