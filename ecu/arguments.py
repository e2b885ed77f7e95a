"""Options and arguments shared by commands of `brake-ecu`, and the layout of their help."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from ecu.settings.resources import SCENARIOS, named


class PlainHelp(TyperCommand):
    """A command whose help names its arguments as the README does: `LOG...`, without Python types."""

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """Return the parts of the usage line after the command's name."""
        pieces: list[str] = super().collect_usage_pieces(ctx)
        return [re.sub(r"^{(.*)}", r"\1", piece) for piece in pieces]

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the sections of arguments and options."""
        for section, kind in (("Arguments", "argument"), ("Options", "option")):
            parameters = [one for one in self.get_params(ctx) if one.param_type_name == kind]
            records = [one.get_help_record(ctx) for one in parameters]
            lines = [(re.sub(r" <.*>$", "", record[0]), record[1]) for record in records if record]
            if lines:
                with formatter.section(section):
                    formatter.write_dl(lines)


class Commands(typer.Typer):
    """A group of commands with plain help."""

    def command(self, name: str | None = None, **options: Any) -> Callable[[Any], Any]:
        """Decorate a function as a command of this group."""
        return super().command(name, cls=PlainHelp, **options)


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
    "--config",
    parser=config_file,
    metavar="CONFIG",
    help="Vehicle and tuning: file or name (suv, …)",
)
MAP_OPTION = typer.Option(
    "--map", parser=map_file, metavar="MAP", help="Signal map: file or name (mustang, …)"
)
INTERFACE_OPTION = typer.Option(
    "-i", "--interface", metavar="INTERFACE", help="Interface of python-can: socketcan, …"
)
CHANNEL_OPTION = typer.Option("-c", "--channel", metavar="CHANNEL", help="Channel of the interface: can0, …")
OBSERVER_OPTION = typer.Option(
    "--observer", metavar="OBSERVER", help="joint, observer1 or observer2; default: CONFIG's"
)
STATE_OPTION = typer.Option("--state", metavar="DIR", help="Folder that keeps learned values between runs")

DRAW_OPTION = typer.Option(
    "--draw", metavar="WIDTH", help="Spread of the drawn cars: wide or nominal; default: SCENARIO's"
)

Config = Annotated[Path, CONFIG_OPTION]
Map = Annotated[Path | None, MAP_OPTION]
Interface = Annotated[str, INTERFACE_OPTION]
Channel = Annotated[str, CHANNEL_OPTION]
State = Annotated[Path | None, STATE_OPTION]
Draw = Annotated[str | None, DRAW_OPTION]
Observer = Annotated[str | None, OBSERVER_OPTION]
