"""Benchmarks (`brake-ecu bench`), measured on this machine beside alternatives."""

from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from typing import Final

from brakelab.bench.observer_times import step_times
from brakelab.bench.times import BENCHES, run_times
from brakelab.entries.command import ENTRIES, NOBODY, Entered, bench_entries
from brakelab.results.chart import write_chart
from brakelab.results.progress import tracked
from brakelab.studies import (
    ablation,
    bound,
    compensation,
    compensation_picture,
    compensation_table,
    identified,
    margins,
    recorded,
)
from brakelab.studies import stops as stops_bench
from brakelab.studies.blending import blending_tables
from brakelab.studies.cars import each_car
from brakelab.studies.energy import energy_tables
from brakelab.studies.failures import failure_tables
from brakelab.studies.friction import friction_tables
from brakelab.studies.lies import all_cells
from brakelab.studies.lies_table import lie_tables
from brakelab.studies.measure import NOT_INSTALLED, machine
from brakelab.studies.observers import WIDE, Sample, Task, observer_rows, tasks
from brakelab.studies.observers_cases import configured
from brakelab.studies.observers_picture import PICTURED, consistency_of, write_picture
from brakelab.studies.observers_table import finite, observer_tables
from brakelab.studies.output import PICTURES, plain_row, print_tables, results_page, write_page
from brakelab.studies.table import stop_tables
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
from ecu import __version__
from ecu.errors import UserError
from ecu.output import give, say
from ecu.settings.config import Config, config_hash, load_config
from ecu.settings.resources import resource

STOPS: Final = "stops"
OBSERVERS: Final = "observers"
ABLATION: Final = "ablation"
BOUND: Final = "bound"
FRICTION: Final = "friction"
LAB: Final = "lab"
ENERGY: Final = "energy"
BLENDING: Final = "blending"
FAILURES: Final = "failures"
LIES: Final = "lies"
COMPENSATION: Final = "compensation"
MARGINS: Final = "margins"
LATENESS, RECORDED, VEHICLE, WEAR, DUST = "lateness", "recorded", "vehicle", "wear", "dust"
SOUND: Final = 6
"""Sound cars that `lies` drives for false alarms."""
THERMAL, BLOCKS, CYCLES, REPLAY, PLAY = "thermal", "blocks", "cycles", "replay", "play"


def bench(
    name: str | None,
    json: bool,
    seeds: int = 20,
    seconds: float = 60.0,
    draw: str = WIDE,
    who: Entered = NOBODY,
) -> int:
    """Run one bench, or without a name all that measure time; print tables, or JSON. Returns 0.

    In a checkout, a run of all times renews docs/results/benchmarks.md, `stops` observer-accuracy.md beside
    it, each other bench the page of its name; `play` keeps the tables of other buses. `seeds`: number of cars
    drawn by `stops` and `observers`, upper bound for the others; `draw`: width of the draw of `stops` and
    `observers`, pages use the wide one; `seconds`: duration of the drive of `lateness`, and of all players of
    `play`; `who`: what `entries` is told.

    Raises:
        UserError: there is no such bench.
    """
    others: dict[str, Callable[[bool], int]] = {
        STOPS: partial(_stops, seeds=seeds, draw=draw),
        OBSERVERS: partial(_observers, seeds=seeds, draw=draw),
        ENTRIES: partial(bench_entries, seeds=seeds, entered=who),
        ABLATION: partial(_ablation, seeds=seeds),
        BOUND: partial(_bound, seeds=seeds),
        FRICTION: _friction,
        LAB: _lab,
        ENERGY: _energy,
        COMPENSATION: _compensation,
        MARGINS: _margins,
        BLENDING: _blending,
        FAILURES: _failures,
        LIES: partial(_lies, seeds=seeds),
        RECORDED: partial(_recorded, seeds=seeds),
        VEHICLE: partial(_vehicle, seeds=seeds),
        WEAR: partial(_wear, seeds=seeds),
        DUST: partial(_dust, seeds=seeds),
        THERMAL: partial(_thermal, seeds=seeds),
        BLOCKS: partial(_blocks, seeds=seeds),
        CYCLES: _cycles,
        LATENESS: partial(_lateness, seconds=seconds),
        REPLAY: _replay,
        PLAY: partial(_play, seconds=seconds),
    }
    if name is not None and name not in (*BENCHES, *others):
        raise UserError("bench", name, f"no such bench; choose one of {', '.join((*BENCHES, *others))}")
    return others[name](json) if name in others else run_times(name, json)


def _stops(json: bool, seeds: int, draw: str) -> int:
    path = resource("config/suv.toml")
    config = load_config(path)
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:

        def all_cores(
            drive: stops_bench.Case, cases: list[stops_bench.Named]
        ) -> Iterable[stops_bench.Result]:
            results = pool.map(drive, cases)
            return tracked(results, "stops", len(cases))

        result = stops_bench.stops(config, seeds, spread=all_cores, draw=draw)
    of = _of(path.name, config, draw, seeds)
    if json:
        plain = {key: [plain_row(row) for row in rows] for key, rows in result._asdict().items()}
        give(of=of, **plain)
        return 0
    tables = stop_tables(result, seeds)
    print_tables(of, tables)
    text = f"`brake-ecu bench stops`, {of}. {STOPS_TEXT}"
    if draw == WIDE:
        write_page("observer-accuracy.md", "Accuracy of the friction and of the compensation", text, tables)
    return 0


def _of(name: str, config: Config, draw: str, seeds: int) -> str:
    measured = f"version {__version__}, config/{name} ({config_hash(config)[:12]})"
    return f"{measured}, {draw} draw, seeds 0–{seeds - 1}"


def _observers(json: bool, seeds: int, draw: str) -> int:
    todo = tasks(seeds, draw)
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:

        def all_cores(drive: Callable[[Task], list[Sample]], cars: list[Task]) -> Iterable[list[Sample]]:
            return tracked(pool.map(drive, cars), OBSERVERS, len(cars))

        rows = observer_rows(todo, all_cores)
        consistency = list(pool.map(consistency_of, range(min(seeds, PICTURED))))
    times = step_times()
    of = _of("suv.toml", configured(), draw, seeds)
    if json:
        plain = {name: value._asdict() for name, value in times.items()}
        give(**finite({"of": of, "rows": [plain_row(row) for row in rows], "step_us": plain}))
        return 0
    tables = observer_tables(rows, times, consistency, draw)
    print_tables(of, tables)
    if draw != WIDE:
        return 0
    text = f"`brake-ecu bench observers`, {of}. {machine()}. {OBSERVERS_TEXT}"
    write_page("observers.md", "The observers beside their goals", text, tables)
    write_picture(resource(PICTURES) / "observers.svg", consistency)
    return 0


def _ablation(json: bool, seeds: int) -> int:
    cars = each_car(ABLATION, ablation.samples_of, min(seeds, ablation.CARS))
    table = ablation.ablation_table(cars)
    return results_page(ABLATION, "What carries the joint observer", ABLATION_TEXT, [table], json)


def _bound(json: bool, seeds: int) -> int:
    table = bound.bound_table(each_car(BOUND, bound.bounds_of, min(seeds, bound.CARS)))
    return results_page(BOUND, "What the sensors allow", BOUND_TEXT, [table], json)


def _recorded(json: bool, seeds: int) -> int:
    table = recorded.recorded_table(each_car(RECORDED, recorded.recorded_of, min(seeds, recorded.CARS)))
    return results_page(
        RECORDED, "Cars as loggers record them", RECORDED_TEXT, [table], json, "recorded-cars"
    )


def _vehicle(json: bool, seeds: int) -> int:
    cars = each_car(VEHICLE, identified.identified_of, min(seeds, identified.CARS))
    tables = identified.identified_tables(cars)
    return results_page(
        VEHICLE, "Cars identified from a drive", VEHICLE_TEXT, tables, json, "identified-cars"
    )


def _wear(json: bool, seeds: int) -> int:
    from brakelab.studies import wear, wear_drives, wear_study

    cars = each_car(WEAR, wear_drives.drive_car, min(seeds, wear.CARS))
    laws = wear_study.dynamometer_laws()
    lives = wear.wear_lives(cars, laws)
    if not json:
        picture = resource(PICTURES) / "wear.svg"
        write_chart(picture, wear.wear_panels(lives, len(cars)), wear.LEGEND)
    return results_page(WEAR, "Wear", WEAR_TEXT, wear.wear_tables(cars, laws, lives), json)


def _dust(json: bool, seeds: int) -> int:
    from brakelab.studies import dust

    picture = None if json else resource(PICTURES) / "dust.svg"
    tables = dust.dust_page(partial(each_car, DUST), min(seeds, dust.DRAWS), picture)
    return results_page(DUST, "Dust", DUST_TEXT, tables, json)


def _thermal(json: bool, seeds: int) -> int:
    from brakelab.studies import thermal, thermal_study

    cars = each_car(THERMAL, thermal_study.drive_car, min(seeds, thermal.CARS))
    if not json:
        write_chart(resource(PICTURES) / "disc-temperature.svg", thermal.thermal_panels(cars), thermal.LEGEND)
    tables = thermal.thermal_tables(cars)
    return results_page(THERMAL, "Disc temperature", THERMAL_TEXT, tables, json, "disc-temperature")


def _blocks(json: bool, seeds: int) -> int:
    from brakelab.studies import blocks

    tables, panels = blocks.blocks_page(min(seeds, blocks.CARS))
    if not json:
        write_chart(resource(PICTURES) / "blocks.svg", panels, blocks.LEGEND)
    return results_page(BLOCKS, "Road blocks on the dynamometer", BLOCKS_TEXT, tables, json)


def _cycles(json: bool) -> int:
    from brakelab.studies.cycles import cycles_page

    tables = cycles_page(partial(each_car, CYCLES))
    return results_page(CYCLES, "Dust and wear over two cycles", CYCLES_TEXT, tables, json)


def _friction(json: bool) -> int:
    return results_page(
        FRICTION, "Friction laws, disc and brake unit", FRICTION_TEXT, friction_tables(), json
    )


def _lab(json: bool) -> int:
    from brakelab.studies.lab_pictures import write_pictures
    from brakelab.studies.lab_run import run_lab
    from brakelab.studies.lab_table import lab_tables
    from brakelab.studies.lab_text import LAB_TEXT

    lab = run_lab(say)
    if not json:
        write_pictures(resource(PICTURES), lab)
    return results_page(LAB, "The friction laboratory", LAB_TEXT, lab_tables(lab), json, "friction-lab")


def _energy(json: bool) -> int:
    tables = energy_tables(resource("config/scenarios"), load_config(resource("config/suv.toml")))
    return results_page(ENERGY, "Where the energy goes", ENERGY_TEXT, tables, json)


def _compensation(json: bool) -> int:
    config = load_config(resource("config/suv.toml"))
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        cars = compensation.drive_cars(config, spread=pool.map)
    tables = compensation_table.compensation_tables(cars)
    if not json:
        picture = resource(PICTURES) / "compensation.svg"
        write_chart(picture, compensation_picture.pictured(config), compensation_picture.LEGEND)
    return results_page(COMPENSATION, "What compensation is worth", COMPENSATION_TEXT, tables, json)


def _margins(json: bool) -> int:
    config = load_config(resource("config/suv.toml"))
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        cars = margins.measure_cars(config, spread=pool.map)
    if not json:
        picture = resource(PICTURES) / "control-margins.svg"
        write_chart(picture, margins.margin_panels(cars), margins.LEGEND)
    tables = margins.margin_tables(cars)
    return results_page(MARGINS, "Margins of the control loop", MARGINS_TEXT, tables, json, "control-margins")


def _blending(json: bool) -> int:
    return results_page(BLENDING, "Motors and linings brake together", BLENDING_TEXT, blending_tables(), json)


def _failures(json: bool) -> int:
    return results_page(FAILURES, "Brakes that fail", FAILURES_TEXT, failure_tables(), json)


def _lies(json: bool, seeds: int) -> int:
    tables = lie_tables(all_cells(), min(seeds, SOUND))
    return results_page(LIES, "Inputs that lie", LIES_TEXT, tables, json)


def _lateness(json: bool, seconds: float) -> int:
    from brakelab.bench.lateness import lateness_tables

    text = f"{machine()}. {LATENESS_TEXT}"
    return results_page(LATENESS, "Lateness under load", text, lateness_tables(seconds), json)


def _replay(json: bool) -> int:
    try:
        from brakelab.bench.replay import replay_tables
    except ImportError:
        raise UserError("bench", REPLAY, NOT_INSTALLED.format("asammdf")) from None
    return results_page(
        REPLAY, "Speed of replay", f"{machine()}. {REPLAY_TEXT}", replay_tables(), json, "replay-speed"
    )


def _play(json: bool, seconds: float) -> int:
    from brakelab.bench.play import play_tables

    return results_page(PLAY, "How late frames are played", PLAY_TEXT, play_tables(seconds), json, keep=True)
