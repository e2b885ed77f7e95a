"""The bench of compensation: what is counted, by curves whose errors are known; and one car's manoeuvre."""

import numpy as np
import pytest

from brakelab.simulation.closed_loop import Drive
from brakelab.studies.control.compensation import (
    CURVES,
    LEVELS,
    Car,
    Run,
    application_errors,
    applications,
    drive_as,
    level_errors,
    manoeuvre,
)
from brakelab.studies.control.compensation_table import mass_table
from ecu.contract.records import FRAME, new_record
from ecu.settings.config import load_config
from ecu.settings.resources import resource


def brakings(share: float) -> Run:
    """Return two brakings, pedal 0 to 100 % in 2 s, held for 1 s; deceleration is `share` of 0.08 pedal."""
    one = np.concatenate([np.zeros(100), np.linspace(0.0, 100.0, 200), np.full(100, 100.0), np.zeros(100)])
    pedal = np.tile(one, 2)
    speed, t = np.full(len(pedal), 20.0), 0.01 * np.arange(len(pedal))
    drive = Drive(
        t,
        {},
        {"decel_demand_total": 0.08 * pedal},
        {"pedal_position": pedal, "vehicle_speed": speed},
        new_record(FRAME, 0),
    )
    return Run(drive, share * 0.08 * pedal)


def test_an_application_lasts_from_the_first_demand_to_its_release() -> None:
    found = applications(brakings(1.0).drive)
    assert len(found) == 2
    assert (found[0][-1], found[1][-1]) == (399, 899)
    assert found[0][0] == pytest.approx(105, abs=2)  # 0.2 m/s^2


@pytest.mark.parametrize("share", [0.9, 1.0, 1.07])
def test_errors_of_a_share(share: float) -> None:
    run, ideal = brakings(share), brakings(1.0)
    assert application_errors(run, ideal) == pytest.approx([100 * abs(share - 1)] * 2)
    decel, travel = level_errors(run, ideal)
    assert decel == pytest.approx(np.full((1, len(LEVELS)), 100 * (share - 1)))
    assert travel == pytest.approx(np.full((1, len(LEVELS)), 100 * (1 / share - 1)), abs=0.02)


def test_what_the_mass_leaves_is_the_same_in_cars_that_differ_by_mass_alone() -> None:
    cars = []
    for excess in (-2.5, 0.0, 1.5):
        decel = np.full((2, len(LEVELS)), excess - 3.6)
        levels = {(name, "compensated"): (decel, decel) for name in CURVES}
        cars.append(Car({}, levels, {}, excess))
    rows = mass_table(cars).rows
    assert rows[0][:3] == ("car 0", "-2.5", "-6.1")
    assert rows[-1][2:] == ("-3.6 (0.0)",) * 6


def test_given_too_much_friction_the_car_brakes_too_little() -> None:
    config = load_config(resource("config/suv.toml"))
    scenario = manoeuvre("single application")
    runs = {kind: drive_as(kind, scenario, config, 0) for kind in ("ideal", "under", "over")}
    (under,), (over,) = (application_errors(runs[kind], runs["ideal"]) for kind in ("under", "over"))
    assert under == pytest.approx(100 * (1 - 1 / 1.15), abs=0.5)
    assert over == pytest.approx(100 * (1 / 0.85 - 1), abs=0.5)


def test_a_car_that_did_not_get_there_is_left_out_of_what_mass_leaves() -> None:
    """Its cell is a dash, and no mean of the others is nan."""
    shape = (2, len(LEVELS))
    whole, short = np.full(shape, 3.0), np.full(shape, 3.0)
    short[:, -1] = np.nan
    cars = [
        Car({}, {(name, "compensated"): (curve, curve) for name in CURVES}, {}, 1.0)
        for curve in (whole, whole, short)
    ]
    table = mass_table(cars)
    assert table.rows[2][4] == "–"
    assert table.rows[-1][4] == "+2.0 (0.0)"
    assert "nan" not in str(table)
