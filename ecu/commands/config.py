"""`brake-ecu config …`: writes, checks and describes CONFIG files."""

from functools import partial
from pathlib import Path
from typing import Annotated

from ecu.arguments import Commands, State, argument, config_file, flag, option

app = Commands(help="Write, check and describe configurations.", no_args_is_help=True)


@app.command()
def check(
    file: Annotated[Path, argument("CONFIG", "Vehicle and tuning: file or name", parser=config_file)],
    picture: Annotated[bool, flag("--picture", "Draw the distribution beside what Annex 5 forbids")] = False,
    state: State = None,
) -> int:
    """List every mistake of a configuration, or what its car comes to."""
    from ecu.recording.restored import restored
    from ecu.settings import check

    return check.check(file, picture, partial(restored, state) if state else None)


@app.command()
def new(
    given: Annotated[
        list[str] | None, option("KEY=VALUE", "Answer without being asked; as often as needed", "--set")
    ] = None,
    out: Annotated[Path | None, option("CAR.toml", "File to write; default: the car's name")] = None,
) -> int:
    """Write a configuration from a data sheet."""
    from ecu.settings import new

    return new.new(given or [], out)


@app.command()
def schema() -> None:
    """Print the JSON schema of configurations, with units."""
    from ecu.settings import schema

    schema.schema()
