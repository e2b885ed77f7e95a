"""`brake-ecu bench lies`: inputs that lie, in closed loop."""

import math
from collections.abc import Callable, Sequence
from itertools import product
from typing import Final

import numpy as np

from brakelab.results.text_table import Table
from brakelab.simulation.closed_loop import new_loop, run
from brakelab.simulation.configured import configured, shipped
from brakelab.studies import lies, lies_cell
from brakelab.studies.lies import CARS, INPUTS, ROADS
from brakelab.studies.lies_cell import COSTS, LONG_S, SHORT_S, TAKES, Cell
from brakelab.studies.study import Asked, Measured, Study
from ecu.contract.faults import IMPLAUSIBLE, fault_mask, fault_names

IN_TIME: Final = 2.0  # s
WORST_LIES: Final = 10
HOUR: Final = "real-driving"
ASIDE: Final = 0.03
"""Change of friction or motors that is named as a cause."""


def driven(cells: list[Cell]) -> str:
    """Return the sentence on how much of the grid `cells` are."""
    there = {(cell.car, cell.road) for cell in cells}
    missing = [f"{car} {road}" for car, road in product(CARS, ROADS) if (car, road) not in there]
    if not missing:
        return f"{len(cells)} lies, every car on every road."
    return f"{len(cells)} lies; not driven: {', '.join(missing)}."


def _counted(cells: Sequence[Cell]) -> tuple[str, ...]:
    costly = [cell for cell in cells if cell.costs]
    reported = sum(cell.late_s <= IN_TIME for cell in costly)
    return (
        str(len(cells)),
        f"{min(cell.least_short for cell in cells):.2f}",
        f"{min(cell.least_long for cell in cells):.2f}–{max(cell.most_long for cell in cells):.2f}",
        f"{np.mean([cell.mean for cell in cells]):.3f}",
        str(sum(cell.least_short < 1.0 - TAKES for cell in cells)),
        f"{max(cell.taken_s for cell in cells):.1f}",
        str(len(costly)),
        f"{max(cell.off_s for cell in cells):.1f}",
        f"{reported} ({100 * reported / len(costly):.0f} %)" if costly else "–",
    )


def _names(mask: int) -> str:
    return ", ".join(fault_names(mask)) or "–"


def _grouped(
    title: str, by: str, names: Sequence[str], of: Callable[[Cell], str], cells: list[Cell]
) -> Table:
    rows = [(name, *_counted(own)) for name in names if (own := [c for c in cells if of(c) == name])]
    columns = (
        *(by, "lies", f"least force for {SHORT_S:g} s", f"least and greatest for {LONG_S:g} s", "mean"),
        *(f"more than {100 * TAKES:.0f} % taken for {SHORT_S:g} s", "longest [s]"),
        *(f"more than {100 * COSTS:.0f} % off for {LONG_S:g} s", "longest [s]", "of them reported in time"),
    )
    return Table(title, columns, [*rows, ("all", *_counted(cells))], "")


def _seconds(value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.1f}"


def why(cell: Cell) -> str:
    """Return the cause of a cell in words: friction, motors, faults, or none of these."""
    found = []
    for axle, share in zip(("front", "rear"), cell.cause.friction, strict=True):
        if abs(share - 1.0) > ASIDE:
            found.append(f"{axle} friction believed {100 * (share - 1.0):+.0f} %")
    if abs(cell.cause.motors - 1.0) > ASIDE:
        found.append(f"motors asked for {100 * cell.cause.motors:.0f} %")
    return ", ".join([*found, *fault_names(cell.cause.faults)]) or "none of these"


def _worst(cells: list[Cell]) -> Table:
    off = sorted(cells, key=lambda cell: min(cell.least_short, 2.0 - cell.most_long))[:WORST_LIES]
    rows = [
        (
            f"{cell.input}: {cell.lie}",
            f"{cell.car}, {cell.road}",
            *(f"{value:.2f}" for value in (cell.least_short, cell.least_long, cell.most_long, cell.mean)),
            *(f"{value:.1f}" for value in (cell.taken_s, cell.off_s)),
            *(_seconds(cell.named_s), _seconds(cell.late_s)),
            _names(cell.first),
            why(cell),
        )
        for cell in off
    ]
    columns = (
        *("lie", "car, road", f"least for {SHORT_S:g} s", f"least for {LONG_S:g} s"),
        *(f"greatest for {LONG_S:g} s", "mean", f"more than {100 * TAKES:.0f} % taken [s]"),
        *(f"more than {100 * COSTS:.0f} % off [s]", "named after [s]", "after it costs [s]"),
        *("reported first", "where it is worst"),
    )
    return Table(f"The {WORST_LIES} worst", columns, rows, "")


def _alarms(cells: list[Cell], cars: int) -> Table:
    """False alarms of the grid's sound cars, and of `cars` others over the hour of real driving."""
    sound = {(cell.car, cell.road): cell.alarms for cell in cells}
    rows = [(f"{car}, {road}, car 1", "–", _names(mask)) for (car, road), mask in sound.items()]
    own = sum(IMPLAUSIBLE.values())
    for seed in range(cars):
        drive = run(new_loop(shipped(HOUR), configured(), seed))
        mask = int(np.bitwise_or.reduce(fault_mask(drive.outputs) & own))
        rows.append((f"suv, real driving, car {seed}", f"{drive.t[-1] / 3600.0:.1f}", _names(mask)))
    return Table("False alarms of sound cars", ("drive", "hours", "inputs named"), rows, "")


def drift_table(cells: list[Cell]) -> Table:
    """Return the table of slow drifts: when each is named, and the force until and after that."""
    found = {(cell.input, *cell.lie.split(maxsplit=1)): cell for cell in cells}
    rates = [rate for rate in lies.SLOW if rate > 0.0]
    rows = []
    for name, kind in dict.fromkeys(key[:2] for key in found):
        row = []
        for rate in rates:
            both = [found[name, kind, f"{sign * rate:+g} %/s"] for sign in (1.0, -1.0)]
            least, most = min(c.least_long for c in both), max(c.most_long for c in both)
            row += [" / ".join(_seconds(c.named_s) for c in both), f"{least:.2f}–{most:.2f}"]
        rows.append((name, "scale" if kind == "ramp" else "zero", *row))
    columns = [f"{rate:g} %/s: {what}" for rate in rates for what in ("named after [s]", "force")]
    car, road = lies.SLOW_ON
    title = f"Drifts that are slow: {car}, {road}, {lies.MANY} brakings"
    note = (
        "When the one upwards and the one downwards are named, and the force that both fall below or stay "
        f"above for {LONG_S:g} s, the least and the greatest."
    )
    return Table(title, ("input", "drift of", *columns), rows, note)


def lie_tables(cells: list[Cell], cars: int) -> list[Table]:
    """Return the tables of the page; `cars`: sound ones that drive for false alarms."""
    roads = [f"{car}, {road}" for car in CARS for road in ROADS]
    return [
        _grouped("By car and road", "car, road", roads, lambda cell: f"{cell.car}, {cell.road}", cells),
        _grouped("By input", "input", INPUTS, lambda cell: cell.input, cells),
        _worst(cells),
        _alarms(cells, cars),
    ]


SOUND: Final = 6
"""Sound cars that are driven for false alarms."""
TEXT: Final = (
    f"{lies.BRAKINGS} brakings of {lies_cell.DECEL:g} m/s² from 28 m/s, armed; from "
    f"t = {lies_cell.BEGIN:g} s on one input, or those of one frame, lie. Force is that of linings and "
    "motors over that of the same car without the lie, at the same time in the same braking, above "
    f"{lies_cell.LOWEST_SPEED:g} m/s. What it falls below for {lies_cell.SHORT_S:g} s is the most that the "
    f"lie takes; a lie costs where it is off by more than {100 * lies_cell.COSTS:g} % for "
    f"{lies_cell.LONG_S:g} s, and is reported in time where the bit of its own input is set no later than "
    "2 s after that began. Where a lie is worst, the friction that the ECU believes over the true one, "
    "and the motors' demand, are compared with the sound car's at the same time of that braking; faults are "
    "those that only the lie brings. Cars of the wide draw: lies by car 1, sound cars by the number in the "
    "table. [faults.md](../faults.md) says what is left out, and by which witnesses."
)


def _run(asked: Asked) -> Measured:
    cells = lies.all_cells()
    tables = [*lie_tables(cells, min(asked.seeds, SOUND)), drift_table(lies.all_cells(slow=True))]
    return Measured(tables, f", {driven(cells).rstrip('.')}")


STUDY: Final = Study("Inputs that lie", TEXT, _run)
