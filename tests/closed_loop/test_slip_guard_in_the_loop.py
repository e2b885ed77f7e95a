"""The slip guard in the simulated car: wheels that lock without it roll, and where none would lock it
rests."""

import numpy as np
import pytest

from brakelab.simulation.closed_loop import Drive, new_loop, run
from brakelab.simulation.scenario import Phase, Scenario, load_scenario
from brakelab.simulation.scenario_car import with_draw
from ecu.contract.faults import WHEEL_SLIPS
from ecu.contract.signals import CORNERS
from ecu.settings.config import Config, load_config
from ecu.settings.resources import resource

LOCKED = -0.5  # of slip
SEED = 1


def shipped(name: str) -> Scenario:
    """Return a scenario whose cars differ little: which wheel locks is that of the brakes as configured."""
    return with_draw(load_scenario(resource(f"config/scenarios/{name}.toml")), "nominal")


def stop(decel: float, friction: float) -> Scenario:
    """Return stop #1 with another deceleration and road."""
    base = shipped("stop-1")
    phases = [base.phase[0], Phase(kind="brake", decel=decel, until_speed=0.0)]
    return base.model_copy(update={"road_friction": [(0.0, friction)], "phase": phases})


def drive(scenario: Scenario, guarded: bool) -> Drive:
    config: Config = load_config(resource("config/suv.toml"))
    control = config.control.model_copy(update={"slip_guard": guarded})
    return run(new_loop(scenario, config.model_copy(update={"control": control}), SEED))


def locked_s(result: Drive) -> list[float]:
    """Return for how long [s] each wheel was locked above 3 m/s."""
    moving = result.truth["vehicle_speed"] > 3.0
    return [0.01 * float(np.sum(result.truth[f"slip_{c}"][moving] < LOCKED)) for c in CORNERS]


@pytest.mark.parametrize(
    ("case", "scenario", "locked", "before", "after"),
    [  # which wheels lock without the guard, for at least, and with it at most [s]
        ("patch of ice", shipped("low-grip"), "fl fr rl rr", 0.5, 0.25),
        # The rear's torque is taken back as it slips beyond the front: its wheel rolls again by that.
        ("ice on the left", shipped("split"), "fl", 1.2, 0.05),
        ("too much for a dry road", stop(11.0, 1.0), "fl fr rl rr", 2.0, 0.5),
    ],
)
def test_locked_wheels_roll_again(case, scenario, locked, before, after) -> None:
    without, guarded = locked_s(drive(scenario, False)), locked_s(drive(scenario, True))
    print(f"{case}: {without} s without the guard, {guarded} s with it")
    for corner, was, now in zip(CORNERS, without, guarded, strict=True):
        assert (was > before) == (corner in locked.split())
        assert now <= after


@pytest.mark.parametrize("friction", [1.0, 1.2])
def test_the_stop_on_a_dry_road_gets_no_longer(friction: float) -> None:
    far = [drive(stop(11.0, friction), guarded).truth["distance"][-1] for guarded in (False, True)]
    print(f"dry road of {friction}: {far[0]:.1f} m without the guard, {far[1]:.1f} m with it")
    assert far[1] < far[0]


@pytest.mark.parametrize(
    ("case", "scenario"),
    [
        *((f"stop #{number}", shipped(f"stop-{number}")) for number in (1, 2, 3, 4)),
        ("8 m/s² on a dry road", stop(8.0, 1.2)),
        ("8 m/s² on a road of 1.0", stop(8.0, 1.0)),
        ("ordinary driving", shipped("ordinary")),
    ],
)
def test_where_no_wheel_locks_it_changes_no_bit(case, scenario) -> None:
    guarded, without = drive(scenario, True), drive(scenario, False)
    assert not np.any(guarded.outputs["active_faults"].astype(int) & WHEEL_SLIPS), case
    assert guarded.frames.tobytes() == without.frames.tobytes()
