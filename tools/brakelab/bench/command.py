"""Benchmarks (`brake-ecu bench`), measured on this machine beside alternatives."""

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Final, NamedTuple

from brakelab.bench.observer_times import step_times
from brakelab.bench.times import BENCHES, run_times
from brakelab.results.chart import Panel, write_chart
from brakelab.results.progress import tracked
from brakelab.studies.accuracy import ablation, bound, recorded, vehicle
from brakelab.studies.accuracy import stops as stops_bench
from brakelab.studies.accuracy.observers import WIDE, Sample, Task, observer_rows, tasks
from brakelab.studies.accuracy.observers_cases import configured
from brakelab.studies.accuracy.observers_picture import PICTURED, consistency_of, write_picture
from brakelab.studies.accuracy.observers_table import finite, observer_tables
from brakelab.studies.accuracy.table import stop_tables
from brakelab.studies.cars import each_car
from brakelab.studies.control import compensation, compensation_picture, compensation_table, margins
from brakelab.studies.control.blending import blending_tables
from brakelab.studies.control.failures import failure_tables
from brakelab.studies.entries.command import ENTRIES, NOBODY, TEXT, Entered, export_entries, measure_entries
from brakelab.studies.lab.text import LAB_TEXT
from brakelab.studies.lies import all_cells
from brakelab.studies.lies_table import lie_tables
from brakelab.studies.measure import NOT_INSTALLED, machine
from brakelab.studies.output import RESULTS, Measured, Page, plain_row, show_measured
from brakelab.studies.physics.energy import energy_tables
from brakelab.studies.physics.friction import friction_tables
from brakelab.studies.texts import (
    ABLATION_TEXT,
    BLENDING_TEXT,
    BLOCKS_TEXT,
    BOUND_TEXT,
    COMPENSATION_TEXT,
    CYCLES_TEXT,
    DUST_TEXT,
    ENERGY_TEXT,
    FAILURES_TEXT,
    FRICTION_TEXT,
    LATENESS_TEXT,
    LIES_TEXT,
    MARGINS_TEXT,
    OBSERVERS_TEXT,
    PLAY_TEXT,
    RECORDED_TEXT,
    REPLAY_TEXT,
    STOPS_TEXT,
    THERMAL_TEXT,
    VEHICLE_TEXT,
    WEAR_TEXT,
)
from ecu.errors import UserError
from ecu.output import say
from ecu.settings.config import Config, config_hash, load_config
from ecu.settings.resources import resource

SOUND: Final = 6
"""Sound cars that `lies` drives for false alarms."""


class Asked(NamedTuple):
    """Options of the command line."""

    seeds: int = 20
    """Number of cars drawn by `stops` and `observers`, upper bound for the others."""
    seconds: float = 60.0
    """Duration of the drive of `lateness`, and of all players of `play`."""
    draw: str = WIDE
    """Width of the draw of `stops` and `observers`; pages are of the wide one."""
    entered: Entered = NOBODY


UNASKED: Final = Asked()


def bench(name: str | None, asked: Asked = UNASKED, write: bool = False) -> int:
    """Run one bench, or without a name all that measure time; print tables, or JSON. Returns 0.

    With `write` the page in docs/results of the checkout is renewed; `play` keeps the tables of other buses.

    Raises:
        UserError: there is no such bench, or `write` where there is no page.
    """
    if name is not None and name not in (*BENCHES, *STUDIES):
        raise UserError("bench", name, f"no such bench; choose one of {', '.join((*BENCHES, *STUDIES))}")
    if write:
        _check_page(name, asked)
    if name == ENTRIES and asked.entered.export is not None:
        return export_entries(asked.entered.export, asked.seeds)
    if name in STUDIES:
        page, run = STUDIES[name]
        show_measured(f"bench {name}", page, run(asked), write)
    else:
        show_measured("bench", Page("Times", file="benchmarks"), run_times(name), write)
    return 0


def _check_page(name: str | None, asked: Asked) -> None:
    if name in BENCHES:
        raise UserError("--write", name or "", "has no page of its own; `bench --write` measures all times")
    if asked.draw != WIDE:
        raise UserError("--write", asked.draw, "pages are of the wide draw; leave out --draw")
    if asked.entered != NOBODY:
        raise UserError("--write", ENTRIES, "leave out --observer, --drive and --export: the page is of ours")
    if not resource(RESULTS).is_dir():
        raise UserError("--write", RESULTS, "no such folder; run it in a checkout")


def _picture(file: str, panels: list[Panel], legend: Sequence[tuple[str, str]]) -> Callable[[Path], None]:
    return lambda folder: write_chart(folder / file, panels, legend)


def _stops(asked: Asked) -> Measured:
    path = resource("config/suv.toml")
    config = load_config(path)
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:

        def all_cores(
            drive: stops_bench.Case, cases: list[stops_bench.Named]
        ) -> Iterable[stops_bench.Result]:
            results = pool.map(drive, cases)
            return tracked(results, "stops", len(cases))

        result = stops_bench.stops(config, asked.seeds, spread=all_cores, draw=asked.draw)
    plain = {key: [plain_row(row) for row in rows] for key, rows in result._asdict().items()}
    return Measured(stop_tables(result, asked.seeds), _of(path.name, config, asked), plain)


def _of(name: str, config: Config, asked: Asked) -> str:
    draw = f"{asked.draw} draw, seeds 0–{asked.seeds - 1}"
    return f", config/{name} ({config_hash(config)[:12]}), {draw}"


def _observers(asked: Asked) -> Measured:
    seeds, todo = asked.seeds, tasks(asked.seeds, asked.draw)
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:

        def all_cores(drive: Callable[[Task], list[Sample]], cars: list[Task]) -> Iterable[list[Sample]]:
            return tracked(pool.map(drive, cars), "observers", len(cars))

        rows = observer_rows(todo, all_cores)
        consistency = list(pool.map(consistency_of, range(min(seeds, PICTURED))))
    times = step_times()
    step_us = {name: value._asdict() for name, value in times.items()}
    return Measured(
        observer_tables(rows, times, consistency, asked.draw),
        f"{_of('suv.toml', configured(), asked)}. {machine()}",
        finite({"rows": [plain_row(row) for row in rows], "step_us": step_us}),
        lambda folder: write_picture(folder / "observers.svg", consistency),
    )


def _entries(asked: Asked) -> Measured:
    return measure_entries(asked.seeds, asked.entered)


def _ablation(asked: Asked) -> Measured:
    cars = each_car("ablation", ablation.samples_of, min(asked.seeds, ablation.CARS))
    return Measured([ablation.ablation_table(cars)])


def _bound(asked: Asked) -> Measured:
    return Measured([bound.bound_table(each_car("bound", bound.bounds_of, min(asked.seeds, bound.CARS)))])


def _recorded(asked: Asked) -> Measured:
    cars = each_car("recorded", recorded.recorded_of, min(asked.seeds, recorded.CARS))
    return Measured([recorded.recorded_table(cars)])


def _vehicle(asked: Asked) -> Measured:
    cars = each_car("vehicle", vehicle.identified_of, min(asked.seeds, vehicle.CARS))
    return Measured(vehicle.identified_tables(cars))


def _wear(asked: Asked) -> Measured:
    from brakelab.studies.wear import drives, study, wear

    cars = each_car("wear", drives.drive_car, min(asked.seeds, wear.CARS))
    laws = study.dynamometer_laws()
    lives = wear.wear_lives(cars, laws)
    picture = _picture("wear.svg", wear.wear_panels(lives, len(cars)), wear.LEGEND)
    return Measured(wear.wear_tables(cars, laws, lives), draw=picture)


def _dust(asked: Asked) -> Measured:
    from brakelab.identify.dust.page import LEGEND
    from brakelab.studies.dust import dust

    tables, panels = dust.dust_page(partial(each_car, "dust"), min(asked.seeds, dust.DRAWS))
    return Measured(tables, draw=_picture("dust.svg", panels, LEGEND))


def _thermal(asked: Asked) -> Measured:
    from brakelab.studies.thermal import study, thermal

    cars = each_car("thermal", study.drive_car, min(asked.seeds, thermal.CARS))
    picture = _picture("disc-temperature.svg", thermal.thermal_panels(cars), thermal.LEGEND)
    return Measured(thermal.thermal_tables(cars), draw=picture)


def _blocks(asked: Asked) -> Measured:
    from brakelab.studies.wear import blocks

    tables, panels = blocks.blocks_page(min(asked.seeds, blocks.CARS))
    return Measured(tables, draw=_picture("blocks.svg", panels, blocks.LEGEND))


def _cycles(asked: Asked) -> Measured:
    from brakelab.studies.dust.cycles import cycles_page

    return Measured(cycles_page(partial(each_car, "cycles")))


def _friction(asked: Asked) -> Measured:
    return Measured(friction_tables())


def _lab(asked: Asked) -> Measured:
    from brakelab.studies.lab.pictures import write_pictures
    from brakelab.studies.lab.run import run_lab
    from brakelab.studies.lab.tables import lab_tables

    lab = run_lab(say)
    return Measured(lab_tables(lab), draw=lambda folder: write_pictures(folder, lab))


def _energy(asked: Asked) -> Measured:
    config = load_config(resource("config/suv.toml"))
    return Measured(energy_tables(resource("config/scenarios"), config))


def _compensation(asked: Asked) -> Measured:
    config = load_config(resource("config/suv.toml"))
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        cars = compensation.drive_cars(config, spread=pool.map)

    def draw(folder: Path) -> None:
        panels = compensation_picture.pictured(config)
        write_chart(folder / "compensation.svg", panels, compensation_picture.LEGEND)

    return Measured(compensation_table.compensation_tables(cars), draw=draw)


def _margins(asked: Asked) -> Measured:
    config = load_config(resource("config/suv.toml"))
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        cars = margins.measure_cars(config, spread=pool.map)
    picture = _picture("control-margins.svg", margins.margin_panels(cars), margins.LEGEND)
    return Measured(margins.margin_tables(cars), draw=picture)


def _blending(asked: Asked) -> Measured:
    return Measured(blending_tables())


def _failures(asked: Asked) -> Measured:
    return Measured(failure_tables())


def _lies(asked: Asked) -> Measured:
    return Measured(lie_tables(all_cells(), min(asked.seeds, SOUND)))


def _lateness(asked: Asked) -> Measured:
    from brakelab.bench.lateness import lateness_tables

    return Measured(lateness_tables(asked.seconds), f". {machine()}")


def _replay(asked: Asked) -> Measured:
    try:
        from brakelab.bench.replay import replay_tables
    except ImportError:
        raise UserError("bench", "replay", NOT_INSTALLED.format("asammdf")) from None
    return Measured(replay_tables(), f". {machine()}")


def _play(asked: Asked) -> Measured:
    from brakelab.bench.play import play_tables

    return Measured(play_tables(asked.seconds))


STUDIES: Final[dict[str, tuple[Page, Callable[[Asked], Measured]]]] = {
    "stops": (
        Page("Accuracy of the friction and of the compensation", STOPS_TEXT, "observer-accuracy"),
        _stops,
    ),
    "observers": (Page("The observers beside their goals", OBSERVERS_TEXT), _observers),
    ENTRIES: (Page("Friction observers, side by side", TEXT), _entries),
    "ablation": (Page("What carries the joint observer", ABLATION_TEXT), _ablation),
    "bound": (Page("What the sensors allow", BOUND_TEXT), _bound),
    "friction": (Page("Friction laws, disc and brake unit", FRICTION_TEXT), _friction),
    "lab": (Page("The friction laboratory", LAB_TEXT, "friction-lab"), _lab),
    "energy": (Page("Where the energy goes", ENERGY_TEXT), _energy),
    "compensation": (Page("What compensation is worth", COMPENSATION_TEXT), _compensation),
    "margins": (Page("Margins of the control loop", MARGINS_TEXT, "control-margins"), _margins),
    "blending": (Page("Motors and linings brake together", BLENDING_TEXT), _blending),
    "failures": (Page("Brakes that fail", FAILURES_TEXT), _failures),
    "lies": (Page("Inputs that lie", LIES_TEXT), _lies),
    "recorded": (Page("Cars as loggers record them", RECORDED_TEXT, "recorded-cars"), _recorded),
    "vehicle": (Page("Cars identified from a drive", VEHICLE_TEXT, "identified-cars"), _vehicle),
    "wear": (Page("Wear", WEAR_TEXT), _wear),
    "dust": (Page("Dust", DUST_TEXT), _dust),
    "thermal": (Page("Disc temperature", THERMAL_TEXT, "disc-temperature"), _thermal),
    "blocks": (Page("Road blocks on the dynamometer", BLOCKS_TEXT), _blocks),
    "cycles": (Page("Dust and wear over two cycles", CYCLES_TEXT), _cycles),
    "lateness": (Page("Lateness under load", LATENESS_TEXT), _lateness),
    "replay": (Page("Speed of replay", REPLAY_TEXT, "replay-speed"), _replay),
    "play": (Page("How late frames are played", PLAY_TEXT, keep=True), _play),
}
"""Studies and benches with a page each, and what runs them."""
