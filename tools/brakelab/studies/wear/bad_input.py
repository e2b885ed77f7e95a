"""Answers to wrong blocks, trips and drives: files are spoilt by the usual mistakes and given."""

import csv
import shutil
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from brakelab.identify.dust.command import identify_dust
from brakelab.identify.wear.command import identify_wear
from brakelab.results.text_table import Table
from brakelab.simulation.campaigns.dust_trips import campaign, write_campaign
from brakelab.simulation.campaigns.wear_blocks import drawn_car, programme, write_programme
from brakelab.studies.lab.bad_input import Answer, answer_table
from ecu.errors import UserError
from ecu.settings.resources import resource

SEED: Final = 1
MANIFEST, BLOCK, TRIP = "manifest.csv", "town-calm.csv", "trip-1.csv"

Spoil = Callable[[Path], None]
"""Spoils files in a folder."""
Row = dict[str, str]


def _rows(name: str, change: Callable[[list[Row]], object]) -> Spoil:
    def spoil(folder: Path) -> None:
        with (folder / name).open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        header = list(rows[0])
        changed = change(rows)
        with (folder / name).open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, header, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows if changed is None else changed)  # type: ignore[arg-type]

    return spoil


def _scaled(name: str, column: str, factor: float, zero: float = 0.0) -> Spoil:
    def change(rows: list[Row]) -> None:
        for row in rows:
            if row[column]:
                row[column] = f"{factor * float(row[column]) + zero:.4f}"

    return _rows(name, change)


def _first(name: str, **cells: str) -> Spoil:
    return _rows(name, lambda rows: rows[0].update(cells))


def _all(name: str, **cells: str) -> Spoil:
    def change(rows: list[Row]) -> None:
        for row in rows:
            row.update(cells)

    return _rows(name, change)


def _text(name: str, change: Callable[[str], str]) -> Spoil:
    def spoil(folder: Path) -> None:
        (folder / name).write_text(change((folder / name).read_text("utf-8")), "utf-8")

    return spoil


_GROWN: Final = {f"thickness_after_{k}": "12.4" for k in range(1, 7)}
BLOCKS: Final[dict[str, Spoil]] = {
    "no such file": lambda folder: (folder / BLOCK).unlink(),
    "a block with too few applications": _rows(BLOCK, lambda rows: rows[:2000]),
    "blocks all alike: collinear regressors": _all(MANIFEST, file=BLOCK),
    "two blocks": _rows(MANIFEST, lambda rows: rows[:2]),
    "a thickness that grows": _first(MANIFEST, **_GROWN),
    "thickness in µm": _first(MANIFEST, thickness_before_1="11640"),
    "a mass that grows": _first(MANIFEST, mass_after="500"),
    "a mass that is no number": _first(MANIFEST, mass_before="450 g"),
    "a temperature in °F": _scaled(BLOCK, "disc_temperature", 1.8, 32.0),
    "a temperature in K": _scaled(BLOCK, "disc_temperature", 1.0, 273.15),
    "a gap in the temperature": _rows(
        BLOCK, lambda rows: [row.update(disc_temperature="") for row in rows[60:140]] and None
    ),
    "a column of another name": _text(BLOCK, lambda text: text.replace("omega", "speed", 1)),
    "time that goes back": _rows(BLOCK, lambda rows: rows[50].update(t="0.0")),
    "an empty manifest": _text(MANIFEST, lambda text: text.splitlines()[0] + "\n"),
    "an empty block": _text(BLOCK, lambda text: ""),
}
TRIPS: Final[dict[str, Spoil]] = {
    "a trip without braking": _scaled(TRIP, "calliper_pressure_fr", 0.0),
    "a disc in K": _scaled(TRIP, "disc_temperature_fr", 1.0, 273.15),
    "a speed in km/h": _scaled(TRIP, "vehicle_speed", 3.6),
    "a flow in m³/h": _scaled(TRIP, "tunnel_flow", 3600.0),
    "the counter was off": _all(TRIP, particle_concentration=""),
    "two trips": _rows(MANIFEST, lambda rows: rows[:2]),
}


def _answers(
    source: Path, cases: dict[str, Spoil], identify: Callable[[Path, Path], None]
) -> Iterator[Answer]:
    for what, spoil in cases.items():
        with TemporaryDirectory() as name:
            folder = Path(name, "data")
            shutil.copytree(source, folder)
            spoil(folder)
            try:
                with redirect_stdout(StringIO()):
                    identify(folder / MANIFEST, folder / "car.toml")
                line, is_refused = "", False
            except UserError as error:
                line, is_refused = str(error), True
            yield Answer(what, line.replace(f"{folder}/", ""), is_refused)


def answers() -> list[Answer]:
    """Return the line that each wrong input of `identify wear` and `identify dust` gets."""
    config, car = resource("config/suv.toml"), drawn_car(SEED)
    with TemporaryDirectory() as name:
        blocks, trips = Path(name, "blocks"), Path(name, "trips")
        write_programme(car, 0, SEED, blocks, programme(car, 0, SEED, ("town", "motorway")))
        write_campaign(campaign(SEED), trips)
        return [
            *_answers(blocks, BLOCKS, lambda manifest, out: identify_wear(manifest, config, "front", out)),
            *_answers(trips, TRIPS, lambda manifest, out: identify_dust(manifest, config, "front", out)),
        ]


def bad_input_table() -> Table:
    """Return the answers to wrong blocks and trips."""
    return answer_table(answers(), "Four blocks, eight trips, one of them spoilt.")
