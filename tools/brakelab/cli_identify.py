"""`brake-ecu identify …`: models from measurements. Each command imports what it needs when it is called."""

from pathlib import Path
from typing import Annotated

import typer

from ecu.arguments import Config

app = typer.Typer(help="Models from measurements of your own.", no_args_is_help=True)


@app.callback()
def _identify() -> None:
    pass


@app.command()
def friction(
    data: Annotated[
        list[Path],
        typer.Argument(metavar="DATA…", help="Recordings of one brake on a dynamometer: .csv .parquet .mf4"),
    ],
    out: Annotated[
        Path, typer.Option("--out", metavar="BRAKE.toml", help="Lining file of the simulated vehicle")
    ],
    columns: Annotated[
        Path | None,
        typer.Option("--columns", metavar="MAP.toml", help="Columns, units, brake; default: DATA with .toml"),
    ] = None,
    held_out: Annotated[
        Path | None,
        typer.Option(
            "--held-out", metavar="DATA", help="The choice is made on this; default: the hottest stops"
        ),
    ] = None,
    profile: Annotated[
        str | None,
        typer.Option("--profile", metavar="LAW", help="Profile likelihood of this law's numbers too"),
    ] = None,
) -> int:
    """A friction law from a dynamometer's recording: all laws fitted, one chosen, its numbers and limits."""
    from brakelab.friction_lab import command

    return command.friction(data, columns, held_out, out, profile)


@app.command()
def wear(
    manifest: Annotated[
        Path,
        typer.Argument(metavar="MANIFEST.csv", help="Blocks: file, masses, thicknesses"),
    ],
    config: Config,
    out: Annotated[Path, typer.Option("--out", metavar="CAR.toml", help="A CONFIG; CAR.md beside")],
    axle: Annotated[str, typer.Option("--axle", metavar="AXLE", help="Whose linings: front, rear")] = "front",
) -> int:
    """The wear law of brake linings from dynamometer blocks. Writes a CONFIG."""
    from brakelab.identification import wear_command

    return wear_command.identify_wear(manifest, config, axle, out)


@app.command()
def dust(
    manifest: Annotated[
        Path, typer.Argument(metavar="MANIFEST.csv", help="Trips with a particle counter: trip, file, test")
    ],
    config: Config,
    out: Annotated[Path, typer.Option("--out", metavar="CAR.toml", help="A CONFIG; CAR.md beside")],
    axle: Annotated[str, typer.Option("--axle", metavar="AXLE", help="Whose brakes: front, rear")] = "front",
) -> int:
    """What a brake emits, from trips with a particle counter. Writes a CONFIG."""
    from brakelab.identification import dust_command

    return dust_command.identify_dust(manifest, config, axle, out)
