"""A torque of the drive becomes motor torque of the wheels that slip with it."""

import numpy as np
import pytest

from brakelab.mapping.drive_torque import drive_torque, driven_wheels, motors
from brakelab.mapping.motion import motion_of
from brakelab.mapping.series import Series
from ecu.contract.signals import CORNERS

T = np.arange(0.0, 120.0, 0.02)
CHANGE = 1.5 * np.sin(2 * np.pi * T / 20.0)
SPEED = 15.0 + np.cumsum(CHANGE) * 0.02
TORQUE = 620.0 * CHANGE + 100.0


def series(signal, values, unit="Nm", message="Powertrain"):
    return Series(message, signal, unit, 0, 0.02, False, T, values)


def wheels(driven="rear"):
    slip = 1.0 + 1e-5 * TORQUE
    return {
        c: series(
            f"Whl{c.upper()}", SPEED / 0.33 * (slip if (c[0] == "r") == (driven == "rear") else 1.0), "rad/s"
        )
        for c in CORNERS
    }


def test_the_torque_at_the_wheels_is_taken_and_no_request_nor_an_engines():
    motion = motion_of(wheels())
    right = series("PrplWhlTot_Tq_Actl", TORQUE)
    others = [
        series("PrplWhlTot_Tq_Rq", TORQUE),
        series("EngTq_Actl", TORQUE / 8.0),
        series("WhlBrk_Tq_Actl", TORQUE),
        series("WhlTq_Flag", TORQUE, "%"),
        series("AxleTq_Actl", TORQUE / 9.0),  # not at the wheel: mass times radius would be 69 kg m
    ]
    found = drive_torque([*others, right], motion)
    assert found is not None
    assert found[0].signal == "PrplWhlTot_Tq_Actl"
    assert found[1].slope == pytest.approx(620.0, rel=0.05)
    assert drive_torque(others, motion) is None


@pytest.mark.parametrize(("driven", "shares"), [("rear", (0, 0, 0.5, 0.5)), ("front", (0.5, 0.5, 0, 0))])
def test_the_wheels_that_slip_with_it_are_driven(driven, shares):
    car = wheels(driven)
    assert driven_wheels(series("PrplWhl_Tq", TORQUE), car, motion_of(car))[0] == shares


def test_positive_motor_torque_brakes():
    car = wheels()
    found = {
        one.target: one for one in motors([series("PrplWhl_Tq", 1e-3 * TORQUE, "kN m")], car, motion_of(car))
    }
    assert [found[f"motor_torque_{c}"].factor for c in CORNERS] == pytest.approx([0, 0, -500.0, -500.0])


def test_a_car_that_stands_tells_no_drive():
    still = {c: one._replace(value=0.0 * one.value) for c, one in wheels().items()}
    assert motors([series("PrplWhl_Tq", TORQUE)], still, motion_of(still)) == []
