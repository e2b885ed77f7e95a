"""`brake-ecu bench …`: imports what it needs when it is called."""

from pathlib import Path
from typing import Annotated, Final

import typer

from brakelab.bench.registry import MODULES, NAMES, TIMES
from ecu.completion import fitting

HELP: Final = "\n".join(
    [
        "Measure times, accuracy, control and physics. Print tables.\n\n\b",
        *(f"{what:8}  {', '.join(these)}" for what, these in NAMES.items()),
    ]
)


def names(incomplete: str) -> list[str]:
    """Return the benches that begin like that."""
    return fitting([*TIMES, *MODULES], incomplete)


def bench(
    name: Annotated[
        str | None,
        typer.Argument(
            autocompletion=names, metavar="NAME", help="Bench to run; default: step, codec, plant, cycle"
        ),
    ] = None,
    seeds: Annotated[
        int, typer.Option(metavar="N", min=1, help="Number of cars that are drawn, at most")
    ] = 20,
    seconds: Annotated[
        float, typer.Option(metavar="S", min=5.0, max=580.0, help="Duration of lateness and play")
    ] = 60.0,
    draw: Annotated[
        str, typer.Option(metavar="WIDTH", help="Spread of the cars of stops and observers: wide or nominal")
    ] = "wide",
    observer: Annotated[
        list[str] | None,
        typer.Option(metavar="MODULE:CLASS", help="Enter this observer in entries; may be repeated"),
    ] = None,
    drive: Annotated[
        str | None, typer.Option(metavar="CAR:LOG", help="Recorded drive that entries predict")
    ] = None,
    export: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write the drives of entries there, run nothing")
    ] = None,
    write: Annotated[
        bool, typer.Option("--write", help="Renew the page in docs/results of this checkout")
    ] = False,
) -> int:
    """Run one bench, see `HELP`."""
    from brakelab.bench import command
    from brakelab.studies.study import Asked, Entered

    entered = Entered(tuple(observer or ()), drive, export)
    return command.bench(name, Asked(seeds, seconds, draw, entered), write)
