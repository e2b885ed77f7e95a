"""`brake-ecu lab …`: the brake dynamometer. Each command imports what it needs when it is called."""

import tomllib
from pathlib import Path
from typing import Annotated, Any

from brakelab.cli.arguments import Columns, recorded, working
from ecu.arguments import Commands, argument, option
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
        argument(
            "PROGRAMME",
            "cpc, ams, ak-master, or a file as in config/rig",
            autocompletion=shipped("config/rig"),
        ),
    ],
    out: Annotated[Path, option("DATA", "Recording to write, .csv or .parquet; columns and brake beside it")],
    brake: Annotated[
        str, option("BRAKE", "Brake A, B or C, or a lining of LININGS", autocompletion=brakes)
    ] = "A",
    seed: Annotated[int, option("N", "Seed of the pad, its scatter and the sensors", min=0)] = 0,
    law: Annotated[
        str | None, option("LAW", "Use this friction law of the lining instead of a pad", autocompletion=laws)
    ] = None,
    linings: Annotated[
        Path | None, option("LININGS", "Lining file of `identify friction`; needs --law")
    ] = None,
) -> None:
    """Run a programme on the dynamometer. Record at 200 Hz; the pad follows none of the friction laws."""
    from ecu.compiling import report_compiling

    with working("lab run"):
        from brakelab.identify.friction import command

    with report_compiling():
        command.run(programme, brake, seed, out, law, linings)


@app.command()
def look(
    data: Annotated[
        list[Path],
        argument("DATA", "Recordings of one brake, or folders: .csv .parquet .mf4", callback=recorded),
    ],
    columns: Columns = None,
) -> None:
    """Analyse a recording. Show principal components, shares of variance, effect of the previous stop."""
    with working("lab look"):
        from brakelab.identify.friction import command

    command.look(data, columns)


@app.command()
def report(
    data: Annotated[
        list[Path],
        argument(
            "DATA",
            "Recording, or folder of its files, of a programme; two: compared; more: parts of one",
            callback=recorded,
        ),
    ],
    out: Annotated[Path | None, option("REPORT.html", "Page to write, with the charts")] = None,
    columns: Columns = None,
    programme: Annotated[
        str | None,
        option(
            "PROGRAMME",
            "File as in config/rig; default: the shipped one that it is",
            autocompletion=shipped("config/rig"),
        ),
    ] = None,
) -> int:
    """Show friction section by section, as for AK-Master (SAE J2522). Compare two linings."""
    with working("lab report"):
        from brakelab.identify.friction.report import report as report_of

    return report_of(data, columns, programme, out)


@app.command()
def export(
    source: Annotated[Path, argument("FILE.toml", "Lining file of `identify friction`, or a CONFIG")],
    out: Annotated[Path, option("LAW.c", "C source to write, or .csv: a table of friction")],
    brake: Annotated[
        str | None, option("BRAKE", "Lining of the file; default: its only one", autocompletion=brakes)
    ] = None,
    law: Annotated[str, option("LAW", "Friction law of the lining", autocompletion=laws)] = "SIM",
    axle: Annotated[str, option("AXLE", "Of a CONFIG, whose wear and dust: front or rear")] = "front",
) -> None:
    """Write an identified law as C. Friction, or wear and dust of a CONFIG; friction also as a table."""
    from brakelab.identify.export import export as write

    write(source, out, brake, law, axle)
