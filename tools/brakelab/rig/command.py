"""`brake-ecu rig SCENARIO… --config CONFIG`: tables of scenarios against the ECU, in real time or in memory.

In real time the daemon and the vehicle are processes on a bus; with `--lock-step` both run in one loop in
memory as fast as it goes. Per scenario a folder with results, truth, frames and report; over all of them
`rig.html`, `scenarios.parquet` and `faults.parquet`.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from brakelab.report.command import report
from brakelab.report.drive import Drive
from brakelab.results.console import new_console
from brakelab.rig.live import Bus, choose_bus, drive, make_folder, named_bus
from brakelab.rig.outcome import Outcome, Undisturbed, outcome, stopping_distance
from brakelab.rig.page import by_the_car, summary, write_page, write_tables
from brakelab.rig.results import write_recorded, write_simulated
from brakelab.rig.vehicle_node import warm_up
from brakelab.simulation.closed_loop import new_loop, run
from brakelab.simulation.scenario import Scenario, load_scenario
from brakelab.simulation.scenario_car import other_car, with_plant_for
from ecu.compiling import compiling_told
from ecu.contract.faults import fault_mask, fault_names
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
) -> int:
    """Run every scenario; return 0, or 1 if one showed a fault bit that nothing of it accounts for.

    `bus`: interface and channel, None: the best available. `plant`: the car's file or name, "as-config",
    None: each scenario's. 1 also if that is another car than `config` describes.

    Raises:
        UserError: a scenario, the configuration or the bus is invalid, or `out` cannot be written.
        RunFault: a daemon or the vehicle ended early.
    """
    shipped = [(path, load_scenario(path)) for path in found(names)]
    vehicle = load_config(config)
    make_folder(out)
    scenarios = [(path, with_plant_for(one, plant, vehicle, out / "plant")) for path, one in shipped]
    others = sorted({other_car(scenario, vehicle) for _, scenario in scenarios} - {""})
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
        with compiling_told():
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
    write_tables(outcomes, out)
    page = out / "rig.html"
    cars = ", ".join(sorted({Path(scenario.plant).stem for _, scenario in scenarios}))
    page.write_text(write_page(outcomes, meeting, vehicle, cars, seed), "utf-8")
    say(f"report: {page.resolve()}")
    give(written=[page, out / "scenarios.parquet", out / "faults.parquet"])
    return int(bool(others) or any(result.unexplained or result.differing for result in outcomes))


def _undisturbed(scenario: Scenario, vehicle: Config, seed: int) -> Undisturbed:
    """Return the same drive without the scenario's faults."""
    if not scenario.fault:
        return Undisturbed(math.nan, frozenset())
    sound = run(new_loop(scenario.model_copy(update={"fault": []}), vehicle, seed))
    mask = int(np.bitwise_or.reduce(fault_mask(sound.outputs)))
    return Undisturbed(stopping_distance(Drive(sound.t, sound.truth, {})), frozenset(fault_names(mask)))


def _in_memory(name: str, scenario: Scenario, vehicle: Config, folder: Path, seed: int) -> Outcome:
    loop = new_loop(scenario, vehicle, seed)
    written = write_simulated(loop, run(loop), vehicle, folder)
    truth = folder / "truth.parquet"
    report(written.result, truth, folder / "report.html")
    return outcome(name, written, truth, scenario.fault, vehicle, _undisturbed(scenario, vehicle, seed), [])


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
    undisturbed = _undisturbed(scenario, vehicle, seed)
    return outcome(
        path.stem, written, recorded.truth, scenario.fault, vehicle, undisturbed, recorded.recordings
    )
