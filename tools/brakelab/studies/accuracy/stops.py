"""Accuracy in the stops of the thesis's Table 4.2, with cars drawn per seed.

Errors and rows that count: `simulation/accuracy.py`. Friction stands beside Observer 2 of Table 4.3 and the
configured friction taken as the estimate.

compensation  mean of |achieved - wanted| / wanted; wanted is the demand, or the deceleration
              achieved by the same controller in the same car with the true friction
"""

from collections.abc import Callable, Iterable
from functools import partial
from itertools import product
from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Vector
from brakelab.results.processes import run_each
from brakelab.results.text_table import Table
from brakelab.simulation.accuracy import AXLES, achieved_decel, friction_errors, window
from brakelab.simulation.closed_loop import Drive, new_loop, run
from brakelab.simulation.configured import shipped, with_keys
from brakelab.simulation.scenario import Scenario
from brakelab.simulation.scenario_car import with_draw
from brakelab.studies.measure import Figure, figure, plain_row
from brakelab.studies.study import Asked, Measured, Study
from ecu.settings.config import Config, config_hash, load_config
from ecu.settings.resources import resource

TESTS: Final = (1, 2, 3, 4)
SEEDS: Final = 20
TABLE_4_3: Final = {
    1: {"front": 4.74, "rear": 7.23},
    2: {"front": 3.34, "rear": 6.96},
    3: {"front": 4.55, "rear": 8.51},
    4: {"front": 3.13, "rear": 7.87},
}
"""nRMSE of Observer 2 in %."""


class Friction(NamedTuple):
    """Errors of one axle's friction over the seeds, in %."""

    test: int
    vehicle_speed: bool
    axle: str
    nrmse: Figure
    inside_2_sigma: float
    """Share of the samples whose truth lies within ±2σ."""
    thesis: float
    nominal: Figure
    """nRMSE of the configured nominal friction."""


class Compensation(NamedTuple):
    """Relative errors of the deceleration over the seeds, in %."""

    test: int
    vehicle_speed: bool
    to_demand: Figure
    to_demand_uncompensated: Figure
    to_ideal: Figure
    to_ideal_uncompensated: Figure


class Stops(NamedTuple):
    """Result of all stops."""

    friction: list[Friction]
    compensation: list[Compensation]


class _Stop(NamedTuple):
    drive: Drive
    decel: Vector


def _brake(scenario: Scenario, config: Config, seed: int, ideal: bool = False) -> _Stop:
    loop = new_loop(scenario, config, seed)
    drive = run(loop, ideal)
    return _Stop(drive, achieved_decel(loop, drive))


def _relative_error(stop: _Stop, wanted: Vector) -> float:
    """Return the mean relative error of the deceleration [%] while both runs last."""
    n = min(len(stop.decel), len(wanted))
    rows = window(stop.drive)[:n]
    achieved, wanted = stop.decel[:n][rows], wanted[:n][rows]
    return float(100.0 * np.mean(np.abs(achieved - wanted) / wanted))


class _Seed(NamedTuple):
    """One car's stop."""

    friction: dict[str, tuple[float, float, float]]
    compensation: tuple[float, float, float, float]


def _one_car(scenario: Scenario, config: Config, seed: int) -> _Seed:
    plain = with_keys(config, {"control.compensation": "off"})
    ours = _brake(scenario, config, seed)
    uncompensated = _brake(scenario, plain, seed)
    ideal = _brake(scenario, config, seed, ideal=True)
    nominal = {"front": config.front.mu_nominal, "rear": config.rear.mu_nominal}
    rows = window(ours.drive)
    return _Seed(
        {axle: friction_errors(ours.drive, rows, axle, nominal[axle]) for axle in AXLES},
        (
            _relative_error(ours, ours.drive.truth["decel_demand"]),
            _relative_error(uncompensated, uncompensated.drive.truth["decel_demand"]),
            _relative_error(ours, ideal.decel),
            _relative_error(uncompensated, ideal.decel),
        ),
    )


Named = tuple[bool, int]
"""With or without `vehicle_speed`, and the number of a test."""
Result = tuple[list[Friction], Compensation]


def case_result(config: Config, seeds: int, draw: str, case: Named) -> Result:
    """Drive one test with cars 0 to `seeds` - 1; figures are median, least and greatest over them."""
    speed_known, test = case
    stop = with_draw(shipped(f"stop-{test}"), draw)
    scenario = stop.model_copy(update={"vehicle_speed": "ideal" if speed_known else "none"})
    cars = [_one_car(scenario, config, seed) for seed in range(seeds)]
    friction = []
    for axle in AXLES:
        errors, inside, nominal = zip(*(car.friction[axle] for car in cars), strict=True)
        share = 100.0 * float(np.mean(inside))
        thesis = TABLE_4_3[test][axle]
        friction.append(Friction(test, speed_known, axle, figure(errors), share, thesis, figure(nominal)))
    errors_of = zip(*(car.compensation for car in cars), strict=True)
    return friction, Compensation(test, speed_known, *map(figure, errors_of))


Case = Callable[[Named], Result]
Spread = Callable[[Case, list[Named]], Iterable[Result]]
"""As `map` does it: results in the order of the cases, which may be driven side by side."""


def stops(
    config: Config,
    seeds: int = SEEDS,
    tests: tuple[int, ...] = TESTS,
    spread: Spread = map,
    draw: str = "wide",
) -> Stops:
    """Drive all tests with and without `vehicle_speed` and return their results."""
    result = Stops([], [])
    for friction, compensation in spread(
        partial(case_result, config, seeds, draw), list(product((True, False), tests))
    ):
        result.friction.extend(friction)
        result.compensation.append(compensation)
    return result


def stop_tables(result: Stops, seeds: int) -> list[Table]:
    """Return the tables of accuracy and of compensation."""

    def known(vehicle_speed: bool) -> str:
        return "yes" if vehicle_speed else "no"

    friction = [
        (
            f"#{row.test} {row.axle}",
            known(row.vehicle_speed),
            f"{row.nrmse.median:.2f}",
            f"{row.nrmse.high:.2f}",
            f"{row.inside_2_sigma:.0f}",
            f"{row.thesis:.2f}",
            f"{row.nominal.median:.2f}",
        )
        for row in result.friction
    ]
    compensation = [
        (
            f"#{row.test}",
            known(row.vehicle_speed),
            *(
                f"{figure.median:.2f} ({figure.low:.2f}–{figure.high:.2f})"
                for figure in (
                    row.to_demand,
                    row.to_demand_uncompensated,
                    row.to_ideal,
                    row.to_ideal_uncompensated,
                )
            ),
        )
        for row in result.compensation
    ]
    return [
        Table(
            "Friction: nRMSE [%]",
            (
                "test, axle",
                "vehicle_speed",
                "median",
                "worst car",
                "truth inside 2σ [%]",
                "thesis, Obs. 2",
                "nominal friction",
            ),
            friction,
            f"Over {seeds} cars. The thesis's column is its Table 4.3; in the last one the configured 0.45 "
            "is taken as the estimate.",
        ),
        Table(
            "Deceleration: mean relative error [%]",
            (
                "test",
                "vehicle_speed",
                "to demand",
                "to demand, uncompensated",
                "to ideal",
                "to ideal, uncompensated",
            ),
            compensation,
            f"Median (least–greatest) over {seeds} cars. Ideal: the same controller in the same car, given "
            "the true friction. The error to the demand holds that of the mass too.",
        ),
    ]


TEXT: Final = (
    "Stops from 120 km/h to standstill, Table 4.2 of the thesis: #1 4, #2 7 m/s² on a dry road (1.2), #3 4, "
    "#4 6 m/s² on a wet one (0.7). The car is that of config/plant/suv.toml, drawn per seed; its linings "
    "have 0.85 (front) and 1.10 (rear) of the 0.45 that the ECU is configured with. Nothing was learned "
    "before. Counted from 0.5 s after the demand has its full value, down to 15 km/h."
)


def drawn_of(name: str, config: Config, asked: Asked) -> str:
    """Return configuration and draw as a page names them."""
    draw = f"{asked.draw} draw, seeds 0–{asked.seeds - 1}"
    return f", config/{name} ({config_hash(config)[:12]}), {draw}"


def _run(asked: Asked) -> Measured:
    path = resource("config/suv.toml")
    config = load_config(path)
    result = stops(config, asked.seeds, spread=partial(run_each, "stops"), draw=asked.draw)
    plain = {key: [plain_row(row) for row in rows] for key, rows in result._asdict().items()}
    return Measured(stop_tables(result, asked.seeds), drawn_of(path.name, config, asked), plain)


STUDY: Final = Study("Accuracy of the friction and of the compensation", TEXT, _run, "observer-accuracy")
