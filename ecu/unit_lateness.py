"""Pressures that follow their demands later, or sooner, than CONFIG says: the line on it; when it is sure."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ecu.algorithm.hydraulics import (
    ALLOWED,
    HYDRAULICS_STATE,
    LONGEST_DEAD_TIME,
    RELEASED,
    UNKNOWN,
    advance_pressures,
    learn_lateness,
)
from ecu.contract.params import BAR
from ecu.contract.records import RecordArray
from ecu.contract.signals import CALLIPER_PRESSURE, CYCLE_NS

VERBS: Final = ("rise", "fall")
SIGMAS: Final = 2.0
PUNCTUAL: Final = round(1e9 * LONGEST_DEAD_TIME) // CYCLE_NS
"""Cycles before a pressure counts: what was late by then has moved it."""


def lateness_line(params: Any, outputs: Any) -> str:
    """Return the line on a run that braked, or empty; one `PARAMS`, and its last `OUTPUTS`."""
    found = []
    for place, verb in enumerate(VERBS):
        expected = float(params["dead_time"][place] + params["pressure_lag"][place])
        shown = float(outputs[f"pressure_lateness_{verb}"])
        if abs(shown - expected) > ALLOWED:
            found.append(f"{verb} {1e3 * shown:.0f} ms after their demands (CONFIG: {1e3 * expected:.0f} ms)")
    return f"pressures {' and '.join(found)}: correct dead times and lags of [hydraulics]" if found else ""


def sure_lateness(params: Any, outputs: RecordArray, inputs: RecordArray, zero: Any) -> dict[str, float]:
    """Return the lateness of pressures [s] by `lateness_line`'s names, NaN unless it surely is not CONFIG's.

    Each braking shows its own, where all pressures and cycles came in time: a simulated car
    that was held up applies a demand to the time that it makes up for. The mean of two or more counts, by
    their spread.

    Args:
        params: one `PARAMS`.
        outputs: `OUTPUTS`, shape (n,), of n cycles.
        inputs: `INPUTS`, shape (n,).
        zero: pressure zeros [bar], shape (n, 4).
    """
    state, none_failed, punctual = np.zeros(1, HYDRAULICS_STATE)[0], np.zeros(4, np.int64), 0
    brakings: tuple[list[Any], ...] = tuple([] for _ in VERBS)
    demands, regular = BAR * outputs["pressure_demand"], _regular(inputs)
    for k in range(1, len(outputs)):
        punctual = punctual + 1 if regular[k] else 0
        if punctual > PUNCTUAL:
            learn_lateness(params, state, inputs[k], zero[k], none_failed, 1e-9 * CYCLE_NS)
        for _ in range(int(inputs["dt_ns"][k]) // CYCLE_NS):
            advance_pressures(params, state, demands[k - 1])
        if state["model"].max() < RELEASED:
            for late, known, found in zip(state["late"], state["late_known"], brakings, strict=True):
                found += [(late * (1.0 + 1.0 / (known * UNKNOWN**2)), known)] if known else []
            state["late"] = state["late_known"] = 0.0
    usual = params["dead_time"] + params["pressure_lag"]
    return {
        f"pressure_lateness_{verb}": float(usual[place] + _sure(*np.reshape(brakings[place], (-1, 2)).T))
        for place, verb in enumerate(VERBS)
    }


def _regular(inputs: RecordArray) -> NDArray[np.bool_]:
    """Return whether a cycle missed no period and no pressure, shape (n,), at the rate at which they come."""
    new = inputs["new"][:, CALLIPER_PRESSURE : CALLIPER_PRESSURE + 4].all(axis=1)
    cycles = np.arange(len(inputs))
    usual = np.median(np.append(np.diff(cycles[new]), np.inf))
    regular: NDArray[np.bool_] = cycles - np.maximum.accumulate(np.where(new, cycles, -np.inf)) < usual
    return regular & (inputs["dt_ns"] == CYCLE_NS)


def _sure(late: NDArray[np.float64], known: NDArray[np.float64]) -> float:
    """Return the mean of brakings [s], NaN unless surely beyond `ALLOWED`; `known`: 1 / variance of each."""
    if late.size < 2:
        return np.nan
    mean, all_known = float(np.average(late, weights=known)), float(known.sum())
    scatter = float(np.average((late - mean) ** 2, weights=known)) / (len(late) - 1)
    sigma = max(scatter, 1.0 / all_known) ** 0.5
    return mean if abs(mean) > ALLOWED + SIGMAS * sigma else np.nan
