"""`brake-ecu bench lies`: inputs that lie, in closed loop."""

from typing import Final

from brakelab.studies import lies
from brakelab.studies.lies_table import lie_tables
from brakelab.studies.study import Asked, Measured, Study

SOUND: Final = 6
"""Sound cars that are driven for false alarms."""
TEXT: Final = (
    f"{lies.BRAKINGS} brakings of {lies.DECEL:g} m/s² from 28 m/s, armed; from t = {lies.BEGIN:g} s on one "
    "input, or those of one frame, lie. Force is that of linings and motors over that of the same car "
    f"without the lie, at the same time in the same braking, above {lies.LOWEST_SPEED:g} m/s. What it falls "
    f"below for {lies.SHORT_S:g} s is the most that the lie takes; a lie costs where it is off by more than "
    f"{100 * lies.COSTS:g} % for {lies.LONG_S:g} s, and is told in time where the bit of its own input comes "
    "no later than 2 s after the begin of that. Cars of the wide draw, seed 1. "
    "[faults.md](../faults.md) says what is left out, and by which witnesses."
)


def _run(asked: Asked) -> Measured:
    return Measured(lie_tables(lies.all_cells(), min(asked.seeds, SOUND)))


STUDY: Final = Study("Inputs that lie", TEXT, _run)
