"""Tables of the study of inputs that lie."""

import math
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from brakelab.results.text_table import Table
from brakelab.simulation.closed_loop import new_loop, run
from brakelab.studies.accuracy.observers_cases import shipped
from brakelab.studies.lies import CARS, COSTS, INPUTS, LONG_S, ROADS, SHORT_S, Cell
from ecu.contract.faults import IMPLAUSIBLE, fault_mask, fault_names
from ecu.settings.config import load_config
from ecu.settings.resources import resource

TAKES: Final = 0.1
IN_TIME: Final = 2.0  # s
WORST: Final = 20
HOUR: Final = "real-driving"


def _counted(cells: Sequence[Cell]) -> tuple[str, ...]:
    costly = [cell for cell in cells if cell.costs]
    told = sum(cell.late_s <= IN_TIME for cell in costly)
    return (
        str(len(cells)),
        f"{min(cell.least_short for cell in cells):.2f}",
        f"{min(cell.least_long for cell in cells):.2f}–{max(cell.most_long for cell in cells):.2f}",
        str(sum(cell.least_short < 1.0 - TAKES for cell in cells)),
        str(len(costly)),
        f"{told} ({100 * told / len(costly):.0f} %)" if costly else "–",
    )


def _grouped(
    title: str, by: str, names: Sequence[str], of: Callable[[Cell], str], cells: list[Cell]
) -> Table:
    rows = [(name, *_counted(own)) for name in names if (own := [c for c in cells if of(c) == name])]
    columns = (
        *(by, "lies", f"least force for {SHORT_S:g} s", f"least and greatest for {LONG_S:g} s"),
        *(
            f"more than {100 * TAKES:.0f} % taken",
            f"more than {100 * COSTS:.0f} % off",
            "of them told in time",
        ),
    )
    return Table(title, columns, [*rows, ("all", *_counted(cells))], "")


def _seconds(value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.1f}"


def _worst(cells: list[Cell]) -> Table:
    off = sorted(cells, key=lambda cell: min(cell.least_short, 2.0 - cell.most_long))[:WORST]
    rows = [
        (
            f"{cell.input}: {cell.lie}",
            f"{cell.car}, {cell.road}",
            *(f"{value:.2f}" for value in (cell.least_short, cell.least_long, cell.most_long, cell.mean)),
            *(_seconds(cell.named_s), _seconds(cell.late_s)),
            ", ".join(fault_names(cell.others)) or "–",
        )
        for cell in off
    ]
    columns = (
        *("lie", "car, road", f"least for {SHORT_S:g} s", f"least for {LONG_S:g} s"),
        *(f"greatest for {LONG_S:g} s", "mean", "named after [s]", "after it costs [s]", "other faults"),
    )
    return Table(f"The {WORST} worst", columns, rows, "")


def _alarms(cars: int) -> Table:
    """False alarms of sound cars over the hour of real driving."""
    own, rows = sum(IMPLAUSIBLE.values()), []
    for seed in range(cars):
        drive = run(new_loop(shipped(HOUR), load_config(resource("config/suv.toml")), seed))
        masks = fault_mask(drive.outputs) & own
        names = fault_names(int(np.bitwise_or.reduce(masks)))
        rows.append((f"car {seed}", f"{drive.t[-1] / 3600.0:.1f}", ", ".join(names) or "none"))
    return Table("Sound cars, real driving", ("car", "hours", "inputs named"), rows, "")


def lie_tables(cells: list[Cell], cars: int) -> list[Table]:
    """Return the tables of the page; `cars`: sound ones that drive for false alarms."""
    roads = [f"{car}, {road}" for car in CARS for road in ROADS]
    return [
        _grouped("By car and road", "car, road", roads, lambda cell: f"{cell.car}, {cell.road}", cells),
        _grouped("By input", "input", INPUTS, lambda cell: cell.input, cells),
        _worst(cells),
        _alarms(cars),
    ]
