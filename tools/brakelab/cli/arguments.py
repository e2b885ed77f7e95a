"""Arguments and options that several of the laboratory's commands share."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

from ecu.arguments import argument, option, scenario_file
from ecu.completion import known, shipped
from ecu.settings.resources import SCENARIOS, regular


def present(given: list[Path] | Path | None) -> list[Path] | Path | None:
    """Return given files, each of which is there: said before anything is imported that reads them."""
    for path in given if isinstance(given, list) else [given] if given else []:
        regular(path, "an existing file")
    return given


@contextmanager
def working(words: str) -> Iterator[None]:
    """Show a bar while a command works, or imports what it needs: SciPy alone takes a second."""
    from brakelab.results.progress import progress_bar

    with progress_bar(words, None):
        yield


def recorded(given: list[Path] | None) -> list[Path] | None:
    """Return given files and folders, each of which is there."""
    present([path for path in given or [] if not path.is_dir()])
    return given


Plant = Annotated[
    str | None,
    option(
        "PLANT",
        "Simulated car: as-config, file or name (sedan, …); default: SCENARIO's",
        "--plant",
        autocompletion=known("as-config", "suv", "suv14", "sedan", "lcv"),
    ),
]
Scenario = Annotated[
    Path,
    argument(
        "SCENARIO",
        "Scenario file, or name of a shipped one",
        parser=scenario_file,
        autocompletion=shipped(*SCENARIOS),
    ),
]
Seed = Annotated[int, option("N", "Seed of the drawn vehicle and its noise", "--seed", min=0)]
Columns = Annotated[
    Path | None, option("MAP.toml", "Columns, units, brake; default: DATA with .toml", "--columns")
]
