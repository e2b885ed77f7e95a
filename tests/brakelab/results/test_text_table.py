"""Tables as Markdown."""

from brakelab.results.text_table import Table, markdown


def test_a_bar_in_a_cell_is_no_new_cell() -> None:
    lines = markdown(Table("Terms", ("term", "n"), [("α': |ω'|", "3")], "Below.")).splitlines()
    assert lines == ["## Terms", "", "| term | n |", "| --- | ---: |", "| α': \\|ω'\\| | 3 |", "", "Below."]
