"""`brake-ecu lab …`: the brake dynamometer. Each command imports what it needs when it is called."""

from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(help="A simulated brake dynamometer, and what a recording shows.", no_args_is_help=True)


@app.command()
def run(
    programme: Annotated[
        str, typer.Argument(metavar="PROGRAMME", help="A file as in config/rig, or cpc, ams")
    ],
    out: Annotated[
        Path, typer.Option("--out", metavar="DATA", help=".csv or .parquet; columns and brake go beside it")
    ],
    brake: Annotated[
        str, typer.Option("--brake", metavar="BRAKE", help="A, B or C; or a lining of LININGS")
    ] = "A",
    seed: Annotated[
        int, typer.Option("--seed", min=0, help="Seed of the pad, its chance and the sensors")
    ] = 0,
    law: Annotated[
        str | None,
        typer.Option("--law", metavar="LAW", help="A friction law of the lining, instead of a pad"),
    ] = None,
    linings: Annotated[
        Path | None,
        typer.Option("--linings", metavar="LININGS", help="What `identify friction` wrote; needs --law"),
    ] = None,
) -> int:
    """A programme on the simulated dynamometer, 200 Hz, with a pad that follows none of the laws."""
    from brakelab.friction_lab import command

    return command.run(programme, brake, seed, out, law, linings)


@app.command()
def look(
    data: Annotated[
        list[Path], typer.Argument(metavar="DATA…", help="Recordings of one brake: .csv .parquet .mf4")
    ],
    columns: Annotated[
        Path | None,
        typer.Option("--columns", metavar="MAP.toml", help="Columns, units, brake; default: DATA with .toml"),
    ] = None,
) -> int:
    """Principal components, shares of variance and the effect of the stop before."""
    from brakelab.friction_lab import command

    return command.look(data, columns)
