"""Pressures, pedal and the flag of ESP: known by the deceleration, in the scale of the configured brakes."""

import numpy as np
import pytest

from brakelab.logs.physics.samples import ANY_CAR, car_of
from brakelab.mapping.brakes import brakes, flags
from ecu.contract.signals import CORNERS
from ecu.settings.config import load_config, new_params
from ecu.settings.resources import resource
from tests.brakelab.mapping.test_physics import MOTION, ROAD, series

DECEL = np.maximum(-ROAD.change, 0.0)
SUV = car_of(new_params(load_config(resource("config/suv.toml")))[0])
PER_BAR = float(SUV.brakes.decel_per_bar.sum())  # m/s² per bar in all callipers
BAR = np.maximum(DECEL - 0.3, 0.0) / PER_BAR


def found(*others, car=SUV):
    return {one.target: one for one in [*brakes(list(others), MOTION, car), *flags(list(others), MOTION)]}


@pytest.mark.parametrize(
    ("counts", "zero", "unit"),
    [(3.2, 0.0, ""), (0.25, 0.0, ""), (10.0, 0.0, "-"), (0.02, 0.5, "V"), (0.6, 0.0, "%")],
)
def test_a_pressure_without_a_unit_gets_the_scale_of_configured_brakes(counts, zero, unit):
    """A zero that no sound sensor has is taken off, that of a sound one is left to the ECU."""
    one = found(series("BRAKE_PRESSURE", zero + counts * BAR, unit))["calliper_pressure_rl"]
    assert one.unit == "bar"
    assert one.factor == pytest.approx(1.0 / counts, rel=0.2)
    assert one.offset == pytest.approx(-zero * one.factor, rel=0.01)
    assert "friction is relative" in one.warning


@pytest.mark.parametrize(
    ("names", "of_wheels"),
    [
        (("Brake Pres Front", "Brake Pres Rear"), (0, 0, 1, 1)),
        (("BrakePressure_R", "BrakePressure_F"), (1, 1, 0, 0)),
        (("Brake Pres Front", "Brake Pres Clutch"), (0, 0, 0, 0)),
    ],
)
def test_each_axle_has_its_own_pressure(names, of_wheels):
    both = [series(name, share * BAR, "bar") for name, share in zip(names, (1.0, 0.8), strict=True)]
    inputs = found(*both)
    taken = [inputs[f"calliper_pressure_{corner}"].series.signal for corner in CORNERS]
    assert taken == [names[place] for place in of_wheels]
    assert "pedal_position" not in inputs


def test_decelerations_on_the_motors_alone_scale_no_pressure():
    """Two in five decelerations are the motors': they would make the scale too large."""
    brakes_act = ROAD.t % 20.0 > 8.0
    one = found(series("BRAKE_PRESSURE", np.where(brakes_act, 3.2 * BAR, 0.0)))["calliper_pressure_fl"]
    assert one.factor == pytest.approx(1.0 / 3.2, rel=0.2)


def test_brake_applications_at_the_limit_of_grip_scale_no_pressure():
    """One in eight decelerations is stamped at ten times the pressure that it takes."""
    stamped = ROAD.t % 20.0 > 17.5
    one = found(series("BRAKE_PRESSURE", np.where(stamped, 10.0, 1.0) * 3.2 * BAR))["calliper_pressure_fl"]
    assert one.factor == pytest.approx(1.0 / 3.2, rel=0.2)


def test_a_pressure_without_a_unit_that_fits_is_taken_for_bar():
    one = found(series("BRAKE_PRESSURE", BAR))["calliper_pressure_fl"]
    assert one.factor == 1.0
    assert "taken for bar" in one.warning


def test_without_a_configuration_its_scale_is_not_known():
    one = found(series("BRAKE_PRESSURE", 3.2 * BAR), car=ANY_CAR)["calliper_pressure_fl"]
    assert "--config" in one.warning


def test_a_pressure_in_bar_keeps_its_scale_whatever_the_brakes():
    one = found(series("CYL_PRES", 3.2 * BAR, "Bar"))["calliper_pressure_fl"]
    assert (one.factor, one.warning) == (1.0, "")


@pytest.mark.parametrize("name", ["BRAKE_POSITION", "BrakePedal_Travel"])
def test_the_travel_of_a_pedal_is_no_pressure(name):
    inputs = found(series(name, 8.0 * BAR))
    assert "calliper_pressure_fl" not in inputs
    assert inputs["pedal_position"].factor == pytest.approx(100.0 / (8.0 * BAR.max()))


def test_a_pressure_that_no_braking_checks_needs_a_name_of_brakes():
    """A log without the brakes' message: the pump of the transmission has a pressure, too."""
    level = 5.0 + np.sin(ROAD.t / 50.0)
    pump = series("CF_Ems_PumpTPres", level, "bar", "EMS20")
    brake = series("CYL_PRES", level, "bar", "ESP12")
    assert "calliper_pressure_fl" not in found(pump)
    assert "calliper_pressure_fl" in found(brake)


def test_a_pressure_is_no_pedal():
    inputs = found(series("BRAKE_PRESSURE", 3.0 * BAR))
    assert "pedal_position" not in inputs


@pytest.mark.parametrize("name", ["BrakePedalPos", "Brake_Percent"])
def test_a_pedal_in_per_cent_keeps_its_scale_and_is_no_pressure(name):
    inputs = found(series(name, 8.0 * BAR, "%"))
    assert inputs["pedal_position"].factor == 1.0
    assert "calliper_pressure_fl" not in inputs


def test_states_are_no_pedal_position():
    states = series("BRAKE_PEDAL_STATE", np.round(2.0 * DECEL / DECEL.max()))
    assert "pedal_position" not in found(states)


@pytest.mark.parametrize(("share", "taken"), [(0.0, True), (0.05, True), (0.6, False), (1.0, False)])
def test_a_flag_that_is_on_for_most_of_the_drive_is_not_esp_at_work(share, taken):
    """It would hold back every braking from teaching friction."""
    on = (np.arange(len(ROAD.t)) < share * len(ROAD.t)).astype(float)
    flag = series("CF_Esc_Act", on)._replace(flag=True)
    assert ("esp_active" in found(flag)) == taken
