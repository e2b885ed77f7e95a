"""`brake-ecu map …`: signal maps. Each command imports what it needs when it is called."""

from pathlib import Path
from typing import Annotated

from brakelab.cli.arguments import present
from ecu.arguments import CONFIG_OPTION, MAP_OPTION, Commands, argument, option

app = Commands(help="Make signal maps for other CAN databases and signal files.", no_args_is_help=True)


@app.command()
def suggest(
    log: Annotated[Path, argument("LOG", "Recorded drive", callback=present)],
    dbc: Annotated[
        Path | None, option("DB", "CAN database of the car: DBC, KCD, SYM, ARXML; none for a signal file")
    ] = None,
    config: Annotated[Path | None, CONFIG_OPTION] = None,
    out: Annotated[Path | None, option("MAP.toml", "Map to write; default: print it")] = None,
) -> None:
    """Propose a map by names, units and physics, for you to edit."""
    from brakelab.mapping import command

    command.suggest(log, dbc, config, out)


@app.command()
def check(
    log: Annotated[Path, argument("LOG", "Recorded drive", callback=present)],
    map: Annotated[Path, MAP_OPTION],
    config: Annotated[Path | None, CONFIG_OPTION] = None,
    out: Annotated[
        Path | None, option("MAP.toml", "Map of columns to write, with the lags of the drive")
    ] = None,
) -> int:
    """Check a map on a drive: what feeds each input, and the physics. Exit code 1: it is wrong."""
    from brakelab.mapping import check

    return check.check(log, map, config, out)
