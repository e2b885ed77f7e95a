"""The command line `brake-ecu`: arguments in, one line out for whatever the user can mend.

Every command imports what it needs when it is called, so that the daemon starts without the laboratory.
Exit code 0 on success, 1 when the run found a fault, 2 for bad arguments, configuration or input.
"""

import errno
import os
import sys
import traceback
from pathlib import Path
from typing import Annotated

import typer

from ecu import __version__
from ecu.errors import RunFault, UserError
from ecu.resources import named

LABORATORY = ("bokeh", "jinja2", "pyarrow", "pymoo")
"""What the extra `lab` installs, by the names that are imported."""
FLEET = ("distributed", "fsspec")
"""What the extra `fleet` installs."""

app = typer.Typer(
    help="A real-time brake ECU: estimates brake lining friction, corrects pressure demands by it.",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def _config(name: str) -> Path:
    return named(name, "config")


def _map(name: str) -> Path:
    return named(name, "config/maps")


def _scenario(name: str) -> Path:
    return named(name, "config/scenarios")


def _show_version(wanted: bool) -> None:
    if wanted:
        print(f"brake-ecu {__version__}")
        raise typer.Exit


_CONFIG = typer.Option(
    "--config", parser=_config, metavar="CONFIG", help="Vehicle and tuning: a file, or suv, …"
)
_MAP = typer.Option(
    "--map", parser=_map, metavar="MAP", help="Signal map of a foreign bus: a file, or mustang, …"
)
_INTERFACE = typer.Option(
    "-i", "--interface", metavar="INTERFACE", help="As python-can calls it: socketcan, …"
)
_CHANNEL = typer.Option("-c", "--channel", metavar="CHANNEL", help="As python-can calls it: can0, …")
_OBSERVER = typer.Option(
    "--observer", metavar="OBSERVER", help="joint, observer1, observer2; default: CONFIG's"
)
_STATE = typer.Option("--state", metavar="DIR", help="Where learned friction is kept between runs")

Config = Annotated[Path, _CONFIG]
Map = Annotated[Path | None, _MAP]
Interface = Annotated[str, _INTERFACE]
Channel = Annotated[str, _CHANNEL]
Observer = Annotated[str | None, _OBSERVER]
State = Annotated[Path | None, _STATE]


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and leave"),
    ] = False,
) -> None:
    pass


@app.command()
def run(
    config: Config,
    interface: Interface,
    channel: Channel,
    map: Map = None,
    record: Annotated[
        Path | None,
        typer.Option("--record", metavar="DIR", help="Record frames, cycles and outputs into this folder"),
    ] = None,
    state: State = None,
) -> int:
    """The daemon on a bus. A shadow unless `transmit = true` in CONFIG arms it."""
    from ecu import service

    return service.run(service.RunOptions(config, interface, channel, map, record, state))


@app.command()
def demo(
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder of the recording and the report")
    ] = Path("out/demo"),
) -> int:
    """The daemon brakes a simulated car in real time. A report at the end."""
    from brakelab import demo

    return demo.demo(out)


@app.command()
def simulate(
    scenario: Annotated[
        Path,
        typer.Argument(
            parser=_scenario, metavar="SCENARIO", help="A scenario file, or a shipped one by name"
        ),
    ],
    config: Config,
    out: Annotated[
        Path, typer.Option("--out", metavar="NAME", help="Writes NAME.log, NAME.parquet, NAME.truth.parquet")
    ],
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the drawn vehicle and its noise")] = 0,
) -> int:
    """A scenario in closed loop. Writes frames, decoded inputs and true values."""
    from brakelab import closed_loop

    return closed_loop.simulate(scenario, config, out, seed)


@app.command()
def replay(
    logs: Annotated[
        list[Path],
        typer.Argument(metavar="LOG…", help="One drive: CAN logs, or Parquet or CSV of signals, in order"),
    ],
    config: Config,
    out: Annotated[Path, typer.Option("--out", metavar="RESULT.parquet", help="Results, one row per 10 ms")],
    map: Map = None,
    observer: Observer = None,
    state: State = None,
    cycles: Annotated[
        Path | None,
        typer.Option(
            "--cycles", metavar="RECORDING", help="What `run --record` left: repeat its cycles to the bit"
        ),
    ] = None,
) -> int:
    """A recorded drive through the code of the ECU. Writes results."""
    from brakelab.replay import command

    return command.replay(logs, config, map, observer, state, out, cycles)


@app.command()
def play(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="A CAN log, or Parquet or CSV of signals")],
    interface: Interface,
    channel: Channel,
    map: Map = None,
    speed: Annotated[float, typer.Option("--speed", metavar="X", help="Times real time")] = 1.0,
) -> int:
    """A recorded drive onto a bus. With MAP as frames of the ECU with fresh E2E."""
    from brakelab import play

    return play.play(log, interface, channel, map, speed)


@app.command()
def report(
    result: Annotated[Path, typer.Argument(metavar="RESULT.parquet", help="What `replay` wrote")],
    out: Annotated[Path, typer.Option("--out", metavar="REPORT.html", help="One self-contained page")],
    truth: Annotated[
        Path | None, typer.Option("--truth", metavar="TRUTH.parquet", help="True values of a simulated drive")
    ] = None,
    timing: Annotated[
        Path | None,
        typer.Option("--timing", metavar="RECORDING", help="What `run --record` left: times of the loop"),
    ] = None,
) -> int:
    """Results as a page of linked figures."""
    from brakelab.report import command

    command.report(result, truth, out, timing)
    return 0


map_app = typer.Typer(help="Signal maps: what the frames of a car mean.", no_args_is_help=True)
app.add_typer(map_app, name="map")


@map_app.command()
def suggest(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="A recorded drive")],
    dbc: Annotated[Path, typer.Option("--dbc", metavar="DB", help="The car's database")],
    out: Annotated[Path | None, typer.Option("--out", metavar="MAP.toml", help="Default: printed")] = None,
) -> int:
    """A map proposed by names, units and physics, for you to edit."""
    from brakelab.mapping import command

    return command.suggest(log, dbc, out)


@app.command()
def fleet(
    logs: Annotated[
        list[str], typer.Argument(metavar="GLOB|MANIFEST", help='"data/*/*.log", a folder a car')
    ],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Tables and report")],
    config: Annotated[Path | None, _CONFIG] = None,
    map: Map = None,
    observer: Observer = None,
    scheduler: Annotated[
        str | None, typer.Option("--scheduler", metavar="ADDRESS", help="Of Dask; default: processes here")
    ] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes here; default: one a core")] = None,
    rows: Annotated[bool, typer.Option("--rows", help="Keep rows too, 0.1 GB for each hour")] = False,
) -> int:
    """Thousands of recorded drives, vehicles side by side. Goes on where it stopped."""
    from brakelab.fleet import command

    return command.fleet(logs, config, map, observer, scheduler, workers, out, rows)


@app.command()
def compare(
    a: Annotated[Path, typer.Argument(metavar="A.parquet", help="What `replay` wrote")],
    b: Annotated[Path, typer.Argument(metavar="B.parquet", help="Of another version or tuning")],
) -> int:
    """Two results side by side, what differs most first. Exit code 1: something differs that matters."""
    from brakelab import compare

    return compare.compare(a, b)


@app.command()
def tune(
    config: Config,
    scenario: Annotated[
        list[Path] | None,
        typer.Option(
            "--scenario",
            parser=_scenario,
            metavar="SCENARIO",
            help="Drives to tune on, repeatable; default: fixed-pedal, bursts",
        ),
    ] = None,
    validate: Annotated[
        list[Path] | None,
        typer.Option(
            "--validate",
            parser=_scenario,
            metavar="SCENARIO",
            help="Drives to validate on, repeatable; default: fixed-decel, fade",
        ),
    ] = None,
    seeds: Annotated[
        int, typer.Option("--seeds", min=1, help="Drawn cars to tune on, and as many others to validate")
    ] = 4,
    generations: Annotated[int, typer.Option("--generations", min=1, help="Of the genetic algorithm")] = 20,
    population: Annotated[int, typer.Option("--population", min=4, help="Tunings in a generation")] = 30,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the genetic algorithm")] = 0,
    out: Annotated[
        Path, typer.Option("--out", metavar="TUNED.toml", help="What a CONFIG can `include`")
    ] = Path("tuned.toml"),
) -> int:
    """Noise of Observer 2 by a genetic algorithm on simulated drives. Ctrl-C: the best so far."""
    from brakelab.tuning import command

    trained = scenario or [_scenario(name) for name in command.FIRST_SESSION]
    validated = validate or [_scenario(name) for name in command.LATER_SESSIONS]
    return command.tune(config, trained, validated, seeds, command.Budget(generations, population, seed), out)


@app.command()
def bench(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="One benchmark; without: all")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print JSON instead of a table")] = False,
    seeds: Annotated[int, typer.Option(min=1, help="Cars that stops and observers draw")] = 20,
) -> int:
    """Times of step, codec and cycle on this machine; accuracy over drawn cars."""
    from brakelab.bench import command

    return command.bench(name, json, seeds)


@app.command()
def doctor(
    config: Annotated[Path | None, _CONFIG] = None,
    map: Map = None,
    interface: Annotated[str | None, _INTERFACE] = None,
    channel: Annotated[str | None, _CHANNEL] = None,
) -> int:
    """What this machine lacks to run it. With a bus: frames, rates, E2E."""
    from ecu.diagnostics import doctor

    return doctor.doctor(config, map, interface, channel)


def _describe(error: Exception) -> tuple[str, int]:
    """Return the one line that the user reads, and the exit code."""
    match error:
        case UserError():
            return str(error), 2
        case RunFault():
            return str(error), 1
        case typer.TyperException():
            context = getattr(error, "ctx", None)
            command = context.command_path if context else "brake-ecu"
            return f"{error.format_message().rstrip('.')}; see {command} --help", error.exit_code
        case ModuleNotFoundError(name=str(name)) if name.partition(".")[0] in LABORATORY:
            return f"{name} is missing: this command needs the laboratory, pip install 'brake-ecu[lab]'", 2
        case ModuleNotFoundError(name=str(name)) if name.partition(".")[0] in (*FLEET, "dask"):
            return f"{name} is missing: fleets need Dask, pip install 'brake-ecu[lab,fleet]'", 2
        case OSError(filename=str(filename), strerror=str(reason)):
            return f"{filename}: {reason.lower()}", 2
        case OSError(errno=errno.ENOSPC):
            return "no space left on the disk; free some, or write elsewhere", 2
        case _:
            return (
                f"unexpected {type(error).__name__}: {error} (a fault of the program, please report it;"
                " BRAKE_ECU_DEBUG=1 shows where)",
                1,
            )


def main(arguments: list[str] | None = None) -> int:
    """Run one command line and return its exit code."""
    try:
        return app(arguments or sys.argv[1:] or ["--help"], prog_name="brake-ecu", standalone_mode=False) or 0
    except (KeyboardInterrupt, typer.Abort):
        return 130
    except Exception as error:
        if os.environ.get("BRAKE_ECU_DEBUG") == "1":
            traceback.print_exc()
        line, code = _describe(error)
        print(f"brake-ecu: {' '.join(line.split())}", file=sys.stderr)
        return code


if __name__ == "__main__":
    raise SystemExit(main())
