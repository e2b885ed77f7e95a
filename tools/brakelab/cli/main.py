"""Commands of the laboratory: each imports what it needs when it is called, so that the daemon starts
without it."""

from pathlib import Path
from typing import Annotated

from typer import Option

from brakelab.cli.arguments import Plant, Scenario, Seed, present, working
from brakelab.cli.bench import HELP as BENCH_HELP
from brakelab.cli.bench import bench
from brakelab.cli.dynamometer import app as lab_app
from brakelab.cli.fmu import app as fmu_app
from brakelab.cli.identify import app as identify_app
from brakelab.cli.maps import app as map_app
from ecu.arguments import (
    CHANNEL_OPTION,
    CONFIG_OPTION,
    INTERFACE_OPTION,
    Channel,
    Commands,
    Config,
    Draw,
    Interface,
    Map,
    Observer,
    State,
    argument,
    config_file,
    flag,
    option,
    scenario_file,
)
from ecu.commands.config import app as config_app
from ecu.completion import fitting, known, shipped
from ecu.errors import UserError
from ecu.output import wrote
from ecu.settings.resources import SCENARIOS, resource

app = Commands()
app.add_typer(lab_app, name="lab")
app.add_typer(identify_app, name="identify")
app.add_typer(fmu_app, name="fmu")
app.add_typer(map_app, name="map")


def scenarios_and_folders(incomplete: str) -> list[str]:
    """Return shipped scenarios, files, and shipped folders of scenarios that begin like that."""
    folders = sorted(path.name for path in resource(SCENARIOS[0]).iterdir() if path.is_dir())
    return fitting(folders, incomplete) + shipped(*SCENARIOS)(incomplete)


@app.command()
def demo(
    out: Annotated[Path, option("DIR", "Folder to write recording and report into")] = Path("out/demo"),
) -> None:
    """Brake a simulated car in real time and write a report."""
    from brakelab.rig import demo

    demo.demo(out)


@app.command()
def simulate(
    scenario: Scenario,
    config: Config,
    out: Annotated[Path, option("NAME", "Write NAME.log, NAME.parquet, NAME.truth.parquet")],
    seed: Seed = 0,
    draw: Draw = None,
    plant: Plant = None,
) -> int:
    """Simulate a scenario in closed loop. Write frames, inputs, true values. Exit code 1: it failed."""
    from brakelab.simulation import simulate

    driven = simulate.simulate(scenario, config, out, seed, draw, plant)
    if not driven.scenario.expect:
        return 0
    from brakelab.rig.simulated import judge_simulated

    return judge_simulated(driven, seed)


@config_app.command("plant")
def config_plant(
    config: Annotated[Path, argument("CONFIG", "Vehicle: file or name", parser=config_file)],
    out: Annotated[Path, option("PLANT.toml", "File to write, linings.toml beside it")],
    like: Annotated[
        str,
        option(
            "PLANT",
            "Car that has what CONFIG does not know",
            autocompletion=known("suv", "suv14", "sedan", "lcv"),
        ),
    ] = "suv",
) -> None:
    """Write the simulated car of a configuration, for --plant."""
    from brakelab.simulation.plant_of_config import plant_command

    plant_command(config, like, out)


@app.command()
def vehicle(
    scenario: Scenario,
    interface: Interface,
    channel: Channel,
    seed: Seed = 0,
    plant: Plant = None,
    config: Annotated[Path | None, CONFIG_OPTION] = None,
    truth: Annotated[Path | None, option("FILE.parquet", "True values of the drive, to write")] = None,
    alone: Annotated[bool, flag("--alone", "Set off at once, without waiting for an ECU")] = False,
    by_hand: Annotated[bool, flag("--by-hand", "Take faults from standard input: lost message=Imu")] = False,
    bus_goes_off: Annotated[bool, Option("--bus-goes-off", hidden=True)] = False,
) -> None:
    """Drive the simulated car of a scenario alone on a bus.

    It sets off when it hears an ECU, which you start, and leaves when that falls silent. CONFIG is the car
    of --plant as-config."""
    from brakelab.rig import vehicle_node

    bus = interface, channel
    vehicle_node.vehicle_command(scenario, bus, seed, plant, config, truth, alone, by_hand, bus_goes_off)


@app.command()
def rig(
    scenario: Annotated[
        list[str],
        argument(
            "SCENARIO",
            "Scenario files, folders of them, or shipped names: faults, …",
            autocompletion=scenarios_and_folders,
        ),
    ],
    config: Config,
    interface: Annotated[str | None, INTERFACE_OPTION] = None,
    channel: Annotated[str | None, CHANNEL_OPTION] = None,
    out: Annotated[Path, option("DIR", "Folder to write results and reports into")] = Path("out/rig"),
    lock_step: Annotated[
        bool, flag("--lock-step", "Run in memory, as fast as possible, instead of on a bus")
    ] = False,
    seed: Seed = 0,
    plant: Plant = None,
    junit: Annotated[Path | None, option("FILE.xml", "Write the verdicts as JUnit XML")] = None,
    vary: Annotated[
        list[str] | None,
        option(
            "NAME=LOW..HIGH|A,B,C",
            "Drive many cars: a parameter drawn from a range, or from a list; several: repeat",
        ),
    ] = None,
    runs: Annotated[int | None, option("N", "With --vary: draws from the ranges (50)", min=1)] = None,
) -> int:
    """Test the ECU in scenarios with faults. Write one report. Exit code 1: a scenario failed."""
    from brakelab.rig import command

    if (interface is None) != (channel is None):
        raise UserError("-i, -c", "", "give both or none; none: a bus of its own on this machine")
    bus = None if interface is None or channel is None else (interface, channel)
    if bus and lock_step:
        raise UserError("-i, -c", "", "--lock-step drives in memory; leave one out")
    if vary:
        from brakelab.rig import vary as many

        if not lock_step:
            raise UserError("--vary", "", "drives in memory; add --lock-step")
        spans = [many.span(one) for one in vary]
        return many.vary(command.found(scenario), config, out, spans, runs, seed, plant, junit)
    if runs is not None:
        raise UserError("--runs", str(runs), "draws from the ranges of --vary; give one")
    return command.rig(scenario, config, bus, out, lock_step, seed, plant, junit)


@app.command()
def replay(
    logs: Annotated[
        list[Path],
        argument(
            "LOG",
            "Logs of one drive, in order: frames (.log .asc .blf .trc .mf4) or signals (.mf4 .parquet .csv)",
        ),
    ],
    config: Config,
    out: Annotated[Path, option("RESULT.parquet", "Results to write, a row per 10 ms: .parquet .mf4 .mcap")],
    map: Map = None,
    observer: Observer = None,
    state: State = None,
    cycles: Annotated[
        Path | None, option("RECORDING", "Repeat the cycles of this recording of `run --record` to the bit")
    ] = None,
    force: Annotated[bool, flag("--force", "Learn friction although physics contradicts the log")] = False,
    stood: Annotated[
        float | None, option("HOURS", "Time the car stood before, discs cooling", min=0.0)
    ] = None,
) -> None:
    """Replay a recorded drive through the ECU. Write results."""
    from brakelab.replay import command

    command.replay(logs, config, map, observer, state, out, cycles, force, stood)


@app.command()
def play(
    log: Annotated[
        Path,
        argument(
            "LOG",
            "Log of frames (.log .asc .blf .trc .mf4) or signals (.mf4 .parquet .csv)",
            callback=present,
        ),
    ],
    interface: Interface,
    channel: Channel,
    map: Map = None,
    speed: Annotated[float, option("X", "Speed over real time, 0.1 to 20")] = 1.0,
) -> int:
    """Play a recorded drive onto a CAN bus. With MAP, send frames of the ECU with fresh E2E."""
    from brakelab.rig.play import command as play

    return play.play(log, interface, channel, map, speed)


@app.command()
def report(
    result: Annotated[Path, argument("RESULT.parquet", "Results of `replay`")],
    out: Annotated[Path, option("REPORT.html", "Page to write, self-contained")],
    truth: Annotated[Path | None, option("TRUTH.parquet", "True values of a simulated drive")] = None,
    timing: Annotated[
        Path | None, option("RECORDING", "Recording of `run --record`, to show times of its loop")
    ] = None,
) -> None:
    """Write results as a page of linked figures."""
    from brakelab.report import command

    with working("report"):
        command.report(result, truth, out, timing)
    wrote(out)


@app.command()
def fleet(
    logs: Annotated[
        list[str],
        argument("GLOB|MANIFEST", '"data/*/*.log" (a folder per vehicle), or a manifest, .csv or .toml'),
    ],
    out: Annotated[Path, option("DIR", "Folder of tables and report; a stopped run continues here")],
    config: Annotated[Path | None, CONFIG_OPTION] = None,
    map: Map = None,
    observer: Observer = None,
    scheduler: Annotated[
        str | None, option("ADDRESS", "Use this Dask cluster, tls://HOST:PORT; default: local processes")
    ] = None,
    workers: Annotated[
        int | None, option("N", "Number of local processes; default: one per core", min=1)
    ] = None,
    rows: Annotated[bool, flag("--rows", "Keep rows and page of every drive: up to 1 GB per 15 h")] = False,
) -> int:
    """Replay thousands of recorded drives in parallel. Exit code 1: drives failed."""
    from brakelab.fleet import command

    return command.fleet(logs, config, map, observer, scheduler, workers, out, rows)


@app.command()
def compare(
    a: Annotated[Path, argument("A.parquet", "Results of `replay`")],
    b: Annotated[Path, argument("B.parquet", "Results of another version or tuning")],
    out: Annotated[Path | None, option("PAGE.html", "Page of both to write, self-contained")] = None,
) -> int:
    """Compare two results, largest difference first. Exit code 1: a difference matters."""
    with working("compare"):
        from brakelab.results import compare

        if out is not None:
            from brakelab.report.page import check_page

            check_page(out, [a, b])
        found = compare.find(a, b)
    compare.show(found, a, b)
    if out is not None:
        with working("compare"):
            from brakelab.report.comparison import write_page

            write_page(found, a, b, out)
        wrote(out)
    return 1 if found.matter else 0


@app.command()
def tune(
    config: Config,
    scenario: Annotated[
        list[Path] | None,
        option(
            "SCENARIO",
            "Scenario to tune on, repeatable; default: fixed-pedal, bursts",
            parser=scenario_file,
            autocompletion=shipped(*SCENARIOS),
        ),
    ] = None,
    validate: Annotated[
        list[Path] | None,
        option(
            "SCENARIO",
            "Scenario to validate on, repeatable; default: fixed-decel, fade",
            parser=scenario_file,
            autocompletion=shipped(*SCENARIOS),
        ),
    ] = None,
    seeds: Annotated[int, option("N", "Number of drawn cars to tune on; as many to validate", min=1)] = 4,
    generations: Annotated[int, option("G", "Number of generations", min=1)] = 20,
    population: Annotated[int, option("P", "Tunings per generation", min=4)] = 30,
    seed: Annotated[int, option("N", "Seed of the genetic algorithm", min=0)] = 0,
    out: Annotated[Path, option("TUNED.toml", "Tuning to write; a CONFIG can `include` it")] = Path(
        "tuned.toml"
    ),
) -> None:
    """Tune Observer 2 on simulated drives by a genetic algorithm. Ctrl-C writes the best so far."""
    from brakelab.identify.tuning import command

    trained = scenario or [scenario_file(name) for name in command.FIRST_SESSION]
    validated = validate or [scenario_file(name) for name in command.LATER_SESSIONS]
    command.tune(config, trained, validated, seeds, command.Budget(generations, population, seed), out)


app.command(help=BENCH_HELP)(bench)
