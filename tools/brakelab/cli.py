"""Commands of the laboratory: each imports what it needs when it is called, so that the daemon starts
without it."""

from pathlib import Path
from typing import Annotated

import typer

from brakelab.cli_identify import app as identify_app
from brakelab.cli_lab import app as lab_app
from ecu.arguments import (
    CHANNEL_OPTION,
    CONFIG_OPTION,
    INTERFACE_OPTION,
    Channel,
    Config,
    Draw,
    Interface,
    Map,
    Observer,
    State,
    scenario_file,
)
from ecu.errors import UserError

app = typer.Typer()
app.add_typer(lab_app, name="lab")
app.add_typer(identify_app, name="identify")


@app.command()
def demo(
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder of the recording and the report")
    ] = Path("out/demo"),
) -> int:
    """The daemon brakes a simulated car in real time. A report at the end."""
    from brakelab.rig import demo

    return demo.demo(out)


@app.command()
def simulate(
    scenario: Annotated[
        Path,
        typer.Argument(
            parser=scenario_file, metavar="SCENARIO", help="A scenario file, or a shipped one by name"
        ),
    ],
    config: Config,
    out: Annotated[
        Path, typer.Option("--out", metavar="NAME", help="Writes NAME.log, NAME.parquet, NAME.truth.parquet")
    ],
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the drawn vehicle and its noise")] = 0,
    draw: Draw = None,
) -> int:
    """A scenario in closed loop. Writes frames, decoded inputs and true values."""
    from brakelab.simulation import simulate

    return simulate.simulate(scenario, config, out, seed, draw)


@app.command()
def rig(
    scenario: Annotated[
        list[str],
        typer.Argument(
            metavar="SCENARIO…", help="Scenario files or folders of them, or shipped ones by name: faults, …"
        ),
    ],
    config: Config,
    interface: Annotated[str | None, INTERFACE_OPTION] = None,
    channel: Annotated[str | None, CHANNEL_OPTION] = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder of results and reports")] = Path(
        "out/rig"
    ),
    lock_step: Annotated[
        bool, typer.Option("--lock-step", help="In memory, as fast as it goes, instead of on a bus")
    ] = False,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the drawn vehicle and its noise")] = 0,
) -> int:
    """Tables of scenarios with their faults: daemon and vehicle on a bus. One report."""
    from brakelab.rig import command

    if (interface is None) != (channel is None):
        raise UserError("-i, -c", "", "give both or none; none: a bus of its own on this machine")
    bus = None if interface is None or channel is None else (interface, channel)
    return command.rig(scenario, config, bus, out, lock_step, seed)


@app.command()
def replay(
    logs: Annotated[
        list[Path],
        typer.Argument(
            metavar="LOG…",
            help="One drive, in order: logs of CAN frames (.log .asc .blf .trc .mf4) or "
            "of signals (.mf4 .parquet .csv)",
        ),
    ],
    config: Config,
    out: Annotated[
        Path, typer.Option("--out", metavar="RESULT.parquet", help="Results, a row per 10 ms; or .mf4")
    ],
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
    log: Annotated[
        Path,
        typer.Argument(
            metavar="LOG", help="Frames (.log .asc .blf .trc .mf4) or signals (.mf4 .parquet .csv)"
        ),
    ],
    interface: Interface,
    channel: Channel,
    map: Map = None,
    speed: Annotated[float, typer.Option("--speed", metavar="X", help="Times real time, 0.1–20")] = 1.0,
) -> int:
    """A recorded drive onto a bus. With MAP as frames of the ECU with fresh E2E."""
    from brakelab.play import command as play

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
        list[str],
        typer.Argument(
            metavar="GLOB|MANIFEST", help='"data/*/*.log": a folder a vehicle; or a manifest, CSV or TOML'
        ),
    ],
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Tables and report; goes on where it stopped")
    ],
    config: Annotated[Path | None, CONFIG_OPTION] = None,
    map: Map = None,
    observer: Observer = None,
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", metavar="ADDRESS", help="Of a Dask cluster; default: processes here"),
    ] = None,
    workers: Annotated[
        int | None, typer.Option("--workers", min=1, metavar="N", help="Processes here; default: one a core")
    ] = None,
    rows: Annotated[
        bool, typer.Option("--rows", help="Keep the rows of every drive too: 1 GB for 15 h and more")
    ] = False,
) -> int:
    """Thousands of recorded drives, vehicles side by side. Exit code 1: drives failed."""
    from brakelab.fleet import command

    return command.fleet(logs, config, map, observer, scheduler, workers, out, rows)


@app.command()
def compare(
    a: Annotated[Path, typer.Argument(metavar="A.parquet", help="What `replay` wrote")],
    b: Annotated[Path, typer.Argument(metavar="B.parquet", help="Of another version or tuning")],
) -> int:
    """Two results side by side, what differs most first. Exit code 1: something differs that matters."""
    from brakelab.results import compare

    return compare.compare(a, b)


@app.command()
def tune(
    config: Config,
    scenario: Annotated[
        list[Path] | None,
        typer.Option(
            "--scenario",
            parser=scenario_file,
            metavar="SCENARIO",
            help="Drives to tune on, repeatable; default: fixed-pedal, bursts",
        ),
    ] = None,
    validate: Annotated[
        list[Path] | None,
        typer.Option(
            "--validate",
            parser=scenario_file,
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

    trained = scenario or [scenario_file(name) for name in command.FIRST_SESSION]
    validated = validate or [scenario_file(name) for name in command.LATER_SESSIONS]
    return command.tune(config, trained, validated, seeds, command.Budget(generations, population, seed), out)


@app.command()
def bench(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="One benchmark; without: all")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print JSON instead of a table")] = False,
    seeds: Annotated[int, typer.Option(min=1, help="Cars that stops and observers draw")] = 20,
    seconds: Annotated[float, typer.Option(min=5.0, max=580.0, help="Of lateness and play")] = 60.0,
    draw: Annotated[
        str, typer.Option(metavar="WIDTH", help="Cars of stops and observers: wide, nominal")
    ] = "wide",
) -> int:
    """Times of step, codec and cycle on this machine; accuracy over drawn cars."""
    from brakelab.bench import command

    return command.bench(name, json, seeds, seconds, draw)
