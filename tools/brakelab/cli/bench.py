"""`brake-ecu bench …`: imports what it needs when it is called."""

from pathlib import Path
from typing import Annotated, Final

from brakelab.bench.registry import MODULES, NAMES, TIMES
from ecu.arguments import argument, flag, option
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
        str | None, argument("NAME", "Bench to run; default: step, codec, plant, cycle", autocompletion=names)
    ] = None,
    seeds: Annotated[int, option("N", "Number of cars that are drawn, at most", min=1)] = 20,
    seconds: Annotated[float, option("S", "Duration of lateness and play", min=5.0, max=580.0)] = 60.0,
    draw: Annotated[
        str, option("WIDTH", "Spread of the cars of stops and observers: wide or nominal")
    ] = "wide",
    observer: Annotated[
        list[str] | None, option("MODULE:CLASS", "Enter this observer in entries; may be repeated")
    ] = None,
    drive: Annotated[str | None, option("CAR:LOG", "Recorded drive that entries predict")] = None,
    export: Annotated[Path | None, option("DIR", "Write the drives of entries there, run nothing")] = None,
    write: Annotated[bool, flag("--write", "Renew the page in docs/results of this checkout")] = False,
) -> int:
    """Run one bench, see `HELP`."""
    from brakelab.bench import command
    from brakelab.studies.study import Asked, Entered

    entered = Entered(tuple(observer or ()), drive, export)
    return command.bench(name, Asked(seeds, seconds, draw, entered), write)
