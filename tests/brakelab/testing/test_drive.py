"""What `ecu` and `plant` assert of a drive, and what they say where it is not so."""

import math
import re
from contextlib import AbstractContextManager, nullcontext

import numpy as np
import pytest

from brakelab.testing.drive import Signal
from ecu.errors import UserError

STOP = {
    "plant": "suv",
    "draw": "nominal",
    "initial_speed": 10.0,
    "phase": [{"kind": "coast", "seconds": 0.5}, {"kind": "brake", "decel": 4.0, "until_speed": 0.0}],
}
SPEED = Signal("vehicle_speed", "m/s", 0.01 * np.arange(5), np.array([10.0, 11.0, 12.0, math.nan, 14.0]))


def failing(line: str) -> AbstractContextManager[object]:
    """Expect an assertion's line, or none where it is empty."""
    return pytest.raises(AssertionError, match=re.escape(line)) if line else nullcontext()


@pytest.mark.parametrize(
    ("begin", "end", "low", "high", "unit", "line"),
    [
        (0.0, 0.03, 10.0, 12.0, "m/s", ""),
        (0.0, 0.03, 36.0, 43.2, "km/h", ""),
        (0.0, 0.03, 36.0, 43.1, "km/h", "is 43.2 km/h at t = 0.02 s, not within 36 to 43.1 km/h (1 of 3"),
        (0.0, 0.02, 10.5, 12.0, "m/s", "is 10 m/s at t = 0.00 s, not within 10.5 to 12 m/s (1 of 2 rows)"),
        (0.03, 1.0, 0.0, 99.0, "m/s", "is nan m/s at t = 0.03 s, not within 0 to 99 m/s (1 of 2 rows)"),
        (1.0, 2.0, 0.0, 99.0, "m/s", "no row in this span"),
    ],
)
def test_within_limits_in_any_unit(
    begin: float, end: float, low: float, high: float, unit: str, line: str
) -> None:
    with failing(line):
        SPEED.between(begin, end).within(low, high, unit)


@pytest.mark.parametrize(
    ("by", "unit", "near"),
    [(0.5, "m/s", True), (1.8, "km/h", True), (1.7, "km/h", False), (5.0, "%", True), (4.0, "%", False)],
)
def test_near_another_signal_of_another_rate(by: float, unit: str, near: bool) -> None:
    other = Signal("true", "m/s", np.array([0.0, 0.04]), np.array([10.5, 14.5]))
    with failing("" if near else f"not within {by:g} {unit} of true"):
        SPEED.between(0.0, 0.03).near(other, by, unit)


def test_a_temperature_has_another_zero_and_its_difference_none() -> None:
    disc = Signal("disc_temperature_fl", "degC", np.zeros(1), np.array([100.0]))
    disc.within(373.0, 373.3, "K")
    disc.near(98.0, 2.0, "K")
    with pytest.raises(AssertionError, match=r"is 373\.1 K at t = 0\.00 s, not within 374 to 400 K"):
        disc.within(374.0, 400.0, "K")


def test_a_unit_that_is_another_quantity_is_refused() -> None:
    with pytest.raises(UserError, match='"bar" does not turn into m/s'):
        SPEED.within(0.0, 1.0, "bar")


@pytest.mark.requirement("REQ-IN-2")
def test_a_fault_is_reported_by_its_bit_in_time(ecu, plant) -> None:
    plant.fault("lost", message=["Imu"], t=1.0, duration=0.5)
    plant.drive(STOP, seed=1)
    ecu.reported("IMU lost", within_ms=150)
    with pytest.raises(AssertionError, match=r"FAILED: IMU lost within 0.02 s of fault 1 \(found: after 0"):
        ecu.reported("IMU lost", within_ms=20)
    with pytest.raises(AssertionError, match="never"):
        ecu.reported("pedal lost", within_ms=500)
    ecu.shows("recovered", within=0.3)
    assert "mu_b_fl" in ecu.columns
    assert "distance" in plant.columns
    with pytest.raises(AssertionError, match=r"mu_b_fl is [.\d]+ at t = 0\.00 s, not within 5 to 6 \("):
        ecu["mu_b_fl"].within(5, 6, "-")
    assert (ecu["mu_b_fl"].unit, plant["distance"].unit, ecu["mode_fl"].unit) == ("-", "m", "-")


@pytest.mark.parametrize("ecu_config", ["suv", "sedan"])
def test_the_configuration_is_that_of_the_fixture_and_the_changes(ecu, plant, ecu_config) -> None:
    plant.drive("single", draw="nominal", plant=ecu_config)
    braked = ecu["pressure_demand_fl"].between(5.0, 6.0).values.mean()
    ecu.changes["control.compensation"] = "off"
    plant.drive("single", draw="nominal", plant=ecu_config)
    assert ecu.driven.vehicle.control.compensation == "off"
    assert ecu.driven.vehicle.name == ecu_config
    assert ecu["pressure_demand_fl"].between(5.0, 6.0).values.mean() != pytest.approx(braked, rel=0.01)


def test_another_signal_is_converted_and_of_the_same_quantity() -> None:
    speeds = SPEED.between(0.0, 0.03)
    speeds.near(speeds._replace(unit="km/h", values=3.6 * speeds.values), 0.01, "m/s")
    with pytest.raises(UserError, match='"bar" does not turn into m/s'):
        speeds.near(speeds._replace(unit="bar"), 100.0, "%")


def test_nothing_is_near_a_signal_where_it_has_no_row() -> None:
    with pytest.raises(AssertionError, match=r"at t = 0\.02 s, not within 50 % of vehicle_speed \(1 of 3"):
        SPEED.between(0.0, 0.03).near(SPEED.between(0.0, 0.02), 50.0, "%")
    with pytest.raises(AssertionError, match="vehicle_speed: no row in this span"):
        SPEED.between(0.0, 0.03).near(SPEED.between(7.0, 8.0), 50.0, "%")


@pytest.mark.parametrize(
    ("wrong", "line"),
    [
        (lambda ecu, plant: ecu["mode"], "ecu: there is no drive yet; call plant.drive first"),
        (lambda ecu, plant: plant.drive("nosuch"), "nosuch"),
        (lambda ecu, plant: plant.drive(STOP, initial_sped=3.0), "scenario: initial_sped"),
        (lambda ecu, plant: plant.drive(STOP, seed=-1), "seed: -1: give a whole number from 0 on"),
        (lambda ecu, plant: plant.drive(STOP, seed=1.5), "seed: 1.5: give a whole number from 0 on"),
        (lambda ecu, plant: plant.drive(STOP, fault=None), "scenario: fault: give"),
        (lambda ecu, plant: plant.fault("lots", t=1.0), "fault: kind"),
        (lambda ecu, plant: plant.fault("lost"), "fault: t: missing"),
        (lambda ecu, plant: (plant.drive(STOP), ecu["mu_b"]), "mu_b: no such column; did you mean mu_b_"),
        (lambda ecu, plant: (plant.drive(STOP), ecu.reported("IMU gone", 9)), "did you mean IMU lost"),
        (lambda ecu, plant: (plant.drive(STOP), ecu.reported("IMU lost", 9)), "there is none; give t"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_line(ecu, plant, wrong, line: str) -> None:
    with pytest.raises(UserError) as caught:
        wrong(ecu, plant)
    assert line in str(caught.value)
    assert "\n" not in str(caught.value)
