"""`brake-ecu bench lies`: inputs that lie, in closed loop."""

from typing import Final

from brakelab.studies import lies, lies_cell
from brakelab.studies.lies_table import driven, lie_tables
from brakelab.studies.study import Asked, Measured, Study

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
    return Measured(lie_tables(cells, min(asked.seeds, SOUND)), f", {driven(cells).rstrip('.')}")


STUDY: Final = Study("Inputs that lie", TEXT, _run)
