"""Report, fleet and study have the limits of one table, and none calls a van above what it may emit."""

import pytest

from brakelab.results import euro7
from brakelab.studies.dust.cycles import LIMITS, TEXT

LIMITS_TEXT = "7, battery electric 3; heavier vans 11, battery electric 5"


def test_the_table_is_that_of_the_regulation() -> None:
    assert LIMITS_TEXT == euro7.WORDS
    assert LIMITS == {"suv": 7.0, "sedan": 7.0, "lcv": 11.0, "suv-blended": 3.0}
    assert f"to cars {LIMITS_TEXT}" in TEXT


@pytest.mark.parametrize(("mass", "above"), [(2.9, False), (8.0, False), (11.0, False), (11.1, True)])
def test_a_vehicle_of_unknown_category_is_above_what_no_limit_allows(mass: float, above: bool) -> None:
    assert euro7.above_all(mass) is above
    assert not euro7.above_all(float("nan"))
