"""Results as tables of text: for the terminal (rich) and for the documentation (Markdown)."""

from collections.abc import Sequence
from typing import NamedTuple

from rich.console import Console
from rich.table import Table as RichTable

from brakelab.studies.measure import Figure, Row
from brakelab.studies.stops import Stops


class Table(NamedTuple):
    """A table with a sentence below."""

    title: str
    columns: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    below: str


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


def stop_tables(result: Stops, seeds: int) -> list[Table]:
    """Return the tables of accuracy and of compensation."""

    def known(vehicle_speed: bool) -> str:
        return "yes" if vehicle_speed else "no"

    friction = [
        (
            f"#{row.test} {row.axle}",
            known(row.vehicle_speed),
            f"{row.nrmse.median:.2f}",
            f"{row.nrmse.high:.2f}",
            f"{row.inside_2_sigma:.0f}",
            f"{row.thesis:.2f}",
            f"{row.nominal.median:.2f}",
        )
        for row in result.friction
    ]
    compensation = [
        (
            f"#{row.test}",
            known(row.vehicle_speed),
            *(
                f"{figure.median:.2f} ({figure.low:.2f}–{figure.high:.2f})"
                for figure in (
                    row.to_demand,
                    row.to_demand_uncompensated,
                    row.to_ideal,
                    row.to_ideal_uncompensated,
                )
            ),
        )
        for row in result.compensation
    ]
    return [
        Table(
            "Friction: nRMSE [%]",
            (
                "test, axle",
                "vehicle_speed",
                "median",
                "worst car",
                "truth inside 2σ [%]",
                "thesis, Obs. 2",
                "nominal friction",
            ),
            friction,
            f"Over {seeds} cars. The thesis's column is its Table 4.3; in the last one the configured 0.45 "
            "is taken as the estimate.",
        ),
        Table(
            "Deceleration: mean relative error [%]",
            (
                "test",
                "vehicle_speed",
                "to demand",
                "to demand, uncompensated",
                "to ideal",
                "to ideal, uncompensated",
            ),
            compensation,
            f"Median (least–greatest) over {seeds} cars. Ideal: the same controller in the same car, told "
            "the true friction. The error to the demand holds that of the mass too.",
        ),
    ]


def show(console: Console, table: Table) -> None:
    """Print it."""
    printed = RichTable(title=table.title, caption=table.below, title_justify="left", caption_justify="left")
    for place, column in enumerate(table.columns):
        printed.add_column(column, justify="left" if place == 0 or column == "note" else "right")
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
