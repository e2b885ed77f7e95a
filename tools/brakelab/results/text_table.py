"""Tables of text: for the terminal (rich) and for the documentation (Markdown)."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from rich.console import Console
from rich.table import Table as RichTable

from ecu.output import give_table


class Table(NamedTuple):
    """A table with a sentence below."""

    title: str
    columns: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    below: str


def cell(value: float, digits: str) -> str:
    """Return a number as the format `digits` says, – where it is not known."""
    return f"{value:{digits}}" if math.isfinite(value) else "–"


def show(console: Console, table: Table) -> None:
    """Print it."""
    give_table(table)
    printed = RichTable(title=table.title, caption=table.below, title_justify="left", caption_justify="left")
    for place, column in enumerate(table.columns):
        left = place == 0 or column == "note"
        printed.add_column(column, justify="left" if left else "right", overflow="fold")
    for row in table.rows:
        printed.add_row(*row)
    console.print(printed)


def markdown(table: Table) -> str:
    """Return it as Markdown."""
    right = ["---" if place == 0 or name == "note" else "---:" for place, name in enumerate(table.columns)]
    lines = [f"## {table.title}", "", _line(table.columns), _line(right), *map(_line, table.rows)]
    return "\n".join([*lines, "", table.below, ""])


def _line(cells: Sequence[str]) -> str:
    bars = [cell.replace("|", "\\|") for cell in cells]
    return f"| {' | '.join(bars)} |"
