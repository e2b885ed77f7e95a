"""A car whose hydraulic unit is another one than the thesis's: configured, learned or unknown."""

import numpy as np
import pytest

from brakelab.simulation.accuracy import friction_errors, window
from brakelab.simulation.closed_loop import Loop, new_loop, run
from brakelab.simulation.configured import shipped
from brakelab.simulation.scenario_car import with_draw
from brakelab.studies.control.blending import blended, changing
from ecu.algorithm.step import new_state
from ecu.contract.faults import BRAKE_FAILED, fault_mask
from ecu.settings.config import Config, load_config, new_params
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
    "usual": (1.0, (np.inf, np.inf), USUAL),
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


def friction_error(unit: str, config: Config) -> float:
    """Return the nRMSE of both axles in four applications of the pedal [%], mean of the cars."""
    found = []
    for seed in SEEDS:
        drive = run(car_with(unit, "repeated", config, seed))
        rows = window(drive) & (drive.outputs["decel_demand_total"] > 1.0)
        found += [friction_errors(drive, rows, axle, 0.45)[0] for axle in ("front", "rear")]
    return float(np.mean(found))


@pytest.mark.parametrize(
    ("unit", "next_one"),
    [("twice as late", 3.0), ("four times", 15.0), ("half", 4.0), ("80 bar/s", 10.0)],
)
def test_motors_and_linings_change_torque_where_the_unit_is_known(unit, next_one) -> None:
    """The sum beside the demand [%], worst of the cars: configured, and after the first application."""
    errors = {"configured": 0.0, "first": 0.0, "next": 0.0}
    for seed in SEEDS:
        found, learned = {}, new_state(new_params(blended(0.7)))["hydraulics"]
        for case, given in (("configured", UNITS[unit][2]), ("first", USUAL), ("next", USUAL)):
            config = knowing(blended(0.7), given)
            loop = car_with(unit, "hand-over", config, seed)
            if case == "next":
                for name in ("late", "late_known"):
                    loop.sides.state["hydraulics"][name] = learned[name]
            found[case] = changing(run(loop, ideal=True), config)
            learned = loop.sides.state["hydraulics"].copy()
        errors = {case: max(errors[case], one.below, one.above) for case, one in found.items()}
    print(unit, {case: f"{error:.1f} %" for case, error in errors.items()})
    assert errors["configured"] < 2.0
    assert errors["configured"] < errors["first"] - 1.0
    assert errors["next"] < next_one


@pytest.mark.parametrize("unit", ["twice as late", "four times", "half"])
def test_a_unit_whose_times_are_others_is_learned_as_well_as_configured(unit) -> None:
    base = load_config(resource("config/suv.toml"))
    configured, learned = (friction_error(unit, knowing(base, given)) for given in (UNITS[unit][2], USUAL))
    print(f"{unit}: configured {configured:.1f} %, learned {learned:.1f} %")
    assert learned < 1.1 * configured


def test_a_limited_rate_has_to_be_configured() -> None:
    base = load_config(resource("config/suv.toml"))
    configured, unknown = (
        friction_error("80 bar/s", knowing(base, given)) for given in (UNITS["80 bar/s"][2], USUAL)
    )
    print(f"configured {configured:.1f} %, unknown {unknown:.1f} %")
    assert configured < 0.8 * unknown


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("scenario", ["stop-1", "hand-over"])
def test_a_slow_brake_is_not_taken_for_a_failed_one_where_the_unit_is_known(unit, scenario) -> None:
    base = blended(0.7) if scenario == "hand-over" else load_config(resource("config/suv.toml"))
    for seed in SEEDS:
        drive = run(car_with(unit, scenario, knowing(base, UNITS[unit][2]), seed))
        assert not (fault_mask(drive.outputs) & BRAKE_FAILED).any()


@pytest.mark.parametrize("times", [0.5, 1.0, 2.0, 4.0])
def test_the_lateness_of_the_pressures_is_published(times) -> None:
    """Dead time and lag of (A.17, A.18) by these times."""
    unit = {0.5: "half", 2.0: "twice as late", 4.0: "four times"}.get(times, "usual")
    config = load_config(resource("config/suv.toml"))
    for seed in SEEDS:
        outputs = run(car_with(unit, "repeated", config, seed)).outputs
        for direction, usual in (("rise", 0.063), ("fall", 0.060)):
            found = float(outputs[f"pressure_lateness_{direction}"][-1])
            print(f"{direction}: {1e3 * found:.0f} ms, true {1e3 * times * usual:.0f}")
            assert found == pytest.approx(times * usual, abs=0.008 + 0.08 * times * usual)
