"""`brake-ecu lab …`: the brake dynamometer. Each command imports what it needs when it is called."""

from pathlib import Path
from typing import Annotated

import typer

from ecu.arguments import Commands

app = Commands(help="Run a simulated brake dynamometer and analyse recordings.", no_args_is_help=True)


@app.command()
def run(
    programme: Annotated[
        str, typer.Argument(metavar="PROGRAMME", help="cpc, ams, ak-master, or a file as in config/rig")
    ],
    out: Annotated[
        Path,
        typer.Option(
            "--out", metavar="DATA", help="Recording to write, .csv or .parquet; columns and brake beside it"
        ),
    ],
    brake: Annotated[
        str, typer.Option("--brake", metavar="BRAKE", help="Brake A, B or C, or a lining of LININGS")
    ] = "A",
    seed: Annotated[
        int, typer.Option("--seed", metavar="N", min=0, help="Seed of the pad, its scatter and the sensors")
    ] = 0,
    law: Annotated[
        str | None,
        typer.Option("--law", metavar="LAW", help="Use this friction law of the lining instead of a pad"),
    ] = None,
    linings: Annotated[
        Path | None,
        typer.Option("--linings", metavar="LININGS", help="Lining file of `identify friction`; needs --law"),
    ] = None,
) -> int:
    """Run a programme on the dynamometer. Record at 200 Hz; the pad follows none of the friction laws."""
    from brakelab.friction_lab import command

    return command.run(programme, brake, seed, out, law, linings)


@app.command()
def look(
    data: Annotated[
        list[Path], typer.Argument(metavar="DATA", help="Recordings of one brake: .csv .parquet .mf4")
    ],
    columns: Annotated[
        Path | None,
        typer.Option("--columns", metavar="MAP.toml", help="Columns, units, brake; default: DATA with .toml"),
    ] = None,
) -> int:
    """Analyse a recording. Show principal components, shares of variance, effect of the previous stop."""
    from brakelab.friction_lab import command

    return command.look(data, columns)
