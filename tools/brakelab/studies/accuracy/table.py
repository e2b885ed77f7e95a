"""Figures and results of time benches as text."""

from collections.abc import Sequence

from brakelab.results.text_table import Table
from brakelab.studies.measure import Figure, Row


def _number(value: float) -> str:
    return f"{value:.3g}" if value < 1000.0 else f"{value:.0f}"


def spread(value: Figure) -> str:
    """Return "median (least–greatest)"."""
    return f"{_number(value.median)} ({_number(value.low)}–{_number(value.high)})"


def time_table(title: str, rows: Sequence[Row], below: str) -> Table:
    """Return rows of times, each figure as median (least–greatest) over the rounds."""
    lines = [
        (
            row.what,
            spread(row.ours),
            "–" if row.peer is None else spread(row.peer),
            "–" if row.ratio is None else _number(row.ratio),
            row.unit,
            row.note,
        )
        for row in rows
    ]
    return Table(title, ("what", "ours", "peer", "peer / ours", "unit", "note"), lines, below)
