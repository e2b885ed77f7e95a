"""`brake-ecu map check`: a dry run of a map: the signal of each input, its rate and gaps, its physics."""

from pathlib import Path
from typing import Any, Final, NamedTuple

from rich.box import SIMPLE
from rich.table import Table

from brakelab.logs.physics.judge import judge, range_lines
from brakelab.logs.physics.lags import lags
from brakelab.logs.physics.samples import ANY_CAR, Collector, car_of
from brakelab.mapping.lag import lag_line, write_lags
from brakelab.replay.engine import new_ecu
from brakelab.replay.log import log_size, replay_log
from brakelab.replay.needed import needed_lines
from brakelab.replay.quality import Findings, quality_counts, quality_lines
from brakelab.replay.source import Source, announced, check_map, delay_line, load_source, radius_line
from brakelab.results.console import new_console
from brakelab.results.outputs import check_outputs, config_files
from brakelab.results.progress import progress_bar
from ecu.bus.signal_map import read_signal_map
from ecu.contract.signals import without_corner
from ecu.errors import UserError
from ecu.output import give
from ecu.settings.config import load_config, new_params
from ecu.settings.resources import resource

WIDTH: Final = 140  # columns where no terminal says how wide it is
JUDGED: Final = ("wheel_speed", "accel_x", "yaw_rate", "accel_y", "steering_angle", "calliper_pressure")


def check(log: Path, map: Path, config: Path | None, out: Path | None = None) -> int:
    """Print the signal of each input and the drive's findings; return 1 if one is wrong.

    `config` is of the car: with its tyres and brakes scales and pressures are judged closer. `out` is the map
    to write with the lags that the drive shows.

    Raises:
        UserError: the map, its database, `config`, the log or `out` is not right.
    """
    if out is not None:
        check_outputs(out, (out,), [log, map, *(config_files(config) if config else [])], toml=True)
    source, findings = announced(load_source(map)), Findings(log)
    if unused := check_map(map, source, log):
        raise UserError(unused, "", "map suggest proposes one")
    if out is not None and source.columns is None:
        remedy = "maps messages, which have no lag; write the drive to a signal file, or leave --out away"
        raise UserError(str(map), "inputs", remedy)
    inputs = _feeds(map, source)
    params = new_params(load_config(config or resource("config/suv.toml")))
    collector = Collector()
    with progress_bar("map check", log_size(log)) as advance:
        for rows in replay_log(log, new_ecu(params, None), source, None, findings, advance):
            collector.add(rows.samples)
    assert findings.freshness is not None
    series = collector.series()
    judged = judge(series, car_of(params[0]) if config else ANY_CAR)
    late = lags(series) if not judged.contradictions else []
    counts = quality_counts(findings, source.plan)
    new_console(WIDTH).print(_table(inputs, counts))
    wrong = [*range_lines(findings.freshness), *judged.lines]
    if config:
        for line in filter(None, (radius_line(map, source, params[0]), delay_line(source, params[0]))):
            print(line)
    for line in (*quality_lines(findings, source.plan), *needed_lines(findings), *wrong):
        print(line)
    stated = source.columns.content if source.columns else None
    for line in (lag_line(lag, stated) for lag in late):
        print(line)
    give(inputs=counts["inputs"], wrong=wrong, checked=judged.checked, lags=[lag._asdict() for lag in late])
    give(notes=[*quality_lines(findings, source.plan), *needed_lines(findings)])
    open_ = [name for name in JUDGED if name not in judged.checked]
    if not wrong:
        print(
            f"physics agrees: {', '.join(judged.checked)}"
            if judged.checked
            else "physics: the car hardly moves"
        )
    if judged.checked and open_:
        print(f"not judged, for it is not mapped or the drive shows too little: {', '.join(open_)}")
    if out is not None and stated is not None:
        write_lags(map, stated, late, out)
    return 1 if wrong else 0


class Feed(NamedTuple):
    """Signal of an input."""

    message: str
    """Empty: a column of a signal file."""
    signal: str
    factor: float
    offset: float


def _feeds(map: Path, source: Source) -> dict[str, Feed]:
    if source.columns is not None:
        columns = source.columns.content.inputs
        return {name: Feed("", one.column, one.factor, one.offset) for name, one in columns.items()}
    inputs = read_signal_map(map).inputs
    return {name: Feed(one.message, one.signal, one.factor, one.offset) for name, one in inputs.items()}


def _table(inputs: dict[str, Feed], counts: dict[str, Any]) -> Table:
    """Return a row for each input; wheels that are mapped alike share one."""
    table = Table(box=SIMPLE)
    table.add_column("input", no_wrap=True)
    table.add_column("message.signal or column", overflow="fold")
    for name in ("factor", "offset", "per s", "gap s", "time-out s", "refused", "least … greatest"):
        table.add_column(name, justify="right", no_wrap=True)
    seconds = 0.01 * max(counts["rows"], 1)
    groups: dict[tuple[str, str, float, float], list[dict[str, Any]]] = {}
    for seen in counts["inputs"]:
        one = inputs[seen["name"]]
        stem = without_corner(seen["name"])
        groups.setdefault((stem, one.message, one.factor, one.offset), []).append(seen)
    for (stem, message, factor, offset), ones in groups.items():
        signals = dict.fromkeys(inputs[seen["name"]].signal for seen in ones)
        name = ones[0]["name"] if len(ones) == 1 else f"{stem}_{' '.join(seen['name'][-2:] for seen in ones)}"
        samples, gap = min(seen["samples"] for seen in ones), max(seen["greatest_gap_s"] for seen in ones)
        refused = sum(seen["invalid"] + seen["outside"] for seen in ones)
        known = [seen for seen in ones if seen["least"] is not None]
        span = (
            f"{min(s['least'] for s in known):.4g} … {max(s['greatest'] for s in known):.4g}"
            if known
            else "–"
        )
        late = " !" if gap > ones[0]["timeout_s"] else ""
        table.add_row(
            name,
            f"{message}.{' '.join(signals)}".removeprefix("."),
            f"{factor:.4g}",
            f"{offset:+.4g}" if offset else "",
            f"{samples / seconds:.1f}",
            f"{gap:.3f}{late}" if samples else "never came",
            f"{ones[0]['timeout_s']:g}",
            f"{100.0 * refused / sum(seen['samples'] for seen in ones):.1f} %" if refused else "",
            f"{span} {ones[0]['unit']}",
        )
    return table
