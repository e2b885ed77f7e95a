"""Answers to wrong recordings: files are spoilt by the usual mistakes and given to the reader."""

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, NamedTuple

from brakelab.identify.friction.check import refuse_nonsense
from brakelab.identify.friction.dynamometer import new_bench
from brakelab.identify.friction.reader import read_recording
from brakelab.identify.friction.recording import write_recording
from brakelab.identify.friction.sequence import load_sequence, run_sequence
from brakelab.results.text_table import Table
from brakelab.studies.lab.brakes import SEED, columns_of, linings
from ecu.errors import UserError
from ecu.settings.resources import resource

NAME: Final = "mine.csv"

Spoil = Callable[[Path], None]
"""Spoils the recording NAME or its file of columns in a folder."""


class Answer(NamedTuple):
    """To one wrong input."""

    what: str
    line: str
    is_refused: bool


def _rows(change: Callable[[list[str]], list[str]]) -> Spoil:
    def spoil(folder: Path) -> None:
        path = folder / NAME
        path.write_text("\n".join(change(path.read_text("utf-8").splitlines())) + "\n", "utf-8")

    return spoil


def _columns(old: str, new: str) -> Spoil:
    def spoil(folder: Path) -> None:
        path = folder / "mine.toml"
        text = path.read_text("utf-8")
        path.write_text(text.replace(old, new), "utf-8")

    return spoil


def _row(place: int, text: str) -> Spoil:
    """Return the replacement of the line `place` (1 is the first)."""
    return _rows(lambda lines: [*lines[: place - 1], text, *lines[place:]])


def _scaled(column: int, factor: float, zero: float = 0.0) -> Spoil:
    def change(lines: list[str]) -> list[str]:
        out = lines[:1]
        for line in lines[1:]:
            cells = line.split(",")
            cells[column] = f"{factor * float(cells[column]) + zero:.4f}"
            out.append(",".join(cells))
        return out

    return _rows(change)


def _renamed(folder: Path) -> None:
    (folder / NAME).rename(folder / "mine.xls")


def _as_utf_16(folder: Path) -> None:
    path = folder / NAME
    path.write_text(path.read_text("utf-8"), "utf-16")


def _cut_off(folder: Path) -> None:
    path = folder / NAME
    path.write_bytes(path.read_bytes()[:-9])


CASES: Final[dict[str, Spoil]] = {
    "no such file": lambda folder: (folder / NAME).unlink(),
    "another format": _renamed,
    "saved as UTF-16": _as_utf_16,
    "no file of columns": lambda folder: (folder / "mine.toml").unlink(),
    "a column of another name": _columns("torque_Nm", "M_B"),
    "an unknown unit": _columns('"bar"', '"pound"'),
    "an area is missing": _columns("piston_area", "piston"),
    "a number of the brake is negative": _columns("effective_radius = ", "effective_radius = -"),
    "only the first second": _rows(lambda lines: lines[:60]),
    "a row with two cells": _row(52, "12,13"),
    "a word among the numbers": _row(62, "0.3,2.0,off,99.0,50.0"),
    "a row twice": _rows(lambda lines: [*lines[:72], lines[71], *lines[72:]]),
    "the last row cut off": _cut_off,
    "pressure is in psi, not bar": _scaled(1, 14.504),
    "torque of one pad": _scaled(2, 0.5),
    "torque in lbf ft": _scaled(2, 1.0 / 1.355818),
    "speed is in m/s, not km/h": _scaled(3, 1.0 / 3.6),
    "speed is the demand": _scaled(3, 0.0, 100.0),
    "temperature in °F": _scaled(4, 1.8, 32.0),
    "temperature in K": _scaled(4, 1.0, 273.15),
    "time in ms": _scaled(0, 1e3),
    "thermocouple in the backing plate": _scaled(4, 0.2, 40.0),
    "no stop in it": _scaled(1, 0.0),
}


def answers() -> list[Answer]:
    """Return the line that each wrong input gets; one that is read all the same names its losses."""
    lining = linings().lining["A"]
    inertia = columns_of(lining).rig.inertia
    assert inertia is not None
    programme = load_sequence(resource("config/rig/ams.toml"))
    recording = run_sequence(new_bench(lining, "A", SEED), programme, lambda share: None)
    found = []
    for what, spoil in CASES.items():
        with TemporaryDirectory() as name:
            folder = Path(name)
            write_recording(folder / NAME, recording, lining, inertia)
            spoil(folder)
            path = folder / ("mine.xls" if (folder / "mine.xls").exists() else NAME)
            try:
                read = read_recording(path)
                refuse_nonsense(read.recording, read.columns, str(path))
                line, is_refused = read.damaged, False
            except UserError as error:
                line, is_refused = str(error), True
            found.append(Answer(what, line.replace(f"{folder}/", ""), is_refused))
    return found


def answer_table(found: list[Answer], files: str) -> Table:
    """Return the answers to wrong input; `files`: what was spoilt."""
    rows = [(each.what, each.line, "refused" if each.is_refused else "read") for each in found]
    below = f"{files} Lines as they are printed, folders left out."
    return Table("Bad input", ("what", "line", ""), rows, below)


def bad_input_table() -> Table:
    """Return the answers to wrong recordings."""
    return answer_table(answers(), "AMS of brake A as a file of our own, spoilt.")
