"""`brake-ecu a2l`: options of the command."""

from pathlib import Path
from typing import Annotated

import typer

from ecu.arguments import CONFIG_OPTION, Commands

app = Commands()


@app.command()
def a2l(
    config: Annotated[Path | None, CONFIG_OPTION] = None,
    xcp: Annotated[
        list[str] | None,
        typer.Option(
            "--xcp",
            metavar="TRANSPORT",
            help="As for `run`, as often as needed; default: UDP and TCP at 127.0.0.1:5555",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="FILE", help="File to write; default: standard output"),
    ] = None,
) -> None:
    """Write the A2L file of `run --xcp` (ASAM MCD-2 MC)."""
    from ecu.xcp import a2l

    a2l.a2l(config, xcp, out)
