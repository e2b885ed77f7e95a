"""`brake-ecu watch`: options of the command."""

from pathlib import Path
from typing import Annotated

import typer

from ecu.arguments import Commands, PlainHelp

app = Commands()


@app.command(cls=PlainHelp)
def watch(
    daemon: Annotated[
        str | None,
        typer.Argument(
            metavar="DAEMON", help="Process, channel, car or ring of the daemon; default: the only one"
        ),
    ] = None,
    web: Annotated[
        bool, typer.Option("--web", help="Show a page on 127.0.0.1 instead of the terminal")
    ] = False,
    port: Annotated[
        int, typer.Option("--port", metavar="N", min=0, max=65535, help="Port of the page; 0: any free one")
    ] = 8760,
    as_json: Annotated[bool, typer.Option("--json", help="Print a line of JSON a second")] = False,
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder for recordings that you keep")
    ] = Path("out/watch"),
) -> int:
    """Look into a running daemon, which waits for no reader; q quits."""
    from ecu.watch import command

    return command.watch(daemon, web, port, as_json, out)
