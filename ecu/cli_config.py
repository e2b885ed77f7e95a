"""`brake-ecu config …`: checks and describes CONFIG files."""

from pathlib import Path
from typing import Annotated

import typer

from ecu.arguments import Commands, config_file

app = Commands(help="Check and describe configurations.", no_args_is_help=True)


@app.command()
def check(
    file: Annotated[
        Path, typer.Argument(parser=config_file, metavar="CONFIG", help="Vehicle and tuning: file or name")
    ],
) -> int:
    """List every mistake of a configuration, or what its car comes to."""
    from ecu.settings import check

    return check.check(file)


@app.command()
def schema() -> int:
    """Print the JSON schema of configurations, with units."""
    from ecu.settings import schema

    return schema.schema()
