"""A car whose hydraulic unit is another one than the thesis's, with and without `[hydraulics]`."""

import numpy as np
import pytest

from brakelab.simulation.accuracy import friction_errors, window
from brakelab.simulation.closed_loop import Loop, new_loop, run
from brakelab.simulation.scenario_car import with_draw
from brakelab.studies.control.blending import blended, changing, shipped
from ecu.contract.faults import BRAKE_FAILED, fault_mask
from ecu.settings.config import Config, load_config
from ecu.settings.hydraulics import Hydraulics
from ecu.settings.resources import resource

SEEDS = (0, 1, 2)
USUAL = Hydraulics()
UNITS = {
    # of the car: times of dead time and lag, greatest rates [bar/s]; of CONFIG
    "twice as late": (2.0, (np.inf, np.inf), Hydraulics(
        dead_time_rise=0.052, dead_time_fall=0.03, lag_rise=0.074, lag_fall=0.09
    )),
    "four times": (4.0, (np.inf, np.inf), Hydraulics(
        dead_time_rise=0.104, dead_time_fall=0.06, lag_rise=0.148, lag_fall=0.18
    )),
    "half": (0.5, (np.inf, np.inf), Hydraulics(
        dead_time_rise=0.013, dead_time_fall=0.01, lag_rise=0.0185, lag_fall=0.0225
    )),
    "80 bar/s": (1.0, (80e5, 300e5), Hydraulics(rise_limit=80.0, fall_limit=300.0)),
}  # fmt: skip


def car_with(unit: str, scenario: str, config: Config, seed: int) -> Loop:
    times, (rise, fall), _ = UNITS[unit]
    loop = new_loop(with_draw(shipped(scenario), "nominal"), config, seed)
    car = loop.sides.vehicle.params[0]
    for answer in (car["build_up"], car["release"]):
        answer *= (times**2, times, times)
    car["rise_limit"], car["fall_limit"] = rise, fall
    return loop


def knowing(config: Config, unit: Hydraulics) -> Config:
    return config.model_copy(update={"hydraulics": unit})


@pytest.mark.parametrize(
    ("unit", "unknown", "most"),
    [("twice as late", 10.0, 2.0), ("four times", 20.0, 3.0), ("half", 10.0, 2.0), ("80 bar/s", 5.0, 2.0)],
)
def test_motors_and_linings_change_torque_where_the_unit_is_known(unit, unknown, most) -> None:
    """The sum beside the demand [%], worst of three cars; `unknown`: at least, with the thesis's unit."""
    errors = []
    for given in (USUAL, UNITS[unit][2]):
        config = knowing(blended(0.7), given)
        found = [changing(run(car_with(unit, "hand-over", config, s), ideal=True), config) for s in SEEDS]
        errors.append(max(max(one.below, one.above) for one in found))
    print(f"{unit}: {errors[0]:.1f} %, known {errors[1]:.1f} %")
    assert errors[0] > unknown
    assert errors[1] < most


@pytest.mark.parametrize("unit", ["twice as late", "four times", "half", "80 bar/s"])
def test_friction_is_found_better_where_the_unit_is_known(unit) -> None:
    """Four applications of the pedal; nRMSE of both axles [%], mean of three cars."""
    base, errors = load_config(resource("config/suv.toml")), []
    for given in (USUAL, UNITS[unit][2]):
        drives = [run(car_with(unit, "repeated", knowing(base, given), seed)) for seed in SEEDS]
        braked = [window(d) & (d.outputs["decel_demand_total"] > 1.0) for d in drives]
        errors.append(
            np.mean(
                [
                    friction_errors(d, rows, axle, 0.45)[0]
                    for d, rows in zip(drives, braked, strict=True)
                    for axle in ("front", "rear")
                ]
            )
        )
    print(f"{unit}: {errors[0]:.1f} %, known {errors[1]:.1f} %")
    assert errors[1] < 0.9 * errors[0]


def test_a_slow_brake_is_not_taken_for_a_failed_one_where_the_unit_is_known() -> None:
    base = load_config(resource("config/suv.toml"))
    reported = []
    for given in (USUAL, UNITS["80 bar/s"][2]):
        drives = [run(car_with("80 bar/s", "stop-1", knowing(base, given), seed)) for seed in SEEDS]
        reported.append(any((fault_mask(d.outputs) & BRAKE_FAILED).any() for d in drives))
    assert reported == [True, False]
