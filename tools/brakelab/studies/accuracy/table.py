"""Results of time benches and of stops as tables of text."""

from collections.abc import Sequence

from brakelab.results.text_table import Table
from brakelab.studies.accuracy.stops import Stops
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
