"""`brake-ecu diag`: options of the command."""

from pathlib import Path
from typing import Annotated

import typer

from ecu.arguments import Channel, Commands, Interface
from ecu.completion import known

app = Commands()


@app.command()
def diag(
    action: Annotated[
        str,
        typer.Argument(
            metavar="ACTION",
            autocompletion=known("faults", "clear", "read", "info", "new-pads", "measured", "forget"),
            help="faults, clear, read, info, new-pads, measured or forget",
        ),
    ],
    interface: Interface,
    channel: Channel,
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[NAME]...",
            help="What to read, as mu_b or 0x0110; what to clear, as C1003-08; default: all."
            " Of new-pads: front, rear, all or corners; of measured: fl=9.8 fr=9.7, mm",
        ),
    ] = None,
    ids: Annotated[
        str,
        typer.Option(
            "--ids",
            metavar="REQUEST:RESPONSE",
            help="Identifiers of the ECU's diagnostics (`run --diagnostics`)",
        ),
    ] = "0x7E0:0x7E8",
    key: Annotated[
        Path | None,
        typer.Option("--key", metavar="FILE", help="Secret for new-pads, measured, forget: that of `run`"),
    ] = None,
) -> int:
    """Ask an ECU on a bus for its faults and values (UDS).

    Register new and measured pads. Exit code 1: it has confirmed faults."""
    from ecu.diagnostics import tester

    return tester.diag(action, names or [], interface, channel, ids, key)


@app.command()
def pdx(
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FILE", help="File to write")],
) -> None:
    """Write the PDX file of `run --diagnostics` (ODX, ISO 22901-1)."""
    from ecu.diagnostics import pdx

    pdx.pdx(out)
