"""Friction as a table over temperature and pressure."""

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from brakelab.plant.friction.laws import friction, law_row
from brakelab.plant.friction.table import Table
from tests.brakelab.plant.friction.test_laws import BRAKE_A, TABLE


@pytest.mark.parametrize(
    ("temperature", "pressure_bar", "expected"),
    [
        (20.0, 10.0, 0.30),
        (-10.0, 5.0, 0.30),
        (500.0, 200.0, 0.35),
        (75.0, 10.0, 0.34),
        (100.0, 25.0, 0.38),
        (150.0, 65.0, (0.40 + 0.43 + 0.42 + 0.45) / 4.0),
        (300.0, 40.0, 0.38),
    ],
)
def test_a_table_is_bilinear_and_constant_outside(
    temperature: float, pressure_bar: float, expected: float
) -> None:
    number, row = law_row(TABLE, BRAKE_A)
    memory, mu = friction(number, np.array(row), 1.0, 1e5 * pressure_bar, 10.0, 5.0, temperature, 1e-3)
    assert (memory, mu) == (1.0, pytest.approx(expected))


@pytest.mark.parametrize(("temperatures", "pressures"), [(2, 2), (30, 30), (3, 11)])
def test_a_table_of_any_size_is_scipy_s(temperatures: int, pressures: int) -> None:
    random = np.random.default_rng(temperatures)
    heat, bar = np.linspace(0.0, 500.0, temperatures), np.linspace(5.0, 120.0, pressures)
    mu = random.uniform(0.2, 0.6, (pressures, temperatures))
    table = Table(
        law="table", rig_mass=1000.0, temperature=tuple(heat), pressure=tuple(bar), mu=tuple(map(tuple, mu))
    )
    number, row = law_row(table, BRAKE_A)
    theirs = RegularGridInterpolator((bar, heat), mu)
    for at_bar, at_heat in random.uniform((5.0, 0.0), (120.0, 500.0), (200, 2)):
        _, found = friction(number, row, 1.0, 1e5 * at_bar, 10.0, 5.0, at_heat, 1e-3)
        assert found == pytest.approx(float(theirs((at_bar, at_heat))))


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"temperature": (20.0, 50.0, 40.0, 200.0, 300.0, 400.0)}, "temperature must rise"),
        ({"pressure": (10.0, 40.0)}, "give mu 2 rows, one per pressure, of 6"),
        ({"temperature": (20.0, 50.0)}, "give mu 3 rows, one per pressure, of 2"),
    ],
)
def test_a_table_that_is_none_is_refused(change: dict[str, object], line: str) -> None:
    with pytest.raises(ValueError, match=line):
        Table.model_validate(TABLE.model_dump() | change)


def test_a_table_larger_than_a_row_is_refused() -> None:
    knots = tuple(float(k) for k in range(40))
    with pytest.raises(ValueError, match="40 temperatures by 40 pressures are too many"):
        Table(law="table", rig_mass=1.0, temperature=knots, pressure=knots, mu=((0.4,) * 40,) * 40)
