"""Tables as Markdown."""

import math

import pytest

from brakelab.results.text_table import Table, cell, markdown


def test_a_bar_in_a_cell_is_no_new_cell() -> None:
    lines = markdown(Table("Terms", ("term", "n"), [("α': |ω'|", "3")], "Below.")).splitlines()
    assert lines == ["## Terms", "", "| term | n |", "| --- | ---: |", "| α': \\|ω'\\| | 3 |", "", "Below."]


@pytest.mark.parametrize(
    ("value", "digits", "shown"),
    [(1.25, ".1f", "1.2"), (3.0, "+.0f", "+3"), (math.nan, ".1f", "–"), (-math.inf, "+.1f", "–")],
)
def test_what_is_not_known_is_a_dash(value: float, digits: str, shown: str) -> None:
    assert cell(value, digits) == shown
