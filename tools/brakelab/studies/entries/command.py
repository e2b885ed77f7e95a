"""`brake-ecu bench entries`: friction observers of anybody, side by side."""

from functools import partial
from pathlib import Path
from typing import Final, NamedTuple

from brakelab.results.processes import run_each
from brakelab.results.progress import tracked
from brakelab.studies.accuracy.observers_table import finite
from brakelab.studies.entries.drives import car_tracks, real_drive
from brakelab.studies.entries.export import export_car, new_folder
from brakelab.studies.entries.ours import OURS
from brakelab.studies.entries.study import class_of, judge_car, predict_all
from brakelab.studies.entries.table import entry_tables, standings
from brakelab.studies.measure import machine
from brakelab.studies.study import Asked, Measured, Study
from ecu.errors import UserError
from ecu.output import give, say
from ecu.settings.resources import resource

ENTRIES: Final = "entries"
CARS: Final = 10
SHIPPED: Final = ("mustang", "tests/golden/mustang_braking.log.gz")
TEXT: Final = (
    "Every entry hears the same recorded inputs, open loop, and gives the friction of four brakes with its "
    "standard deviation in every cycle ([benchmark.md](../benchmark.md) says how to enter). Cars of the wide "
    "draw, braked once by the ECU of config/suv.toml. Stops: Table 4.2 of the thesis, from 120 km/h. Cold: "
    "nothing heard before; driven in: after the ten minutes of config/scenarios/ordinary.toml, which are "
    "*everyday* and begin cold. Counted while the brakes of both axles have been on for 0.8 s, above "
    "15 km/h. The ECU's observers run as a shadow: they do not know the demand, only pressure. "
    "Observer 1 alone hears the forces of measuring wheels; the simulated loggers and the real car have "
    "none. Recorded cars have an engine, whose drag nothing reports ([plant.md](../plant.md))."
)


def measure_entries(asked: Asked) -> Measured:
    """Play the drives of the cars (at most `CARS`) to ours and the entered observers.

    Raises:
        UserError: an observer cannot be loaded, or a log not read.
    """
    cars, entered = min(asked.seeds, CARS), asked.entered
    for name in entered.observers:
        class_of(name)
    names = tuple(dict.fromkeys((*OURS, *entered.observers)))
    car, log = _drive(entered.drive)
    real = None if log is None else real_drive(car, log)
    say(f"cars to drive: {cars}, heard by {len(names)} entries; minutes")
    results = run_each(ENTRIES, partial(judge_car, names), range(cars))
    predictions = {} if real is None else predict_all(names, real)
    found = standings(results, predictions)
    rows = [{"rank_error": one.rank_error, **_plain(one)} for one in found]
    tables = entry_tables(found, cars, "" if log is None else f"{car}, {log.name}")
    return Measured(tables, f", wide draw, seeds 0–{cars - 1}. {machine()}", finite({"entries": rows}))


def _plain(one: NamedTuple) -> dict[str, object]:
    values = one._asdict()
    prediction = values["prediction"]
    return values | {"prediction": None if prediction is None else prediction._asdict()}


def _drive(named: str | None) -> tuple[str, Path | None]:
    if named is None:
        shipped = resource(SHIPPED[1])
        return SHIPPED[0], shipped if shipped.is_file() else None
    car, _, log = named.partition(":")
    if not car or not log:
        raise UserError("--drive", named, "give CAR:LOG, for example mustang:drive.log")
    return car, Path(log)


def export_entries(folder: Path, seeds: int) -> int:
    """Write the drives of cars 0 to `seeds` - 1 (at most `CARS`) into a new folder; returns 0.

    Raises:
        UserError: the folder cannot be written.
    """
    cars = min(seeds, CARS)
    new_folder(folder)
    say(f"cars to drive: {cars}; minutes")
    for seed in tracked(range(cars), ENTRIES, cars):
        export_car(folder, seed, car_tracks(seed))
    say(f"written: {folder}, inputs and truth (cars: {cars}); next: docs/benchmark.md")
    give(written=[folder])
    return 0


STUDY: Final = Study("Friction observers, side by side", TEXT, measure_entries)
