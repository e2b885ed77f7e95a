"""`brake-ecu watch`: options of the command."""

from pathlib import Path
from typing import Annotated

from ecu.arguments import Commands, PlainHelp, argument, flag, option

app = Commands()


@app.command(cls=PlainHelp)
def watch(
    daemon: Annotated[
        str | None, argument("DAEMON", "Process, channel, car or ring of the daemon; default: the only one")
    ] = None,
    web: Annotated[bool, flag("--web", "Show a page on 127.0.0.1 instead of the terminal")] = False,
    foxglove: Annotated[bool, flag("--foxglove", "Serve Foxglove on 127.0.0.1, live")] = False,
    port: Annotated[
        int | None,
        option("N", "Port of --web (8760) or --foxglove (8765); 0: any free one", min=0, max=65535),
    ] = None,
    as_json: Annotated[bool, flag("--json", "Print a line of JSON a second")] = False,
    out: Annotated[Path, option("DIR", "Folder for recordings that you keep")] = Path("out/watch"),
) -> int:
    """Look into a running daemon, which waits for no reader; q quits."""
    from ecu.watch import command

    return command.watch(daemon, web, foxglove, port, as_json, out)
