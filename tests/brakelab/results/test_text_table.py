"""Tables as Markdown."""

import math

import pytest
from rich.console import Console

from brakelab.results.text_table import Table, cell, markdown, show


def test_a_bar_in_a_cell_is_no_new_cell() -> None:
    lines = markdown(Table("Terms", ("term", "n"), [("α': |ω'|", "3")], "Below.")).splitlines()
    assert lines == ["## Terms", "", "| term | n |", "| --- | ---: |", "| α': \\|ω'\\| | 3 |", "", "Below."]


@pytest.mark.parametrize(
    ("value", "digits", "shown"),
    [(1.25, ".1f", "1.2"), (3.0, "+.0f", "+3"), (math.nan, ".1f", "–"), (-math.inf, "+.1f", "–")],
)
def test_what_is_not_known_is_a_dash(value: float, digits: str, shown: str) -> None:
    assert cell(value, digits) == shown


def test_nothing_is_cut_on_a_narrow_terminal() -> None:
    console = Console(width=40)
    with console.capture() as capture:
        show(console, Table("Terms", ("configuration", "measurement", "uncertainty"), [("0", "1", "2")], ""))
    assert "…" not in capture.get()
