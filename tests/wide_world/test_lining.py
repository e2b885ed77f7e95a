"""Linings by kind, and the rear line behind a valve."""

import pytest

from .lining import (
    CONSTANT,
    FADING,
    GREEN,
    LOAD_AND_SPEED,
    RISING,
    Brake,
    friction,
    rear_pressure,
    warm_level,
)

BRAKE = Brake(40.0, 20.0, 0.5, CONSTANT, 0.4, 0.4, 0.0, 1e6, 2e-4, 3e-4, 1e-3, 2e-4, 0.8, 30.0, 0.35, 0.04)


@pytest.mark.parametrize(
    ("kind", "strength", "temperature", "pressure", "speed", "work", "expected"),
    [
        (CONSTANT, 0.0, 600.0, 60.0, 50.0, 1e7, 0.40),
        (RISING, 0.5, 50.0, 30.0, 30.0, 0.0, 0.40),
        (RISING, 0.5, 200.0, 30.0, 30.0, 0.0, 0.50),
        (RISING, 0.5, 350.0, 30.0, 30.0, 0.0, 0.60),
        (RISING, 0.5, 700.0, 30.0, 30.0, 0.0, 0.60),
        (FADING, 0.4, 50.0, 30.0, 30.0, 0.0, 0.40),
        (FADING, 0.4, 420.0, 30.0, 30.0, 0.0, 0.32),
        (LOAD_AND_SPEED, 0.3, 100.0, 30.0, 30.0, 0.0, 0.40),
        (LOAD_AND_SPEED, 0.3, 100.0, 60.0, 60.0, 0.0, 0.40 * 4**-0.1),
        (GREEN, 0.3, 100.0, 30.0, 30.0, 0.0, 0.28),
        (GREEN, 0.3, 100.0, 30.0, 30.0, 1e7, 0.40),
    ],
)
def test_friction_of_each_kind(
    kind: int,
    strength: float,
    temperature: float,
    pressure: float,
    speed: float,
    work: float,
    expected: float,
) -> None:
    brake = BRAKE._replace(kind=kind, strength=strength)
    assert friction(brake, 0.4, temperature, pressure, speed, work) == pytest.approx(expected, rel=0.002)


def test_a_data_sheet_states_warm_linings() -> None:
    assert warm_level(RISING, 0.5) == pytest.approx(1.3)
    assert warm_level(FADING, 0.4) == 1.0


@pytest.mark.parametrize(("front", "rear"), [(0.0, 0.0), (30.0, 24.0), (50.0, 24.0 + 0.8 * 0.35 * 20.0)])
def test_a_valve_holds_the_rear_back_beyond_its_knee(front: float, rear: float) -> None:
    assert rear_pressure(BRAKE, front) == pytest.approx(rear)
