"""`brake-ecu bench thermal`: disc temperature after identification beside its goals, Figures 7.13 to 7.15."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from brakelab.arrays import Array
from brakelab.identify.thermal.model import ROW
from brakelab.identify.thermal.page import cooling_panel
from brakelab.identify.thermal.result import SYMBOLS, values_of
from brakelab.results.chart import BLUE, GREEN, GREY, ORANGE, PINK, Line, Panel
from brakelab.results.processes import run_each
from brakelab.results.text_table import Table
from brakelab.results.verdict import Goal, verdict
from brakelab.studies.study import Asked, Measured, Study, picture
from brakelab.studies.thermal.study import JUDGED, Appraised, Car, Series, drive_car

CARS: Final = 10
FIRST: Final = 3
"""Seed of the first car that is judged: what widens the σ of a fit was chosen on some of those before."""
GOAL: Final = 10.0  # K
INSIDE: Final = (93.0, 99.0)  # %
AXLES: Final = {"front": slice(0, 2), "rear": slice(2, 4)}
FIGURES: Final = {"dry": "7.13", "rain": "7.14"}
LEGEND: Final = (
    ("measured disc", GREY),
    ("ECU", BLUE),
    ("two sigma", PINK),
    ("as configured before; dry", ORANGE),
    ("rain", GREEN),
)


def _over(appraised: Sequence[Appraised], name: str, part: slice) -> Array:
    return np.concatenate([getattr(one, name)[part] for one in appraised])


def _both(values: Array) -> str:
    return f"{np.median(values):.1f} ({np.max(values):.1f})"


def _judged_rows(cars: Sequence[Car]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for number, trip in enumerate(JUDGED):
        for axle, part in AXLES.items():
            each = [car.trips[number] for car in cars]
            after = _over(each, "after", part)
            inside = 100.0 * float(_over(each, "inside", part).mean())
            rows.append(
                (
                    f"{trip.name} ({FIGURES[trip.name]})",
                    axle,
                    f"{_over(each, 'hottest', part).min():.0f}–{_over(each, 'hottest', part).max():.0f}",
                    _both(_over(each, "before", part)),
                    _both(after),
                    f"{np.count_nonzero(after <= GOAL)} of {len(after)}",
                    f"{np.median(_over(each, 'bias', part)):+.1f}",
                    f"{np.median(_over(each, 'sigma', part)):.1f}",
                    f"{inside:.1f}",
                    f"{np.sqrt(np.mean(_over(each, 'normalised', part) ** 2)):.2f}",
                    verdict(Goal("worst", after.max(), GOAL), Goal("inside", inside, INSIDE[1], INSIDE[0])),
                )
            )
    return rows


def _car_rows(cars: Sequence[Car]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for car in cars:
        for axle, part in zip(car.axles, AXLES.values(), strict=True):
            new, old = (values_of(fit.heating, fit.cooling) for fit in (axle.fit, axle.before))
            changes = [f"{100 * (a / b - 1):+.0f}" for a, b in zip(new, old, strict=True)]
            missing = [SYMBOLS[k] for k in range(5) if not axle.fit.identified[k]]
            rows.append(
                (
                    f"{car.seed} {axle.name}",
                    *changes,
                    ", ".join(missing) or "–",
                    f"{100 * axle.errors.heating:.1f} / {100 * axle.errors.cooling:.1f} / "
                    f"{100 * axle.errors.wet:.0f}",
                    *(f"{np.max(trip.after[part]):.1f}" for trip in car.trips),
                    *(f"{100 * trip.inside[part].mean():.0f}" for trip in car.trips),
                )
            )
    return rows


def _rest_row(cars: Sequence[Car], part: slice) -> tuple[str, str]:
    known = np.concatenate([car.trips[0].after[part] for car in cars])
    unknown = np.concatenate([car.unknown_rest[part] for car in cars])
    return _both(known), _both(unknown)


def thermal_tables(cars: Sequence[Car]) -> list[Table]:
    """Return the tables of the page."""
    every = [trip for car in cars for trip in car.trips]
    inside = 100.0 * float(np.mean([trip.inside.mean() for trip in every]))
    within = np.concatenate([trip.after for trip in every]) <= GOAL
    rest = [(axle, *_rest_row(cars, part)) for axle, part in AXLES.items()]
    return [
        Table(
            "Trips that were not identified on",
            ("trip (figure)", "axle", "hottest [°C]", "RMSE before [K]", "RMSE now [K]", "within 10 K",
             "mean error [K]", "mean σ [K]", "inside 2σ [%]", "error over σ, RMS", "goals"),
            _judged_rows(cars),
            f"{len(cars)} cars, two discs an axle; RMSE over the whole trip, median (worst). Before: the "
            "shipped configuration, from a cold start by the same power; now: the ECU itself. Goals: "
            f"{GOAL:g} K of every disc, inside 2σ at {INSIDE[0]:g}–{INSIDE[1]:g} %. All together: "
            f"{np.count_nonzero(within)} of {len(within)} discs within 10 K, inside 2σ at {inside:.1f} %.",
        ),
        Table(
            "Cars",
            ("car", "ξ [%]", "δ0 [%]", "δ1 [%]", "δ0 rain [%]", "δ1 rain [%]", "not identified",
             "σ of ξ / dry / rain [%]", "RMSE dry [K]", "RMSE rain [K]", "inside dry [%]", "inside rain [%]"),
            _car_rows(cars),
            "Parameters: change against the configuration. RMSE: the worse disc of the axle.",
        ),
        Table(
            "A rest that is known",
            ("axle", "RMSE, night known [K]", "unknown [K]"),
            rest,
            "Dry trips, whole, median (worst). Unknown: the discs begin half as hot as the last trip left "
            "them at most, which is how the ECU starts when no clock shows how long it rested (a replay, or "
            "a daemon whose clock was not set).",
        ),
    ]  # fmt: skip


def _disc(title: str, series: Series, corner: int) -> Panel:
    minutes = np.arange(1, len(series.said) + 1, dtype=np.float64) * ROW / 60.0
    said, sigma = series.said[:, corner], series.sigma[:, corner]
    lines = [
        Line(minutes, said - 2.0 * sigma, PINK, True),
        Line(minutes, said + 2.0 * sigma, PINK, True),
        Line(minutes, series.before[:, corner], ORANGE, True),
        Line(minutes, series.true[:, corner], GREY),
        Line(minutes, said, BLUE),
    ]
    low, high = min(float(line.y.min()) for line in lines), max(float(line.y.max()) for line in lines)
    return Panel(title, "min", (0.0, float(minutes[-1])), (low, high), lines)


def thermal_panels(cars: Sequence[Car]) -> list[Panel]:
    """Return Figures 7.13 (dry) and 7.14 (rain): speed, front and rear disc; 7.15: cooling by speed."""
    car, panels = cars[0], []
    for trip, series in zip(JUDGED, car.plotted, strict=True):
        minutes = np.arange(1, len(series.speed) + 1, dtype=np.float64) * ROW / 60.0
        figure, span = FIGURES[trip.name], (0.0, float(minutes[-1]))
        speed = Line(minutes, series.speed, GREY)
        panels.append(Panel(f"{figure} a): {trip.name}, speed [m/s]", "min", span, (0.0, 45.0), [speed]))
        panels.append(_disc(f"{figure} b): front left [°C]", series, 0))
        panels.append(_disc(f"{figure} c): rear left [°C]", series, 2))
        axle = car.axles[len(panels) // 4]
        title = f"7.15: {axle.name}, δ [1/1000 s], before dashed"
        panels.append(cooling_panel(title, axle.fit.cooling, axle.before.cooling))
    return panels


TEXT: Final = (
    "How disc temperature is computed and identified: [disc-temperature.md](../disc-temperature.md). "
    "Cars are drawn (wide) from config/plant/suv.toml. Their discs are measured and judged by a model "
    "that is no lump (tools/brakelab/plant/disc_nodes.py: ring and hat, heat capacity by temperature, "
    "radiation, convection by the 0.8th power of the air's speed, a film of water), about the drawn "
    "numbers, with wind, air at the wheel and rain of the day; thermocouples lag by 1 to 4 s, scatter, "
    "and are off by a constant and a factor. Each car is identified on one dry trip of real driving and "
    "on a rainy one beyond the town, by the ECU's own torque, and judged on another of each by another "
    "driver in other weather, the ECU with what it learned of friction, after a night of rest. "
    "`HEAT_CAPACITY`, `AIR_FLOW` and `RAIN`, which widen the σ of a fit, were chosen on cars 0 and 2, "
    "which are not judged.\n\n"
    "![Figures 7.13 to 7.15](images/disc-temperature.svg)"
)


def _run(asked: Asked) -> Measured:
    cars = run_each("thermal", drive_car, range(FIRST, FIRST + min(asked.seeds, CARS)))
    drawn = picture("disc-temperature.svg", thermal_panels(cars), LEGEND)
    return Measured(thermal_tables(cars), draw=drawn)


STUDY: Final = Study("Disc temperature", TEXT, _run, "disc-temperature")
