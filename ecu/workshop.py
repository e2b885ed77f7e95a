"""What a workshop does to what a run has learned; between two cycles, in the loop as in a replay."""

from typing import Final

from ecu.algorithm.step import new_state
from ecu.contract.records import RecordArray
from ecu.contract.signals import CORNERS
from ecu.contract.work import Kind, Work
from ecu.pads import GAUGE, add_measurement, fit_new

OF_WEAR: Final = ("wear",)
OF_ALL: Final = (
    "speed",
    "joint",
    "whole",
    "wheels",
    "force",
    "observer",
    "friction",
    "control",
    "prediction",
    "learned",
    "estimate",
)
"""Parts of STATE that begin anew."""
NEVER_FORGOTTEN: Final = ("wear", "dust", "disc_excess", "brakings")
"""Of LEARNED: what was counted, and how hot the discs are."""


def do(work: Work, params: RecordArray, state: RecordArray) -> None:
    """Do it to `state` (`STATE`, shape (1,)); `params` is `PARAMS`, shape (1,)."""
    learned = state["learned"].copy()
    if work.kind == Kind.FORGET:
        unadapted = new_state(params)["learned"]
        for name in NEVER_FORGOTTEN:
            unadapted[name] = learned[name]
        learned = unadapted
    for corner, lost in work.wear.items():
        if work.kind == Kind.NEW_PADS:
            fit_new(learned[0]["wear"], corner)
        else:
            add_measurement(learned[0]["wear"], CORNERS.index(corner), lost, GAUGE)
    state["learned"] = learned
    begun = new_state(params, learned)
    for name in OF_ALL if work.kind == Kind.FORGET else OF_WEAR:
        state[name] = begun[name]
