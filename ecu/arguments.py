"""What the commands of `brake-ecu` share: files that are shipped by a short name, and a bus."""

from pathlib import Path
from typing import Annotated

import typer

from ecu.settings.resources import SCENARIOS, named


def config_file(name: str) -> Path:
    """Return the CONFIG file of a name or path."""
    return named(name, "config")


def map_file(name: str) -> Path:
    """Return the signal map of a name or path."""
    return named(name, "config/maps")


def scenario_file(name: str) -> Path:
    """Return the scenario of a name or path."""
    return named(name, *SCENARIOS)


CONFIG_OPTION = typer.Option(
    "--config", parser=config_file, metavar="CONFIG", help="Vehicle and tuning: a file, or suv, …"
)
MAP_OPTION = typer.Option(
    "--map", parser=map_file, metavar="MAP", help="Signal map of a foreign bus: a file, or mustang, …"
)
INTERFACE_OPTION = typer.Option(
    "-i", "--interface", metavar="INTERFACE", help="As python-can calls it: socketcan, …"
)
CHANNEL_OPTION = typer.Option("-c", "--channel", metavar="CHANNEL", help="As python-can calls it: can0, …")
OBSERVER_OPTION = typer.Option(
    "--observer", metavar="OBSERVER", help="joint, observer1, observer2; default: CONFIG's"
)
STATE_OPTION = typer.Option("--state", metavar="DIR", help="Where learned friction is kept between runs")

DRAW_OPTION = typer.Option(
    "--draw", metavar="WIDTH", help="How far cars differ from their file: wide, nominal; default: SCENARIO's"
)

Config = Annotated[Path, CONFIG_OPTION]
Map = Annotated[Path | None, MAP_OPTION]
Interface = Annotated[str, INTERFACE_OPTION]
Channel = Annotated[str, CHANNEL_OPTION]
State = Annotated[Path | None, STATE_OPTION]
Draw = Annotated[str | None, DRAW_OPTION]
Observer = Annotated[str | None, OBSERVER_OPTION]
