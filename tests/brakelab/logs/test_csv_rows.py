"""Marks of thousands and of decimals in a CSV file: which is which follows from all of it."""

from pathlib import Path

import pytest

from brakelab.logs.csv_rows import BLOCK_BYTES, csv_columns, csv_rows
from brakelab.logs.log_quality import Damage


def read(path: Path, text: str) -> dict[str, list[float | None]]:
    path.write_text(text, "utf-8")
    names, delimiter = csv_columns(path)
    found: dict[str, list[float | None]] = {name: [] for name in names}
    for _, batch in csv_rows(path, names, delimiter, names, Damage()):
        for name in names:
            found[name] += [float(cell) if cell else None for cell in batch.column(name).to_pylist()]
    return found


FILES = {
    "whole numbers and grouped ones alone": ("a;b\n987;5\n1,202;6\n12,345;7\n", [987, 1202, 12345]),
    "three decimals everywhere": ("a;b\n0,987;5\n1,202;6\n12,345;7\n", [0.987, 1.202, 12.345]),
    "three decimals, none below one": ("a;b\n2,987;5\n1,202;6\n", [2.987, 1.202]),
    "three decimals beside others": ("a;b\n2,987;5,5\n1,202;6,25\n", [2.987, 1.202]),
    "grouped beside decimal points": ("a;b\n2,987;5.5\n1,202;6.25\n", [2987, 1202]),
    "grouped beside decimal commas": ("a;b\n2.987;5,5\n1.202;6,25\n", [2987, 1202]),
    "ungrouped thousands beside three decimals": ("a;b\n2,987;5\n1202;6\n", [2.987, 1202]),
    "in quotes between commas": ('a,b\n"2,987",5\n"1,202",6\n', [2987, 1202]),
    "in quotes, decimal commas": ('a,b\n"2,987","5,5"\n"1,202","6,25"\n', [2.987, 1.202]),
    "decimal points alone": ("a;b\n987;5\n1.202;6\n", [987, 1.202]),
    "both marks in one cell": ("a;b\n1.234,5;5\n1.234;6\n,5;7\n", [1234.5, 1234, 0.5]),
    "an empty cell": ("a;b\n;5,5\n1.202;6,25\n", [None, 1202]),
}


@pytest.mark.parametrize(("text", "numbers"), FILES.values(), ids=FILES)
def test_a_mark_is_what_all_of_the_file_says(tmp_path: Path, text: str, numbers: list[float | None]) -> None:
    assert read(tmp_path / "a.csv", text)["a"] == numbers


def test_a_block_that_is_grouped_throughout_is_read_as_the_others(tmp_path: Path) -> None:
    """A megabyte of rows above a thousand: 1.234 rpm beside 987 in another block, and pressures in commas."""
    rows = BLOCK_BYTES // 10
    numbers = [float(900 + k) if k < 200 else 1100.0 + k % 700 for k in range(rows)]
    lines = [f"{n:,.0f};{k % 40 / 4:.2f}".replace(",", "_").replace(".", ",") for k, n in enumerate(numbers)]
    found = read(tmp_path / "a.csv", "\n".join(["n;p", *lines, ""]).replace("_", "."))
    assert found["n"] == numbers
    assert found["p"][:3] == [0.0, 0.25, 0.5]


@pytest.mark.parametrize(("rare", "number"), [("1.012,3", 1012.3), ("1.012", 1012.0)])
def test_a_rare_cell_is_read_as_the_file_is(tmp_path: Path, rare: str, number: float) -> None:
    """In two rows of a megabyte, which no sample sees."""
    rows = BLOCK_BYTES // 10
    pressures = [f"{k / 4:.2f}".replace(".", ",") for k in range(40)]
    lines = [f"{rare if k in (70_001, 70_002) else 900};{pressures[k % 40]}" for k in range(rows)]
    found = read(tmp_path / "a.csv", "\n".join(["n;p", *lines, ""]))
    assert found["n"][70_000:70_003] == [900.0, number, number]
