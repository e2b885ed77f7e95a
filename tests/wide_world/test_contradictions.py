"""Physics of strangers' logs: sound ones give no line, contradictions do, and nothing is learned."""

from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow.parquet as pq
import pytest

from brakelab.fleet.job import Job
from brakelab.fleet.task import replay_job
from brakelab.logs.physics.judge import Judged, judge
from brakelab.logs.physics.samples import SAMPLED, Car, Collector, car_of
from brakelab.replay.command import Replayed, replay_into
from brakelab.replay.source import load_source
from brakelab.results.files import read_result
from ecu.contract.signals import CORNERS, INPUT_SIGNALS
from ecu.recording.store import open_store, restore
from ecu.settings.config import load_config, new_params, store_key

from .draw import draw
from .logger import record, write
from .route import G, Values

pytestmark = pytest.mark.study

Columns = dict[str, Values]
Change = Callable[[Columns], None]

CARS = ((1, 2), (1, 3), (1, 7), (1, 9), (1, 11), (1, 12), (1, 21), (2, 16))
"""Seed and number: one of each set, and two more whose front and rear pressures differ."""
DEGREES = 180.0 / np.pi


class Logged(NamedTuple):
    """A stranger's log."""

    columns: Columns
    config: str
    car: Car


@pytest.fixture(scope="module")
def logged(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[int, int], Logged]:
    found = {}
    for seed, number in CARS:
        stranger = draw(seed, range(number, number + 1))[0]
        columns = record(stranger.drive(), stranger.logger, stranger.nominal.radius)
        config = tmp_path_factory.mktemp("car") / "car.toml"
        config.write_text(stranger.nominal.toml("car"), "utf-8")
        found[seed, number] = Logged(columns, config.read_text("utf-8"), car_of(params(config)))
    return found


def params(config: Path) -> np.void:
    return new_params(load_config(config))[0]


def grid(columns: Columns) -> Values:
    """Return the samples of `SAMPLED` as `replay` takes them: the last of 10 ms, within its input's range."""
    cycle = np.rint((columns["t"] - columns["t"][0]) * 100.0).astype(int)
    samples = np.full((cycle[-1] + 1, len(SAMPLED)), np.nan)
    for column, place in enumerate(SAMPLED):
        signal = INPUT_SIGNALS[place]
        values = columns.get(signal.name, np.array([np.nan]))
        here = np.flatnonzero((values >= signal.low) & (values <= signal.high))
        samples[cycle[here], column] = values[here]
    return samples


def judged(columns: Columns, car: Car) -> Judged:
    collector = Collector()
    collector.add(grid(columns))
    return judge(collector.series(), car)


def contradictions(columns: Columns, car: Car) -> list[str]:
    return judged(columns, car).contradictions


def times(stem: str, factor: float) -> Change:
    def change(columns: Columns) -> None:
        for name in columns:
            if name.startswith(stem):
                columns[name] = factor * columns[name]

    return change


def exchange(a: str, b: str) -> Change:
    def change(columns: Columns) -> None:
        columns[a], columns[b] = columns[b], columns[a]

    return change


def front_for_rear(columns: Columns) -> None:
    for front, rear in (("fl", "rl"), ("fr", "rr")):
        exchange(f"calliper_pressure_{front}", f"calliper_pressure_{rear}")(columns)


WRONG = [
    # what is wrong, how, what the line begins with, in how many of the cars at least
    ("accelerometer turned", times("accel_x", -1.0), "accel_x: turned", 8),
    ("deceleration in g", times("accel_x", 1.0 / G), "accel_x: reads 0.", 8),
    ("half an acceleration", times("accel_x", 0.5), "accel_x: reads 0.", 8),
    ("double an acceleration", times("accel_x", 2.0), "accel_x: reads ", 8),
    ("axes exchanged", exchange("accel_x", "accel_y"), "accel_x and accel_y are swapped", 8),
    ("lateral turned", times("accel_y", -1.0), "accel_y: turned", 8),
    ("half the wheels' speed", times("wheel_speed", 0.5), "wheel_speed_*: all read 0.", 7),
    ("double the wheels' speed", times("wheel_speed", 2.0), "wheel_speed_*: all read ", 7),
    ("half a wheel's speed", times("wheel_speed_rl", 0.5), "wheel_speed_rl: reads 0.", 7),
    ("half the speed", times("vehicle_speed", 0.5), "vehicle_speed: reads 0.", 3),
    ("double the speed", times("vehicle_speed", 2.0), "vehicle_speed: reads ", 3),
    ("half the pressures", times("calliper_pressure", 0.5), "calliper_pressure_*: the car brakes ", 6),
    ("double the pressures", times("calliper_pressure", 2.0), "calliper_pressure_*: the car brakes ", 2),
    ("pressures in MPa", times("calliper_pressure", 0.1), "calliper_pressure_*: the car brakes ", 8),
    ("half a pressure", times("calliper_pressure_fl", 0.5), "calliper_pressure_*: front left", 8),
    ("front for rear", front_for_rear, "calliper_pressure_*: front and rear are exchanged", 4),
]  # fmt: skip


def test_sound_logs_contradict_nothing(logged: dict[tuple[int, int], Logged]) -> None:
    for car, (columns, _, lengths) in logged.items():
        assert contradictions(columns, lengths) == [], car
        without = {name: values for name, values in columns.items() if name != "accel_x"}
        assert contradictions(without, lengths) == [], (car, "without accelerometer")


def test_friction_that_falls_with_pressure_is_no_wrong_unit(logged: dict[tuple[int, int], Logged]) -> None:
    """The line over the pressures says less than half the friction, their mean more."""
    for car, (columns, _, lengths) in logged.items():
        carbon, most = dict(columns), max(np.nanmax(columns[f"calliper_pressure_{c}"]) for c in CORNERS)
        for corner in CORNERS:
            pressure = columns[f"calliper_pressure_{corner}"]
            carbon[f"calliper_pressure_{corner}"] = pressure * (0.6 + 1.8 * np.maximum(pressure, 0.0) / most)
        assert contradictions(carbon, lengths) == [], car


@pytest.mark.parametrize(("what", "change", "begins", "least"), WRONG, ids=[row[0] for row in WRONG])
def test_a_contradiction_is_reported(
    logged: dict[tuple[int, int], Logged], what: str, change: Change, begins: str, least: int
) -> None:
    """As a flaw only, and learned, where the mean is what friction may be."""
    reported = 0
    for columns, _, car in logged.values():
        wrong = dict(columns)
        change(wrong)
        lines = judged(wrong, car).lines
        reported += any(line.startswith(begins) for line in lines)
        if all(wrong[name] is columns[name] for name in columns):
            assert not contradictions(wrong, car)  # this log has no such signal
    print(what, reported, "of", len(logged))
    assert reported >= least


def replayed(
    one: Logged, folder: Path, change: Change | None = None, force: bool = False, observer: str = "joint"
) -> Replayed:
    columns = dict(one.columns)
    if change:
        change(columns)
    write(columns, folder / "log.parquet")
    (folder / "car.toml").write_text(one.config, "utf-8")
    return replay_into(
        [folder / "log.parquet"],
        folder / "car.toml",
        None,
        observer,
        folder / "state",
        folder / "out.parquet",
        force=force,
    )


def learned(folder: Path) -> bool:
    """Whether friction of the result ever leaves its start, and whether it was stored: both or none."""
    columns = read_result(folder / "out.parquet").columns
    moves = any(np.ptp(columns[f"mu_b_{corner}"]) > 0.0 for corner in CORNERS)
    config = load_config(folder / "car.toml")
    with closing(open_store(folder / "state")) as store:
        found = restore(store, store_key(config), new_params(config)[0]["mu_nominal"])
    assert moves == (found is not None)
    return moves


@pytest.mark.parametrize("observer", ["joint", "observer1", "observer2"])
@pytest.mark.parametrize("car", [(1, 7), (1, 9)], ids=["one speed", "four wheels"])
def test_a_contradicted_log_teaches_nothing(
    logged: dict[tuple[int, int], Logged], tmp_path: Path, car: tuple[int, int], observer: str
) -> None:
    done = replayed(logged[car], tmp_path, times("accel_x", -1.0), observer=observer)
    assert done.notes[0].endswith("accel_x: turned against dv/dt; factor = -1")
    assert "--force" in done.notes[1]
    assert not learned(tmp_path)
    assert {row.learning for row in done.writer.brakes.rows} == {"physics contradicts"}
    assert done.writer.brakes.rows[-1].brake > 10
    assert np.diff(read_result(tmp_path / "out.parquet").columns["t"]).max() < 0.011


def test_a_sound_log_teaches_and_force_does(logged: dict[tuple[int, int], Logged], tmp_path: Path) -> None:
    sound, forced = tmp_path / "sound", tmp_path / "forced"
    sound.mkdir()
    forced.mkdir()
    assert not any("physics" in line or "--force" in line for line in replayed(logged[1, 7], sound).notes)
    assert learned(sound)
    notes = replayed(logged[1, 7], forced, times("accel_x", -1.0), force=True).notes
    assert notes[0].endswith("accel_x: turned against dv/dt; factor = -1")
    assert not any("--force" in line for line in notes)
    assert learned(forced)


@pytest.mark.parametrize("rows", [False, True])
def test_a_fleet_learns_nothing_of_a_contradicted_drive(
    logged: dict[tuple[int, int], Logged], tmp_path: Path, rows: bool
) -> None:
    columns = dict(logged[1, 7].columns)
    log, config, out = tmp_path / "log.parquet", tmp_path / "car.toml", tmp_path / "rows.parquet"
    config.write_text(logged[1, 7].config, "utf-8")
    job = Job(
        "a", "1", (str(log),), load_config(config), load_source(None), b"", "", str(out) if rows else ""
    )
    write(columns, log)
    sound = replay_job(job)
    assert sound.summary["learned"] > 0
    times("accel_x", -1.0)(columns)
    write(columns, log)
    done = replay_job(replace(job, learned=sound.learned))
    assert done.summary["notes"].splitlines()[0].endswith("accel_x: turned against dv/dt; factor = -1")
    assert done.summary["learned"] == 0
    assert done.summary["brakings"] > 10
    assert done.learned == sound.learned
    if rows:
        assert np.ptp(pq.read_table(out)["mu_b_fl"].to_numpy()) == 0.0
