"""`brake-ecu bench`: measures on this machine, beside what else could do the job."""

import json as json_format
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final, NamedTuple

from rich.console import Console
from rich.progress import track

from brakelab.bench import codec, cycle, plant, step
from brakelab.bench import stops as stops_bench
from brakelab.bench.energy import energy_tables
from brakelab.bench.friction import friction_tables
from brakelab.bench.measure import NOT_INSTALLED, Figure, Row, machine
from brakelab.bench.observers import Sample, Task, observer_rows, step_times, tasks
from brakelab.bench.observers_cases import configured
from brakelab.bench.observers_picture import PICTURED, consistency_of, write_picture
from brakelab.bench.observers_table import finite, observer_tables
from brakelab.bench.table import Table, markdown, show, stop_tables, time_table
from ecu import __version__
from ecu.config import config_hash, load_config
from ecu.errors import UserError
from ecu.resources import resource

STOPS: Final = "stops"
STOPS_TEXT: Final = (
    "Stops from 120 km/h to standstill, Table 4.2 of the thesis: #1 4, #2 7 m/s² on a dry road (1.2), #3 4, "
    "#4 6 m/s² on a wet one (0.7). The car is that of config/plant/suv.toml, drawn per seed; its linings "
    "have 0.85 (front) and 1.10 (rear) of the 0.45 that the ECU is configured with. Nothing was learned "
    "before. Counted from 0.5 s after the demand has its full value, down to 15 km/h."
)

OBSERVERS: Final = "observers"
OBSERVERS_TEXT: Final = (
    "Cars are drawn per seed from config/plant/suv.toml, sensors have the noise of Table 4.1. Cold: the "
    "configuration as it is, nothing learned. Driven in: after ten minutes of "
    "config/scenarios/ordinary.toml in the same car, with what the state store keeps of them. Every "
    "observer closes the loop itself; figures stand for front/rear. Counted while the brakes of both axles "
    "have been on for 0.8 s, above 15 km/h.\n\n"
    "![Error of the friction over 2σ, and the squared innovations](images/observers.svg)"
)

FRICTION: Final = "friction"
FRICTION_TEXT: Final = (
    "What the friction laws of tools/brakelab/plant/friction, the disc and the brake unit of the simulated "
    "vehicle reproduce of the thesis, on the simulated dynamometer. Numbers: config/plant/linings.toml."
)

ENERGY: Final = "energy"
ENERGY_TEXT: Final = (
    "Every scenario of config/scenarios in closed loop with the ECU of config/suv.toml. The simulated "
    "vehicle sums what leaves and enters in its own steps (tools/brakelab/plant/energy.py)."
)


REPLAY: Final = "replay"
REPLAY_TEXT: Final = (
    "One drive of ten minutes in closed loop (config/scenarios/ordinary.toml) as a log of every format, "
    "written by python-can and asammdf."
)


class Bench(NamedTuple):
    """One bench of times."""

    rows: Callable[[], list[Row]]
    title: str
    below: str


BENCHES: Final = {
    "step": Bench(
        step.step_rows,
        "step",
        f"Processor time of a cycle with four wheels, {step.CYCLES} cycles of braking in each of "
        f"{step.ROUNDS} rounds. All filters get the same inputs and give the same friction.",
    ),
    "codec": Bench(
        codec.codec_rows,
        "codec",
        f"Processor time of a message: the 13 protected inputs of the contract, {codec.CYCLES} cycles in "
        f"each of {codec.ROUNDS} rounds. Ours with CRC, counter and (decoding) freshness, the peer without.",
    ),
    "plant": Bench(
        plant.plant_rows,
        "plant",
        f"Time of the simulated vehicle per millisecond of its drive: {plant.STEPS} steps of 1 ms in each of "
        f"{plant.ROUNDS} rounds, braking in a curve on a rough road from 50 m/s. Processor time "
        "unless by the clock.",
    ),
    "cycle": Bench(
        cycle.cycle_rows,
        "cycle",
        f"Time by the clock, {cycle.CYCLES} cycles of 10 ms in each of {cycle.ROUNDS} rounds, in real time "
        "but without real-time rights: 39 frames in, 6 out, over a socket pair that carries can_frames. Ours "
        "is the daemon's cycle; the peer checks nothing and runs the four filters alone.",
    ),
}


def bench(name: str | None, json: bool, seeds: int = 20) -> int:
    """Run one bench, or without a name all that measure time; print tables, or JSON. Returns 0.

    In a checkout, a run of all times renews docs/benchmarks.md, `stops` docs/observer-accuracy.md,
    `observers` docs/observers.md, `friction` docs/friction.md, `energy` docs/energy.md and `replay`
    docs/replay-speed.md. `seeds`: how many
    cars `stops` and `observers` draw.

    Raises:
        UserError: there is no such bench.
    """
    others: dict[str, Callable[[bool], int]] = {
        STOPS: partial(_stops, seeds=seeds),
        OBSERVERS: partial(_observers, seeds=seeds),
        FRICTION: _friction,
        ENERGY: _energy,
        REPLAY: _replay,
    }
    if name is not None and name not in (*BENCHES, *others):
        raise UserError("bench", name, f"no such bench; choose one of {', '.join((*BENCHES, *others))}")
    return others[name](json) if name in others else _times(name, json)


def _times(name: str | None, json: bool) -> int:
    line = machine()
    chosen = {key: value for key, value in BENCHES.items() if name in (None, key)}
    rows = {key: value.rows() for key, value in chosen.items()}
    if json:
        _print_json({"machine": line, **{key: [_plain(row) for row in value] for key, value in rows.items()}})
        return 0
    tables = [time_table(chosen[key].title, rows[key], chosen[key].below) for key in rows]
    _print_tables(line, tables)
    if name is None:
        _write("benchmarks.md", "Times", f"`brake-ecu bench`, version {__version__}. {line}.", tables)
    return 0


def _stops(json: bool, seeds: int) -> int:
    path = resource("config/suv.toml")
    config = load_config(path)
    console = Console(stderr=True)
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:

        def all_cores(
            drive: stops_bench.Case, cases: list[stops_bench.Named]
        ) -> Iterable[stops_bench.Result]:
            results = pool.map(drive, cases)
            return track(results, "stops", len(cases), console=console, transient=True)

        result = stops_bench.stops(config, seeds, spread=all_cores)
    of = f"version {__version__}, config/{path.name} ({config_hash(config)[:12]}), seeds 0–{seeds - 1}"
    if json:
        plain = {key: [_plain(row) for row in rows] for key, rows in result._asdict().items()}
        _print_json({"of": of, **plain})
        return 0
    tables = stop_tables(result, seeds)
    _print_tables(of, tables)
    text = f"`brake-ecu bench stops`, {of}. {STOPS_TEXT}"
    _write("observer-accuracy.md", "Accuracy of the friction and of the compensation", text, tables)
    return 0


def _observers(json: bool, seeds: int) -> int:
    console = Console(stderr=True)
    todo = tasks(seeds)
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:

        def all_cores(drive: Callable[[Task], list[Sample]], cars: list[Task]) -> Iterable[list[Sample]]:
            return track(pool.map(drive, cars), OBSERVERS, len(cars), console=console, transient=True)

        rows = observer_rows(todo, all_cores)
        consistency = list(pool.map(consistency_of, range(min(seeds, PICTURED))))
    times = step_times()
    of = f"version {__version__}, config/suv.toml ({config_hash(configured())[:12]}), seeds 0–{seeds - 1}"
    if json:
        plain = {name: value._asdict() for name, value in times.items()}
        _print_json(finite({"of": of, "rows": [_plain(row) for row in rows], "step_us": plain}))
        return 0
    tables = observer_tables(rows, times, consistency)
    _print_tables(of, tables)
    text = f"`brake-ecu bench observers`, {of}. {machine()}. {OBSERVERS_TEXT}"
    _write("observers.md", "The observers beside their goals", text, tables)
    write_picture(resource("docs") / "images" / "observers.svg", consistency)
    return 0


def _friction(json: bool) -> int:
    return _page(FRICTION, "Friction laws, disc and brake unit", FRICTION_TEXT, friction_tables(), json)


def _energy(json: bool) -> int:
    tables = energy_tables(resource("config/scenarios"), load_config(resource("config/suv.toml")))
    return _page(ENERGY, "Where the energy goes", ENERGY_TEXT, tables, json)


def _replay(json: bool) -> int:
    try:
        from brakelab.bench.replay import replay_tables
    except ImportError:
        raise UserError("bench", REPLAY, NOT_INSTALLED.format("asammdf")) from None
    return _page(
        REPLAY, "Speed of replay", f"{machine()}. {REPLAY_TEXT}", replay_tables(), json, "replay-speed"
    )


def _page(name: str, title: str, text: str, tables: list[Table], json: bool, file: str = "") -> int:
    of = f"`brake-ecu bench {name}`, version {__version__}"
    if json:
        _print_json({"of": of, "tables": [table._asdict() for table in tables]})
        return 0
    _print_tables(of, tables)
    _write(f"{file or name}.md", title, f"{of}. {text}", tables)
    return 0


def _plain(row: Any) -> dict[str, Any]:
    """Return a row as JSON has it: figures become objects, times get their ratio."""
    values = row._asdict().items()
    plain = {key: value._asdict() if isinstance(value, Figure) else value for key, value in values}
    return plain | {"ratio": row.ratio} if isinstance(row, Row) else plain


def _print_json(content: dict[str, Any]) -> None:
    print(json_format.dumps(content, indent=1, ensure_ascii=False))


def _print_tables(line: str, tables: list[Table]) -> None:
    console = Console()
    console.print(line, highlight=False)
    for table in tables:
        show(console, table)


def _write(name: str, title: str, text: str, tables: list[Table]) -> None:
    folder: Path = resource("docs")
    if folder.is_dir():
        content = "\n".join([f"# {title}", "", text, "", *map(markdown, tables)])
        (folder / name).write_text(content.rstrip() + "\n", encoding="utf-8")
        Console(stderr=True).print(f"written: docs/{name}", highlight=False)
