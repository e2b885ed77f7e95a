"""What a bench is: options of the command line in, tables and pictures of a page out."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from brakelab.results.chart import Panel, write_chart
from brakelab.results.text_table import Table

WIDE: Final = "wide"
"""Draw of the cars of pages."""


class Entered(NamedTuple):
    """Options of the command line about entries."""

    observers: Sequence[str] = ()
    """As `load_class` takes them."""
    drive: str | None = None
    """CAR:LOG; None: the shipped one, where the tests are."""
    export: Path | None = None
    """Write the drives there instead."""


NOBODY: Final = Entered()


class Asked(NamedTuple):
    """Options of the command line."""

    seeds: int = 20
    """Number of cars drawn by `stops` and `observers`, upper bound for the others."""
    seconds: float = 60.0
    """Duration of the drive of `lateness`, and of all players of `play`."""
    draw: str = WIDE
    """Width of the draw of `stops` and `observers`."""
    entered: Entered = NOBODY


UNASKED: Final = Asked()


class Measured(NamedTuple):
    """What a bench measured."""

    tables: list[Table]
    of: str = ""
    """What it was measured on, after the version: configuration, draw, machine."""
    plain: Mapping[str, Any] | None = None
    """For JSON; None: the tables."""
    draw: Callable[[Path], None] | None = None
    """Writes the pictures of the page into a folder."""


class Study(NamedTuple):
    """A bench with a page of its own: `STUDY` of its module, listed in `bench/registry.py`."""

    title: str
    text: str
    """Of the page, above the tables."""
    run: Callable[[Asked], Measured]
    file: str = ""
    """Of the page; "": the bench's name."""
    keep: bool = False
    """Sections of the page with other titles stay."""


def picture(file: str, panels: list[Panel], legend: Sequence[tuple[str, str]]) -> Callable[[Path], None]:
    """Return what writes a page's only picture into a folder."""
    return lambda folder: write_chart(folder / file, panels, legend)
