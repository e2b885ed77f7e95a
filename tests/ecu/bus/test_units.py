"""Units as databases spell them."""

import pytest

from ecu.bus.units import CONVERSIONS, spelled

SPELLINGS = [
    ("KPH", "km/h"),
    ("Unit_KiloMeterPerHour", "km/h"),
    ("Unit_MeterPerSeconSquar", "m/s^2"),
    ("Unit_DegreOfArcPerSecon", "deg/s"),
    ("Unit_ForceOfGravi", "g"),
    ("Unit_MilliBar", "mbar"),
    ("m/s2", "m/s^2"),
    ("RPM", "rpm"),
    ("Deg", "deg"),
    ("NM", "N m"),
    ("kPa", "kPa"),
    ("KPA", "kPa"),
    ("", "-"),
    ("pulse count", "pulse count"),
]


@pytest.mark.parametrize(("unit", "expected"), SPELLINGS)
def test_a_unit_is_known_however_a_database_spells_it(unit: str, expected: str) -> None:
    assert spelled(unit) == expected


def test_every_unit_is_spelled_as_itself() -> None:
    for known in CONVERSIONS.values():
        assert all(spelled(unit) == unit for unit in known)


def test_a_pressure_of_1000_mbar_is_a_bar() -> None:
    assert 1000.0 * CONVERSIONS["bar"]["mbar"][0] == pytest.approx(1.0)
