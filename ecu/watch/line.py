"""A watched daemon as one line of text or JSON, for pipes and logs."""

import json
import math
import time

from ecu.contract.faults import WORDS, fault_mask, fault_names
from ecu.contract.signals import CORNERS
from ecu.recording.events import MODES
from ecu.watch.history import COLUMN, COLUMNS, GRIP, LATENESS_US, OF_CORNERS, Row, frames_text
from ecu.watch.inputs import InputRow
from ecu.watch.watcher import Watcher


def faults_of(row: Row) -> list[str]:
    """Return the names of the faults that are active in a row."""
    return fault_names(int(fault_mask({name: row[COLUMN[name]] for name in WORDS})))


def mode_of(row: Row) -> str:
    """Return the ECU's mode in a row by name."""
    mode = row[COLUMN["mode"]]
    return MODES[int(mode)] if math.isfinite(mode) and 0 <= mode < len(MODES) else "?"


def corner_values(row: Row, name: str) -> list[float]:
    """Return a quantity of the four corners."""
    first = COLUMN[f"{name}_{CORNERS[0]}"]
    return [float(value) for value in row[first : first + len(CORNERS)]]


def number(value: float, digits: int = 0) -> str:
    """Return a number with so many decimals, a dash for one that is not available; nothing is minus zero."""
    if not math.isfinite(value):
        return "–"
    return f"{round(value, digits) + 0.0:.{digits}f}"


def ceiling(row: Row) -> str:
    """Return the ceiling of grip as text, empty where none is estimated."""
    limit, sigma = (float(row[COLUMN[name]]) for name in GRIP)
    return f", ceiling of grip {number(limit, 1)}±{number(sigma, 1)}" if math.isfinite(limit) else ""


def _clock(seconds: float) -> str:
    return time.strftime("%H:%M:%S", time.localtime(seconds))


def text_line(watcher: Watcher) -> str:
    """Return the state now as one line of text."""
    if watcher.trouble or not watcher.history.rows:
        return f"{_clock(time.time())} {watcher.trouble or 'attached, no cycle yet'}"
    row = watcher.history.rows[-1]
    friction = " ".join(
        f"{number(mu, 3)}±{number(sigma, 3)}"
        for mu, sigma in zip(corner_values(row, "mu_b"), corner_values(row, "sigma_mu_b"), strict=True)
    )
    pressures = "/".join(map(number, corner_values(row, "calliper_pressure")))
    discs = "/".join(map(number, corner_values(row, "disc_temperature")))
    faults = ", ".join(faults_of(row)) or "no fault"
    demanded, measured = row[COLUMN["decel_demand_total"]], -row[COLUMN["accel_x_road"]]
    return (
        f"{_clock(row[COLUMN['clock']])} {mode_of(row)}{'' if row[COLUMN['speaks']] else ' (silent)'}"
        f" {number(row[COLUMN['vehicle_speed']], 1)} m/s"
        f" decel {number(demanded, 2)}→{number(measured, 2)} m/s²{ceiling(row)}"
        f" mu {friction} {pressures} bar {discs} °C"
        f" late {row[COLUMN['lateness']]:.0f} µs missed {watcher.history.missed}"
        f" frames {frames_text(watcher.history.frames)}; {faults}"
    )


def json_line(watcher: Watcher) -> str:
    """Return the state now as one line of JSON: corner quantities as lists in the order fl fr rl rr."""
    if watcher.trouble or not watcher.history.rows:
        return json.dumps({"clock": round(time.time(), 3), "trouble": watcher.trouble or None})
    row = watcher.history.rows[-1]
    plain = {
        name: _number(float(row[COLUMN[name]]))
        for name in COLUMNS
        if name[-3:] not in {f"_{corner}" for corner in CORNERS}
    }
    corners = {name: [_number(value) for value in corner_values(row, name)] for name in OF_CORNERS}
    lateness = dict(zip([*map(str, LATENESS_US), "inf"], watcher.history.lateness.tolist(), strict=True))
    return json.dumps(
        {
            **plain,
            **corners,
            **{name: round(float(row[COLUMN[name]]), 3) for name in ("t", "clock")},
            "mode": mode_of(row),
            "faults": faults_of(row),
            "cycles": watcher.history.cycles,
            "missed": watcher.history.missed,
            "frames": watcher.history.frames,
            "inputs": {row.name: _values(row) for row in watcher.history.inputs},
            "lateness_us": lateness,
            "daemon": watcher.daemon.label if watcher.daemon else None,
        }
    )


def _values(row: InputRow) -> dict[str, float | int | bool | str | None]:
    """Return what an input's row holds beside its name; null: never, or not available."""
    values = row._asdict()
    del values["name"]
    return {name: _number(value) if isinstance(value, float) else value for name, value in values.items()}


def _number(value: float) -> float | int | None:
    if not math.isfinite(value):
        return None
    return int(value) if value.is_integer() else float(f"{value:.6g}")
