"""Options and arguments shared by commands of `brake-ecu`, and the layout of their help."""

import re
from collections.abc import Callable
from copy import copy
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command_name
from typer.models import CommandInfo

from ecu.completion import known, shipped
from ecu.output import Level, asked, policy
from ecu.settings.resources import SCENARIOS, named


def _set_level(level: Level) -> Callable[[bool], None]:
    def set_level(wanted: bool) -> None:
        if wanted:
            policy().level = level

    return set_level


def _set_json(wanted: bool) -> None:
    policy().json = policy().json or wanted


def _unseen(flags: tuple[str, ...], callback: Callable[[bool], None], help: str) -> Any:
    """Return an option that sets the policy; the command itself does not see it."""
    return typer.Option(*flags, callback=callback, expose_value=False, is_eager=True, help=help)


@cache
def output_options() -> tuple[Any, ...]:
    """Return the options on output, which every command has: `--quiet`, `--verbose`, `--json`."""
    probe = typer.Typer(add_completion=False)

    @probe.command()
    def _(
        quiet: Annotated[
            bool, _unseen(("--quiet", "-q"), _set_level(Level.QUIET), "Print nothing but results and errors")
        ] = False,
        verbose: Annotated[
            bool,
            _unseen(("--verbose", "-v"), _set_level(Level.VERBOSE), "Say what is read and compiled, too"),
        ] = False,
        json: Annotated[
            bool, _unseen(("--json",), _set_json, "Print the result as JSON; words go to standard error")
        ] = False,
    ) -> None:
        pass

    return tuple(typer.main.get_command(probe).params)


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


class Result(PlainHelp):
    """A command with a result: it has the options on output and keeps to them."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.params += output_options()

    def invoke(self, ctx: Any) -> Any:
        """Call the command's function."""
        with asked():
            return super().invoke(ctx)


class TopLevel(TyperGroup):
    """The program: its options on output hold for the command that follows."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.params += output_options()


class Commands(typer.Typer):
    """A group of commands with plain help."""

    def command(  # type: ignore[override]
        self, name: str | None = None, cls: type[PlainHelp] = Result, **options: Any
    ) -> Callable[[Any], Any]:
        """Decorate a function as a command of this group."""
        return super().command(name, cls=cls, **options)

    def only(self, name: str) -> "Commands":
        """Return the group with only its command, or group, of a name: to build all takes 0.05 s.

        The group itself, if it has none of that name.
        """
        part = copy(self)
        part.registered_commands = [one for one in self.registered_commands if _name_of(one) == name]
        part.registered_groups = [one for one in self.registered_groups if one.name == name]
        for unnamed in (one.typer_instance for one in self.registered_groups if not one.name):
            if isinstance(unnamed, Commands) and (found := unnamed.only(name)) is not unnamed:
                part.add_typer(found)
        return part if part.registered_commands or part.registered_groups else self


def _name_of(command: CommandInfo) -> str:
    return command.name or get_command_name(command.callback.__name__ if command.callback else "")


def config_file(name: str) -> Path:
    """Return the CONFIG file of a name or path."""
    return named(name, "config")


def map_file(name: str) -> Path:
    """Return the signal map of a name or path."""
    return named(name, "config/maps")


def scenario_file(name: str) -> Path:
    """Return the scenario of a name or path."""
    return named(name, *SCENARIOS)


def option(metavar: str, help: str, *names: str, **more: Any) -> Any:
    """Return an option that takes a value; without `names` it has its parameter's."""
    return typer.Option(*names, metavar=metavar, help=help, **more)


def flag(name: str, help: str) -> Any:
    """Return an option that takes no value."""
    return typer.Option(name, help=help)


def argument(metavar: str, help: str, **more: Any) -> Any:
    """Return an argument."""
    return typer.Argument(metavar=metavar, help=help, **more)


CONFIG_OPTION = option(
    "CONFIG",
    "Vehicle and tuning: file or name (suv, …)",
    "--config",
    parser=config_file,
    autocompletion=shipped("config"),
)
MAP_OPTION = option(
    "MAP",
    "Signal map: file or name (mustang, …)",
    "--map",
    parser=map_file,
    autocompletion=shipped("config/maps"),
)
INTERFACE_OPTION = option(
    "INTERFACE",
    "Interface of python-can: socketcan, …",
    "-i",
    "--interface",
    autocompletion=known("socketcan", "udp_multicast", "virtual"),
)
CHANNEL_OPTION = option("CHANNEL", "Channel of the interface: can0, …", "-c", "--channel")
OBSERVER_OPTION = option(
    "OBSERVER",
    "joint, observer1 or observer2; default: CONFIG's",
    "--observer",
    autocompletion=known("joint", "observer1", "observer2"),
)
STATE_OPTION = option("DIR", "Folder that keeps learned values between runs", "--state")

DRAW_OPTION = option(
    "WIDTH",
    "Spread of the drawn cars: wide or nominal; default: SCENARIO's",
    "--draw",
    autocompletion=known("wide", "nominal"),
)

Config = Annotated[Path, CONFIG_OPTION]
Map = Annotated[Path | None, MAP_OPTION]
Interface = Annotated[str, INTERFACE_OPTION]
Channel = Annotated[str, CHANNEL_OPTION]
State = Annotated[Path | None, STATE_OPTION]
Draw = Annotated[str | None, DRAW_OPTION]
Observer = Annotated[str | None, OBSERVER_OPTION]
