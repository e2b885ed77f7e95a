"""`brake-ecu identify …`: models from measurements. Each command imports what it needs when it is called."""

from pathlib import Path
from typing import Annotated

from brakelab.cli.arguments import Columns, present, recorded, working
from ecu.arguments import Commands, Config, Map, argument, flag, option

app = Commands(help="Identify models from your own measurements.", no_args_is_help=True)


@app.callback()
def _identify() -> None:
    pass


@app.command()
def friction(
    data: Annotated[
        list[Path],
        argument("DATA", "Recordings of one brake, or folders: .csv .parquet .mf4", callback=recorded),
    ],
    out: Annotated[Path, option("BRAKE.toml", "Lining file to write, for the simulated vehicle")],
    columns: Columns = None,
    held_out: Annotated[
        Path | None, option("DATA", "Recording to choose the law by; default: the hottest stops")
    ] = None,
    profile: Annotated[
        str | None, option("LAW", "Compute profile likelihoods of this law's parameters")
    ] = None,
    own: Annotated[
        list[str] | None, option("LAW.py", "A law of your own: a file, or an entry point's name")
    ] = None,
    discover: Annotated[
        Path | None, option("LAW.py", "Law to write of the terms found, and to identify")
    ] = None,
) -> None:
    """Identify a friction law from dynamometer recordings. Fit all laws, choose one, state its limits."""
    from ecu.compiling import report_compiling

    with working("identify friction"):
        from brakelab.identify.friction import command

    with report_compiling():
        command.friction(data, columns, held_out, out, profile, tuple(own or ()), discover)


@app.command()
def wear(
    measured: Annotated[
        list[Path],
        argument("MANIFEST.csv", "Table of blocks; with --from-logs results of drives", callback=present),
    ],
    config: Config,
    out: Annotated[Path, option("CAR.toml", "CONFIG to write, CAR.md beside it; or BLOCKS.csv")],
    axle: Annotated[str, option("AXLE", "Axle of the linings: front or rear")] = "front",
    columns: Columns = None,
    from_logs: Annotated[
        bool, flag("--from-logs", "Write the blocks that stand for your drives, for a rig: BLOCKS.csv")
    ] = False,
) -> None:
    """Identify the wear law of brake linings from dynamometer blocks. Write a CONFIG."""
    from ecu.errors import UserError

    if len(measured) > 1 and not from_logs:
        raise UserError(str(measured[1]), "", "one MANIFEST.csv; for blocks of drives give --from-logs")
    with working("identify wear"):
        from brakelab.identify.wear import command, from_drives

        if from_logs:
            from_drives.blocks_from_drives(measured, config, axle, out)
        else:
            command.identify_wear(measured[0], config, axle, out, columns)


@app.command()
def dust(
    manifest: Annotated[
        Path, argument("MANIFEST.csv", "Trips with a particle counter: trip, file, test", callback=present)
    ],
    config: Config,
    out: Annotated[Path, option("CAR.toml", "CONFIG to write, CAR.md beside it; or RUN.md")],
    axle: Annotated[str, option("AXLE", "Axle of the brakes: front or rear")] = "front",
    columns: Columns = None,
    cycle: Annotated[
        bool, flag("--cycle", "Report one run of the WLTP-Brake cycle, for UN R179: RUN.md")
    ] = False,
) -> None:
    """Identify particle emission from trips with a counter. Write a CONFIG."""
    with working("identify dust"):
        from brakelab.identify.dust import command, cycle_page

        identify = cycle_page.report_cycle if cycle else command.identify_dust
        identify(manifest, config, axle, out, columns)


@app.command()
def thermal(
    logs: Annotated[
        list[Path],
        argument("LOG", "Drives with disc_temperature_measured_*, any log format", callback=present),
    ],
    config: Config,
    out: Annotated[Path, option("CAR.toml", "CONFIG to write, CAR.md and CAR.svg beside it")],
    map: Map = None,
) -> None:
    """Identify the disc temperature model, dry and wet. Write a CONFIG."""
    with working("identify thermal"):
        from brakelab.identify.thermal import command

    command.identify_thermal(logs, config, map, out)


@app.command()
def vehicle(
    drives: Annotated[
        list[Path], argument("DRIVE", "Logs (with --map) or files of decoded signals", callback=present)
    ],
    config: Config,
    out: Annotated[Path, option("CAR.toml", "CONFIG to write, with a page CAR.md beside it")],
    map: Map = None,
    closed: Annotated[
        bool, flag("--closed", "State that each drive ends at the height where it began")
    ] = False,
) -> None:
    """Identify radii, mass, drag, tyres and brakes of a car. Write a CONFIG."""
    with working("identify vehicle"):
        from brakelab.identify.vehicle import command

    command.identify_vehicle(drives, config, map, closed, out)
