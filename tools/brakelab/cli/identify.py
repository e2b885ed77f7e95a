"""`brake-ecu identify …`: models from measurements. Each command imports what it needs when it is called."""

from pathlib import Path
from typing import Annotated

import typer

from ecu.arguments import Commands, Config, Map

app = Commands(help="Identify models from your own measurements.", no_args_is_help=True)


@app.callback()
def _identify() -> None:
    pass


@app.command()
def friction(
    data: Annotated[
        list[Path],
        typer.Argument(metavar="DATA", help="Recordings of one brake on a dynamometer: .csv .parquet .mf4"),
    ],
    out: Annotated[
        Path,
        typer.Option("--out", metavar="BRAKE.toml", help="Lining file to write, for the simulated vehicle"),
    ],
    columns: Annotated[
        Path | None,
        typer.Option("--columns", metavar="MAP.toml", help="Columns, units, brake; default: DATA with .toml"),
    ] = None,
    held_out: Annotated[
        Path | None,
        typer.Option(
            "--held-out", metavar="DATA", help="Recording to choose the law by; default: the hottest stops"
        ),
    ] = None,
    profile: Annotated[
        str | None,
        typer.Option("--profile", metavar="LAW", help="Compute profile likelihoods of this law's parameters"),
    ] = None,
    own: Annotated[
        list[str] | None,
        typer.Option("--own", metavar="LAW.py", help="A law of your own: a file, or an entry point's name"),
    ] = None,
    discover: Annotated[
        Path | None,
        typer.Option("--discover", metavar="LAW.py", help="Law to write of the terms found, and to identify"),
    ] = None,
) -> int:
    """Identify a friction law from dynamometer recordings. Fit all laws, choose one, state its limits."""
    from brakelab.identify.friction import command
    from ecu.compiling import report_compiling

    with report_compiling():
        return command.friction(data, columns, held_out, out, profile, tuple(own or ()), discover)


@app.command()
def wear(
    measured: Annotated[
        list[Path],
        typer.Argument(metavar="MANIFEST.csv", help="Table of blocks; with --from-logs results of drives"),
    ],
    config: Config,
    out: Annotated[
        Path,
        typer.Option("--out", metavar="CAR.toml", help="CONFIG to write, CAR.md beside it; or BLOCKS.csv"),
    ],
    axle: Annotated[
        str, typer.Option("--axle", metavar="AXLE", help="Axle of the linings: front or rear")
    ] = "front",
    from_logs: Annotated[
        bool,
        typer.Option(
            "--from-logs", help="Write the blocks that stand for your drives, for a rig: BLOCKS.csv"
        ),
    ] = False,
) -> int:
    """Identify the wear law of brake linings from dynamometer blocks. Write a CONFIG."""
    from brakelab.identify.wear import command, from_drives
    from ecu.errors import UserError

    if from_logs:
        return from_drives.blocks_from_drives(measured, config, axle, out)
    if len(measured) > 1:
        raise UserError(str(measured[1]), "", "one MANIFEST.csv; for blocks of drives give --from-logs")
    return command.identify_wear(measured[0], config, axle, out)


@app.command()
def dust(
    manifest: Annotated[
        Path, typer.Argument(metavar="MANIFEST.csv", help="Trips with a particle counter: trip, file, test")
    ],
    config: Config,
    out: Annotated[
        Path,
        typer.Option("--out", metavar="CAR.toml", help="CONFIG to write, CAR.md beside it; or RUN.md"),
    ],
    axle: Annotated[
        str, typer.Option("--axle", metavar="AXLE", help="Axle of the brakes: front or rear")
    ] = "front",
    cycle: Annotated[
        bool,
        typer.Option("--cycle", help="Report one run of the WLTP-Brake cycle, for UN R179: RUN.md"),
    ] = False,
) -> int:
    """Identify particle emission from trips with a counter. Write a CONFIG."""
    from brakelab.identify.dust import command, cycle_page

    if cycle:
        return cycle_page.report_cycle(manifest, config, axle, out)
    return command.identify_dust(manifest, config, axle, out)


@app.command()
def thermal(
    logs: Annotated[
        list[Path],
        typer.Argument(metavar="LOG", help="Drives with disc_temperature_measured_*, any log format"),
    ],
    config: Config,
    out: Annotated[
        Path, typer.Option("--out", metavar="CAR.toml", help="CONFIG to write, CAR.md and CAR.svg beside it")
    ],
    map: Map = None,
) -> int:
    """Identify the disc temperature model, dry and wet. Write a CONFIG."""
    from brakelab.identify.thermal import command

    return command.identify_thermal(logs, config, map, out)


@app.command()
def vehicle(
    drives: Annotated[
        list[Path], typer.Argument(metavar="DRIVE", help="Logs (with --map) or files of decoded signals")
    ],
    config: Config,
    out: Annotated[
        Path, typer.Option("--out", metavar="CAR.toml", help="CONFIG to write, with a page CAR.md beside it")
    ],
    map: Map = None,
    closed: Annotated[
        bool, typer.Option("--closed", help="State that each drive ends at the height where it began")
    ] = False,
) -> int:
    """Identify radii, mass, drag, tyres and brakes of a car. Write a CONFIG."""
    from brakelab.identify.vehicle import command

    return command.identify_vehicle(drives, config, map, closed, out)
