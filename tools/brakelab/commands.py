"""Commands of the laboratory as functions: what they give with `--json`, as values of Python."""

import os
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import typer
from numpy.typing import NDArray

from brakelab.given import AnyPath, Log, Map, given
from brakelab.table import Listing
from ecu.errors import UserError
from ecu.output import Level, new_policy


def run_command(words: Sequence[str | os.PathLike[str]], **options: object) -> dict[str, Any]:
    """Run a command, silently, and return what it gives.

    `options` by their names on the command line: True sets a flag, None and False leave one out, a list
    repeats one.

    Raises:
        UserError: as the command.
    """
    from brakelab.cli.main import app

    line = [os.fspath(word) for word in words]
    for name, value in options.items():
        flag = f"--{name.replace('_', '-')}"
        if value is True:
            line.append(flag)
        elif value is not None and value is not False:
            several = value if isinstance(value, list | tuple) else [value]
            line += [part for one in several for part in (flag, str(one))]
    with new_policy() as policy:
        policy.level, policy.json = Level.QUIET, True
        try:
            app(line, prog_name="brake-ecu", standalone_mode=False)
        except typer.TyperException as error:
            raise UserError(" ".join(line[:2]), "", error.format_message().rstrip(".")) from None
        return policy.given


def _columns(rows: Sequence[Mapping[str, Any]], names: Sequence[str]) -> dict[str, NDArray[Any]]:
    return {name: np.array([row[name] for row in rows]) for name in names}


class Suggestion(Listing):
    """What `map suggest` proposes: a row for each input."""

    def __init__(self, figures: dict[str, Any]) -> None:
        names = ("target", "message", "signal", "factor", "offset", "unit", "evidence", "sure", "warning")
        super().__init__(_columns(figures["inputs"], names), {})
        self.others = Listing(
            _columns(figures["others"], ("target", "message", "signal", "unit", "evidence")), {}
        )
        """Signals that are not proposed: other sources of an input, and candidates of one that is missing."""
        self.text: str = figures["map"]
        """The map, with its evidence as comments."""
        self.map = tomllib.loads(self.text)
        """Its content, to be changed and given as `map`."""


class Comparison(Listing):
    """Columns in which two results differ, as `compare` finds: the largest differences first."""

    def __init__(self, figures: dict[str, Any]) -> None:
        names = ("of", "name", "unit", "rms", "greatest", "at", "nulls", "weight")
        super().__init__(_columns(figures["differences"], names), {})
        self.matter: int = figures["matter"]
        """Number of differences that matter, those of weight above 1."""
        self.provenance: list[str] = figures["provenance"]
        """Version, configuration and logs, where they differ."""
        self.verdicts: list[str] = figures.get("verdicts", [])
        """Error of prediction, and friction at the end."""


def suggest_map(
    log: Log, *, dbc: AnyPath | None = None, config: AnyPath | None = None, out: AnyPath | None = None
) -> Suggestion:
    """Propose a map by names, units and physics, as `map suggest`.

    Args:
        log: as for `load`.
        dbc: database of a log of frames.
        config: of the car, where it is known.
        out: file to write the map to; None: none.

    Raises:
        UserError: a file is not right, or nothing was found that drives.
    """
    with given() as files:
        return Suggestion(run_command(["map", "suggest", files.log(log)], dbc=dbc, config=config, out=out))


def check_map(log: Log, map: Map, *, config: AnyPath | None = None) -> dict[str, Any]:
    """Check a map on a drive, as `map check`.

    Args:
        log: as for `load`.
        map: likewise.
        config: of the car, where it is known.

    Returns:
        "inputs", a row for what feeds each; "wrong", what physics contradict; "lags", "notes".

    Raises:
        UserError: a file is not right.
    """
    with given() as files:
        return run_command(["map", "check", files.log(log)], map=files.map(map), config=config)


def identify(
    model: str, data: Log | Sequence[Log], *, out: AnyPath, map: Map | None = None, **options: Any
) -> dict[str, Any]:
    """Identify a model from measurements, as `identify vehicle`, `thermal`, `friction`, `wear` or `dust`.

    Args:
        model: that name.
        data: logs as for `load`, or what else the command takes.
        out: file to write; its page beside it.
        map: as for `load`.
        options: the command's other ones by their names, `config="suv"`, `closed=True`.

    Returns:
        What the command gives with `--json`, with figures as its own objects; "written": the files.

    Raises:
        UserError: an option or a file is not right, or the measurements identify nothing.
    """
    several = data if isinstance(data, Sequence) and not isinstance(data, str) else [data]
    with given() as files:
        logs = [files.log(one) for one in several]
        return run_command(["identify", model, *logs], map=files.map(map), out=out, **options)


def compare(a: AnyPath, b: AnyPath, *, out: AnyPath | None = None) -> Comparison:
    """Compare result `b` with `a`, as `compare`; `out`: page of both to write.

    Raises:
        UserError: one is none, or the two have no row in common.
    """
    return Comparison(run_command(["compare", a, b], out=out))
