"""Python interface: read a log, replay it, simulate a scenario; results are columns with units.

    from brakelab.api import load, open_result, replay, simulate, suggest_map, identify, compare

Files may be given by path, or configurations, maps and scenarios by the names that are shipped, as on the
command line; a log of signals as a table, its map by its content. Nothing is printed; what is wrong is an
`ecu.errors.UserError`. docs/python.md has examples.
"""

import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from brakelab.commands import (
    Comparison,
    Suggestion,
    check_map,
    compare,
    identify,
    suggest_map,
)
from brakelab.given import AnyPath, Log, given
from brakelab.given import Map as AnyMap
from brakelab.identify.config_file import Section, write_car
from brakelab.replay.command import replay_into
from brakelab.replay.needed import NEEDED, nothing_usable
from brakelab.replay.quality import Findings, damage_lines
from brakelab.replay.source import check_map as unused_columns
from brakelab.replay.source import load_source
from brakelab.report.brakings_table import notebook
from brakelab.report.command import report as write_report
from brakelab.report.drive import DriveResult
from brakelab.results.columns import EXPORTS
from brakelab.results.files import brakes_path, read_result
from brakelab.rig.play.play_log import decoded
from brakelab.simulation.simulate import simulate as run_scenario
from brakelab.simulation.vehicle_bus import truth_unit
from brakelab.table import Table
from ecu.arguments import config_file, scenario_file
from ecu.contract.signals import INPUT_SIGNALS
from ecu.errors import UserError

__all__ = [
    "Comparison",
    "Drive",
    "Result",
    "Simulation",
    "Suggestion",
    "Table",
    "UserError",
    "check_map",
    "compare",
    "identify",
    "load",
    "open_result",
    "replay",
    "simulate",
    "suggest_map",
]

Change = float | int | bool | str | Sequence[float]
_KEY = re.compile(r"\w+(\.\w+)*", re.ASCII)
INPUT_UNITS = {signal.name: signal.unit for signal in INPUT_SIGNALS}


class Drive(Table):
    """Inputs of a log as the ECU receives them: every 10 ms, held until their time-out; `t` [s]."""

    def __init__(self, table: Table, notes: list[str]) -> None:
        super().__init__(table.columns, table.units)
        self.notes = notes
        """Findings on the log: damage and gaps, one line each."""


class Result(Table):
    """Result of a replay: outputs of the ECU every 10 ms, `t` [s]."""

    def __init__(self, path: Path, notes: list[str], folder: TemporaryDirectory[str] | None = None) -> None:
        rows, brakes = read_result(path), read_result(brakes_path(path))
        super().__init__(rows.columns, rows.units)
        self.brakings = Table(brakes.columns, brakes.units)
        """Its brake applications, a row for each wheel of each."""
        self.notes = notes
        """On the map, the log and the inputs, one line each."""
        self.metadata = rows.metadata
        """Version, hashes, start."""
        self.path = path
        """File of the result; without `out` it is there as long as this object."""
        self._folder = folder

    def __fspath__(self) -> str:
        return str(self.path)

    def _repr_html_(self) -> str:
        """Return the brake applications as the page of the report shows them."""
        drive = DriveResult(self["t"], self.columns, self.metadata)
        title = f"{self.metadata.get('vehicle', '')}: {repr(self).partition(':')[0]}"
        return notebook(drive, self.path, title)

    def report(self, out: AnyPath, truth: AnyPath | None = None) -> Path:
        """Write the page on this drive and return its path.

        `truth`: true values of a simulated drive, `Simulation.truth_path`. Raises UserError if it cannot be
        written.
        """
        write_report(self.path, Path(truth) if truth is not None else None, Path(out))
        return Path(out)


class Simulation:
    """A simulated drive: its log, sensor signals and true values."""

    def __init__(self, out: Path, folder: TemporaryDirectory[str] | None) -> None:
        self._folder = folder
        self.log = out.with_name(out.name + ".log")
        """Frames on the bus, to be replayed."""
        self.inputs_path = out.with_name(out.name + ".parquet")
        self.truth_path = out.with_name(out.name + ".truth.parquet")
        units = INPUT_UNITS | {"t": "s"}
        inputs, truth = (read_result(path).columns for path in (self.inputs_path, self.truth_path))
        self.inputs = Table(inputs, {name: units.get(name, "") for name in inputs})
        """Sensor signals, every 10 ms; NaN: no new sample."""
        self.truth = Table(truth, {name: truth_unit(name) for name in truth})
        """True values, every 10 ms."""


def open_result(path: AnyPath) -> Result:
    """Return a result of `brake-ecu replay` or `demo`.

    Raises:
        UserError: it cannot be read, or its brake applications beside it cannot.
    """
    return Result(Path(path), [])


def load(log: Log, *, map: AnyMap | None = None) -> Drive:
    """Return the inputs of a log of any format.

    Args:
        log: frames, signals or the folder of a recording (docs/logs.md), or a table of signals: of pandas,
            Polars or pyarrow, or arrays by name.
        map: signal map or map of columns, by path, name or content; None: the contract's frames or names.

    Raises:
        UserError: the log or the map is not right.
    """
    with given() as files:
        return _loaded(files.log(log), files.map(map))


def _loaded(path: Path, map: Path | None) -> Drive:
    if not path.exists():
        raise UserError(str(path), "", "no such file; give an existing log")
    found, source = Findings(path), load_source(map)
    unused = unused_columns(map, source, path) if map is not None else ""
    notes = [line for line in (source.left_out, unused) if line]
    samples = list(decoded(path, source, found))
    t_ns = np.array([stamp for stamp, _ in samples], np.int64)
    values = np.array([row for _, row in samples]).reshape(len(samples), len(INPUT_SIGNALS))
    columns = {"t": 1e-9 * (t_ns - t_ns[0]) if len(t_ns) else np.empty(0)}
    known = np.isfinite(values).any(axis=0)
    columns |= {signal.name: values[:, place] for place, signal in enumerate(INPUT_SIGNALS) if known[place]}
    units = {"t": "s"} | {name: INPUT_UNITS[name] for name in columns if name != "t"}
    return Drive(Table(columns, units), [*notes, *damage_lines(found)])


def replay(
    logs: Log | Sequence[Log],
    *,
    config: AnyPath,
    map: AnyMap | None = None,
    observer: str | None = None,
    state: AnyPath | None = None,
    changes: Mapping[str, Change] | None = None,
    out: AnyPath | None = None,
    force: bool = False,
) -> Result:
    """Replay a drive of one log or several through the ECU.

    Args:
        logs: as for `load`; several are one drive in this order.
        config: the car.
        map: as for `load`.
        observer: "joint", "observer1" or "observer2"; None: that of `config`.
        state: folder of what was learned before, read and written; None: nothing is known.
        changes: keys of `config` with other values, {"observer.mu_drift": 0.05}.
        out: file of the result, Parquet; None: a temporary one.
        force: learn friction although physics contradicts a log; else `notes` say so, and nothing is learned.

    Raises:
        UserError: an argument, the configuration, the map or a log is not right, or no sample of an input
            that is needed was usable.
    """
    if out is not None and Path(out).suffix in EXPORTS:
        raise UserError("out", str(out), "is Parquet here; `brake-ecu replay` writes MDF4 and MCAP")
    several = logs if isinstance(logs, Sequence) and not isinstance(logs, str) else [logs]
    if not several:
        raise UserError("logs", "", "the list is empty; give the logs of one drive")
    folder = TemporaryDirectory(prefix="brake-ecu-") if out is None else None
    with given() as files, changed(config, changes) as car:
        paths = [files.log(log) for log in several]
        result = Path(folder.name, f"{paths[0].stem}.parquet") if folder else Path(out or "")
        learned = Path(state) if state is not None else None
        done = replay_into(paths, car, files.map(map), observer, learned, result, force=force)
        if nothing_usable(done.findings):
            names = ", ".join(group.name for group in NEEDED)
            raise UserError(str(paths[0]), "", f"not one sample of the needed inputs was usable ({names})")
        return Result(result, [files.said(note) for note in done.notes], folder)


def simulate(
    scenario: AnyPath,
    *,
    config: AnyPath,
    seed: int = 0,
    draw: str | None = None,
    changes: Mapping[str, Change] | None = None,
    out: AnyPath | None = None,
) -> Simulation:
    """Drive a scenario in closed loop with the ECU of `config`.

    Args:
        scenario: file or shipped name (docs/scenarios.md).
        config: the car that the ECU believes in.
        seed: of the car that is drawn and of its sensors' noise.
        draw: "wide" or "nominal", how far that car is from its file; None: the scenario's.
        changes: keys of `config` with other values.
        out: begin of the names of log, inputs and truth; None: temporary files.

    Raises:
        UserError: a file is not right or cannot be written.
    """
    path = scenario_file(os.fspath(scenario))
    check_seed(seed)
    folder = TemporaryDirectory(prefix="brake-ecu-") if out is None else None
    written = Path(folder.name, path.stem) if folder else Path(out or "")
    with changed(config, changes) as car:
        run_scenario(path, car, written, int(seed), draw, printed=False)
    return Simulation(written, folder)


def check_seed(seed: object) -> None:
    """Raise UserError for anything but a whole number from 0 on."""
    if not isinstance(seed, int | np.integer) or seed < 0:
        raise UserError("seed", str(seed), "give a whole number from 0 on")


@contextmanager
def changed(config: AnyPath, changes: Mapping[str, Change] | None) -> Iterator[Path]:
    """Yield the configuration, with some keys changed as a file that is there while the context lasts."""
    path = config_file(os.fspath(config))
    if not changes:
        yield path
        return
    with TemporaryDirectory(prefix="brake-ecu-") as folder:
        changed = Path(folder, f"{path.stem}-changed.toml")
        sections: dict[str, Section] = {}
        for key, value in changes.items():
            table, _, name = key.rpartition(".")
            sections.setdefault(table, {})[name] = _toml(key, value), ""
        write_car(path, changed, "# Changed.", sections)
        try:
            yield changed
        except UserError as error:
            if error.where != str(changed):
                raise
            raise UserError("changes", error.place, error.remedy) from None


def _toml(key: str, value: Change) -> str:
    """Return a value as TOML. Raises UserError if it has no place in a configuration."""
    if not _KEY.fullmatch(key):
        raise UserError("changes", key, 'no key of a configuration; give one like "front.mu_nominal"')
    plain = value.tolist() if isinstance(value, np.generic | np.ndarray) else value
    try:
        text = json.dumps(plain, allow_nan=False)
    except (TypeError, ValueError):
        text = "null"
    if text == "null":
        raise UserError("changes", key, f"{value!r} is no value of a configuration")
    return text
