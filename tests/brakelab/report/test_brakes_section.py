"""The section on the brakes: torque, distribution, work against closed forms; sentences for what lacks."""

import csv
import io
import json
import math
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import pytest

from brakelab.report.ak_table import fade, observed, sections
from brakelab.report.brakes_section import brakes_section, read_car
from brakelab.report.csv_table import HEAD, csv_link
from brakelab.report.distribution import forbidden_stretches, forces_of, ideal_share
from brakelab.report.drive import DriveResult
from brakelab.report.energy import works
from brakelab.report.response import responses
from brakelab.report.torque import plots_of_torque
from brakelab.results.car import KEY, Car
from ecu.contract.signals import CORNERS, OBSERVING
from ecu.errors import UserError
from ecu.settings.annex5 import Load

from .conftest import braking_between

T = np.arange(0.0, 20.0, 0.01)
STOP = braking_between(5.0, 15.0, temperature_in=np.full(4, 100.0))
Z = np.arange(0.0, 1.001, 0.05)
CAR = Car(
    2000.0, 2.8, 1.4, 0.56, (Load("unladen", 2000.0, 1.4, 0.56),), tuple(0.5 + 0.2 * Z), (0.32, 0.32),
    (60.0, 30.0), (14000.0, 6000.0),
)  # fmt: skip


def drive(**columns: Any) -> DriveResult:
    """A stop from 30 m/s with 3 m/s^2 and 30 bar at friction 0.4 everywhere."""
    brakes = (T >= 5.0) & (T < 15.0)
    own: dict[str, Any] = {"braking": brakes.astype(float)}
    own["vehicle_speed"] = 30.0 - 3.0 * np.clip(T - 5.0, 0.0, 10.0)
    for place, corner in enumerate(CORNERS):
        pressure = 30.0 * brakes
        own[f"calliper_pressure_{corner}"] = pressure
        own[f"mu_b_{corner}"] = np.full_like(T, 0.4)
        own[f"mode_{corner}"] = np.where(brakes, float(OBSERVING), 0.0)
        own[f"brake_torque_{corner}"] = CAR.gain[place // 2] * 0.4 * pressure
    return DriveResult(T, own | columns, {})


def test_specific_torque_and_its_axis_of_c_star() -> None:
    plots = plots_of_torque(drive(), drive(), [STOP], CAR)
    assert set(plots) == {f"torque-{of}-{axle}" for of in ("speed", "pressure") for axle in ("front", "rear")}
    plot = plots["torque-speed-front"]
    points = np.concatenate([np.asarray(r.data_source.data["y"]) for r in plot.renderers])
    np.testing.assert_allclose(points, 2 * 0.4 * 60.0, rtol=1e-6)  # two wheels; C* = 2 mu = 0.8
    over = (0.8 * 60.0 - plot.y_range.start) / (plot.y_range.end - plot.y_range.start)
    c_star = plot.extra_y_ranges["c"]
    assert c_star.start + over * (c_star.end - c_star.start) == pytest.approx(0.8)


def test_forces_and_the_ideal_share() -> None:
    forces = forces_of(drive(), CAR)
    row = 1000
    assert forces.front[row] == pytest.approx(2 * 60.0 * 0.4 * 30.0 / 0.32 / (2000.0 * 9.81), rel=1e-3)
    assert forces.front[row] / forces.rear[row] == pytest.approx(2.0)
    z = np.array([0.0, 0.5])
    share = ideal_share(CAR, z)
    loads = (0.5 + 0.2 * z, 0.5 - 0.2 * z)  # of the axles over the weight
    np.testing.assert_allclose(share / loads[0], (1.0 - share) / loads[1])


def test_annex_5_forbids_the_rear_ahead_of_the_front() -> None:
    found = forbidden_stretches(CAR, 0.6)
    at = [place for place, left in enumerate(found["left"]) if left == pytest.approx(0.40)]
    ideal = 100.0 * (0.5 + 0.2 * 0.41)
    assert any(found["bottom"][k] < 40.0 and abs(found["top"][k] - ideal) < 1.0 for k in at)
    assert not any(found["bottom"][k] < ideal + 1.0 < found["top"][k] for k in at)


def test_work_is_the_integral_of_torque_and_speed() -> None:
    rows = works(drive(), [STOP], CAR)
    joules = CAR.gain[0] * 0.4 * 30.0 / 0.32 * 30.0 * 10.0 / 2.0
    assert rows[0].kilojoules == pytest.approx(1e-3 * joules, rel=2e-3)
    assert rows[0].share == pytest.approx(1.0 / 3.0, rel=1e-6)
    greatest = CAR.gain[0] * 0.4 * 30.0 / 0.32 * (30.0 - 3.0 * 0.1)
    assert rows[0].peak == pytest.approx(1e-3 * greatest, rel=2e-3)
    assert rows[0].peak_density == pytest.approx(greatest / 14000.0, rel=2e-3)


def test_sections_and_fade() -> None:
    by_axle = observed(drive(), [STOP])
    assert [row[:5] for row in sections(by_axle)] == [
        ("front", "100 to 140", "20 to 40", "50 to 150", 1),
        ("rear", "100 to 140", "20 to 40", "50 to 150", 1),
    ]
    assert by_axle["front"][0].mean == pytest.approx(0.4)
    assert "not shown; discs began an application with 100 °C at most" in fade("front", by_axle["front"])
    usual = by_axle["front"][0]
    hot = usual._replace(number=2, temperature=350.0, mean=0.3)
    text = fade("front", [usual, hot, usual._replace(number=3, mean=0.38)])
    assert "0.400 before, 0.300 at the least from 350 °C up (-25 %); recovery to 0.380 (-5 %)" in text
    assert "recovery is not shown" in fade("front", [usual, hot])


def test_what_lacks_is_a_sentence_and_no_plot() -> None:
    section, plots = brakes_section(drive(), None, None, [STOP], False)
    assert plots["torque_plots"] == plots["distribution_plots"] == plots["energy_plots"] == {}
    missing = {row.quantity for row in section.missing}
    assert "Specific torque, distribution, energy of each brake" in missing
    assert {"Slip and speeds of the wheels", "Motors' share over time", "Accelerator"} <= missing
    section, _ = brakes_section(drive(), None, None, [], True)
    assert not section.conditions
    assert not section.csv


def test_damaged_car_is_one_line() -> None:
    with pytest.raises(UserError, match="metadata car: not readable"):
        read_car(drive()._replace(metadata={KEY: json.dumps({"mass": 1})}), Path("x"))


def test_csv_has_a_column_for_each_name() -> None:
    text = unquote(csv_link([STOP], responses(drive(), [STOP])).partition(",")[2])
    head, row = csv.reader(io.StringIO(text))
    assert tuple(head) == HEAD
    assert len(row) == len(HEAD)
    by_axle = dict(zip(head, row, strict=True))
    assert float(by_axle["duration [s]"]) == 10.0
    assert float(by_axle["plateau_front [bar]"]) == 30.0
    assert by_axle["predicted [m/s^2]"] == ""
    assert math.isfinite(float(by_axle["v_in [km/h]"]))
    assert csv_link([], []) == ""
