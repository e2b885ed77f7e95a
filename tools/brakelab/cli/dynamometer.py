"""`brake-ecu lab …`: the brake dynamometer. Each command imports what it needs when it is called."""

import tomllib
from pathlib import Path
from typing import Annotated, Any

import typer

from ecu.arguments import Commands
from ecu.completion import fitting, shipped
from ecu.settings.resources import resource

app = Commands(help="Run a simulated brake dynamometer and analyse recordings.", no_args_is_help=True)


def _linings() -> dict[str, Any]:
    """Return the shipped linings as they are written, for completion."""
    written = tomllib.loads(resource("config/plant/linings.toml").read_text("utf-8"))["lining"]
    return dict(written)


def brakes(incomplete: str) -> list[str]:
    """Return the shipped brakes that begin like that."""
    return fitting(_linings(), incomplete)


def laws(incomplete: str) -> list[str]:
    """Return the friction laws of shipped brakes that begin like that."""
    return fitting(dict.fromkeys(law for one in _linings().values() for law in one["friction"]), incomplete)


@app.command()
def run(
    programme: Annotated[
        str,
        typer.Argument(
            autocompletion=shipped("config/rig"),
            metavar="PROGRAMME",
            help="cpc, ams, ak-master, or a file as in config/rig",
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(
            "--out", metavar="DATA", help="Recording to write, .csv or .parquet; columns and brake beside it"
        ),
    ],
    brake: Annotated[
        str,
        typer.Option(
            "--brake", autocompletion=brakes, metavar="BRAKE", help="Brake A, B or C, or a lining of LININGS"
        ),
    ] = "A",
    seed: Annotated[
        int, typer.Option("--seed", metavar="N", min=0, help="Seed of the pad, its scatter and the sensors")
    ] = 0,
    law: Annotated[
        str | None,
        typer.Option(
            "--law",
            autocompletion=laws,
            metavar="LAW",
            help="Use this friction law of the lining instead of a pad",
        ),
    ] = None,
    linings: Annotated[
        Path | None,
        typer.Option("--linings", metavar="LININGS", help="Lining file of `identify friction`; needs --law"),
    ] = None,
) -> int:
    """Run a programme on the dynamometer. Record at 200 Hz; the pad follows none of the friction laws."""
    from brakelab.identify.friction import command
    from ecu.compiling import report_compiling

    with report_compiling():
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
    from brakelab.identify.friction import command

    return command.look(data, columns)


@app.command()
def report(
    data: Annotated[
        Path, typer.Argument(metavar="DATA", help="Recording of a programme: .csv .parquet .mf4")
    ],
    other: Annotated[
        Path | None, typer.Argument(metavar="[DATA2]", help="Recording of another lining, compared with it")
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="REPORT.html", help="Page to write, with the charts")
    ] = None,
    columns: Annotated[
        Path | None,
        typer.Option("--columns", metavar="MAP.toml", help="Columns, units, brake; default: DATA with .toml"),
    ] = None,
    programme: Annotated[
        str | None,
        typer.Option(
            "--programme",
            autocompletion=shipped("config/rig"),
            metavar="PROGRAMME",
            help="File as in config/rig; default: the shipped one that it is",
        ),
    ] = None,
) -> int:
    """Show friction section by section, as for AK-Master (SAE J2522). Compare two linings."""
    from brakelab.identify.friction.report import report as report_of

    return report_of(data, other, columns, programme, out)
