"""`brake-ecu rig SCENARIO… --config CONFIG`: tables of scenarios against the ECU, in real time or in memory.

In real time the daemon and the vehicle are processes on a bus; with `--lock-step` both run in one loop in
memory as fast as it goes. Per scenario a folder with results, truth, frames and report; over all of them
`rig.html`, `scenarios.parquet` and `faults.parquet`; with `--junit` the verdicts for a test server.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from brakelab.report.command import report
from brakelab.results.console import new_console
from brakelab.results.outputs import check_outputs, config_files, write_text
from brakelab.rig.junit import junit_text
from brakelab.rig.live import Bus, choose_bus, drive, make_folder, named_bus
from brakelab.rig.outcome import Outcome, of_the_rig, outcome, undisturbed
from brakelab.rig.page import by_the_car, summary, write_page, write_tables
from brakelab.rig.results import write_recorded, write_simulated
from brakelab.rig.vehicle_node import warm_up
from brakelab.simulation.closed_loop import new_loop, run
from brakelab.simulation.scenario import Scenario, load_scenario
from brakelab.simulation.scenario_car import other_car, with_plant_for
from ecu.compiling import report_compiling
from ecu.errors import RunFault, UserError
from ecu.output import fault, give, say
from ecu.settings.config import Config, load_config
from ecu.settings.resources import SCENARIOS, named, resource
from ecu.warm import warm

WIDTH: Final = 150  # columns of the table if the terminal's width is unknown


def found(names: Sequence[str]) -> list[Path]:
    """Return the scenarios of `names`: files, shipped ones by name, and all of a folder (shipped: faults).

    Raises:
        UserError: there is no scenario of that name.
    """
    paths: list[Path] = []
    for name in names:
        folder = next((f for f in (Path(name), resource(SCENARIOS[0]) / name) if f.is_dir()), None)
        paths += [named(name, *SCENARIOS)] if folder is None else sorted(folder.glob("*.toml"))
    twice = {path.stem for path in paths if sum(other.stem == path.stem for other in paths) > 1}
    if twice:
        raise UserError(sorted(twice)[0], "", "named twice; results are kept by name, so name it once")
    if not paths:
        raise UserError(" ".join(names), "", "no scenario in this folder; name one with *.toml files")
    return paths


def rig(
    names: Sequence[str],
    config: Path,
    bus: tuple[str, str] | None,
    out: Path,
    lock_step: bool,
    seed: int,
    plant: str | None = None,
    junit: Path | None = None,
) -> int:
    """Run every scenario; return 0, or 1 if one failed.

    It did if an expectation is not met, if it showed a fault bit that nothing of it accounts for, if replay
    differs, or if its car is another one than `config` describes. `bus`: interface and channel, None: the
    best available. `plant`: the car's file or name, "as-config", None: each scenario's. `junit`: file of the
    verdicts as JUnit XML.

    Raises:
        UserError: a scenario, the configuration or the bus is invalid, or `out` or `junit` cannot be written.
        RunFault: a daemon or the vehicle ended early.
    """
    shipped = [(path, load_scenario(path)) for path in found(names)]
    vehicle = load_config(config)
    if junit is not None:
        read = [path for path, _ in shipped]
        check_outputs(junit, (junit,), [*config_files(config), *read], option="--junit")
    make_folder(out)
    scenarios = [(path, with_plant_for(one, plant, vehicle, out / "plant")) for path, one in shipped]
    cars = {path.stem: other_car(scenario, vehicle) for path, scenario in scenarios}
    others = sorted(set(cars.values()) - {""})
    meeting = None
    if not lock_step:
        meeting = choose_bus() if bus is None else named_bus(*bus)
        if meeting.interface == "virtual":
            raise RunFault(f"two processes cannot meet: {meeting.why}; take --lock-step, or -i and -c")
        say(f"bus: {meeting.why}; compiling what is not in the cache yet")
        warm_up(scenarios[0][1])
        warm()
    outcomes = []
    try:
        with report_compiling():
            for path, scenario in scenarios:
                folder = out / path.stem
                folder.mkdir(exist_ok=True)
                say(f"driving {path.stem}")
                if meeting is None:
                    outcomes.append(_in_memory(path.stem, scenario, vehicle, folder, seed))
                else:
                    driven = _in_real_time(path, scenario, meeting, config, vehicle, folder, seed)
                    outcomes.append(driven)
    finally:
        if meeting is not None:
            meeting.close()
    console = new_console(WIDTH)
    for line in by_the_car(outcomes):
        print(line)
    console.print(summary(outcomes))
    give(scenarios=[{k: v for k, v in one._asdict().items() if k != "curve"} for one in outcomes])
    for line in others:
        fault(f"brake-ecu: {line}")
    give(other_cars=others)
    judged = {one.scenario: [of_the_rig(one, cars[one.scenario]), *one.verdicts] for one in outcomes}
    for one in outcomes:
        for verdict in one.verdicts:
            print(f"{one.scenario}: {verdict.line}")
    write_tables(outcomes, out)
    page = out / "rig.html"
    plants = ", ".join(sorted({Path(scenario.plant).stem for _, scenario in scenarios}))
    page.write_text(write_page(outcomes, meeting, vehicle, plants, seed), "utf-8")
    say(f"report: {page.resolve()}")
    written = [page, out / "scenarios.parquet", out / "faults.parquet"]
    if junit is not None:
        write_text(junit, junit_text(judged), option="--junit")
        written.append(junit)
    give(written=written)
    return int(not all(verdict.passed for verdicts in judged.values() for verdict in verdicts))


def _in_memory(name: str, scenario: Scenario, vehicle: Config, folder: Path, seed: int) -> Outcome:
    loop = new_loop(scenario, vehicle, seed)
    written = write_simulated(loop, run(loop), vehicle, folder)
    truth = folder / "truth.parquet"
    report(written.result, truth, folder / "report.html")
    return outcome(name, written, truth, scenario, vehicle, undisturbed(scenario, vehicle, seed), [])


def _in_real_time(
    path: Path,
    scenario: Scenario,
    bus: Bus,
    config: Path,
    vehicle: Config,
    folder: Path,
    seed: int,
) -> Outcome:
    recorded = drive(bus, path, config, scenario.fault, folder, seed, plant=scenario.plant)
    written = write_recorded(recorded.recordings, vehicle, folder)
    report(written.result, recorded.truth, folder / "report.html", recorded.recordings[0])
    sound = undisturbed(scenario, vehicle, seed)
    return outcome(path.stem, written, recorded.truth, scenario, vehicle, sound, recorded.recordings)
