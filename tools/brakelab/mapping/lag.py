"""Lags that a drive shows, in the map of columns."""

import re
from pathlib import Path

from brakelab.logs.column_map import LONGEST_LAG_S, ColumnMap, read_column_map
from brakelab.logs.physics.lags import Lag
from brakelab.results.outputs import write_text
from ecu.errors import UserError
from ecu.output import say, wrote


def lag_line(lag: Lag, stated: ColumnMap | None) -> str:
    """Return what a lag is, with the remedy; `stated`: the map's content, None: it is of frames."""
    if stated is None:
        return lag.line
    total = _total(lag, stated)
    if abs(total) > LONGEST_LAG_S:
        return f"{lag.line}; a map takes lags up to {LONGEST_LAG_S:g} s: mend the log"
    return f"{lag.line}; lag = {total:.2f}"


def write_lags(map: Path, stated: ColumnMap, lags: list[Lag], out: Path) -> None:
    """Write a map of columns with `lags` beside those that it states to `out`; say what was written.

    Raises:
        UserError: an input is not on a line of its own, or `out` cannot be written.
    """
    text = map.read_text("utf-8")
    for lag in lags:
        total = _total(lag, stated)
        for name in _inputs(lag, stated):
            if abs(total) <= LONGEST_LAG_S:
                text = _with_lag(text, name, total, map)
    write_text(out, text)
    read_column_map(out)
    if not lags:
        say("the drive shows no lag")
    wrote(out)


def _inputs(lag: Lag, stated: ColumnMap) -> list[str]:
    return [name for name in stated.inputs if name == lag.name or name.startswith(f"{lag.name}_")]


def _total(lag: Lag, stated: ColumnMap) -> float:
    """Return the lag beside that which was taken off already [s]."""
    return lag.seconds + stated.inputs[_inputs(lag, stated)[0]].lag


def _with_lag(text: str, name: str, seconds: float, map: Path) -> str:
    line = re.compile(rf"^(\s*{name}\s*=\s*\{{.*?)(?:,\s*lag\s*=\s*[-+.\d]+)?(\s*\}}.*)$", re.MULTILINE)
    text, count = line.subn(rf"\g<1>, lag = {seconds:.2f}\g<2>", text)
    if count != 1:
        remedy = f"not written as {name} = {{ … }} on a line of its own; add lag = {seconds:.2f} by hand"
        raise UserError(str(map), f"inputs.{name}", remedy)
    return text
