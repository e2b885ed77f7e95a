"""Drives that every entry hears, open loop: of drawn cars with their truth, and a recorded one."""

from collections.abc import Iterator
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector
from brakelab.logs.formats import kind_of, read_frames
from brakelab.logs.log_quality import LogQuality
from brakelab.replay.engine import new_ecu, run_frames
from brakelab.replay.source import load_source
from brakelab.replay.summary import judged
from brakelab.results.brakes import BrakeBook, BrakeRow
from brakelab.simulation.closed_loop import START_NS, Drive, new_loop, run
from brakelab.simulation.configured import configured, shipped
from brakelab.simulation.ecu_inputs import ecu_inputs
from brakelab.simulation.scenario import Scenario
from brakelab.simulation.scenario_car import with_draw
from brakelab.stretches import stretches
from brakelab.studies.accuracy.loggers import LOGGERS, logger_columns, recorded_scenario, uncorrected
from brakelab.studies.accuracy.observers import ORDINARY, counted
from brakelab.studies.accuracy.stops import TESTS
from brakelab.studies.entries.inputs import TRANSDUCERS
from ecu.bus.receive import new_reception
from ecu.contract.records import RecordArray
from ecu.contract.signals import CORNERS, CYCLE_NS, INPUT_SIGNALS, without_corner
from ecu.errors import UserError
from ecu.settings.config import Config, load_config, new_params
from ecu.settings.resources import named

PERIOD: Final = 1e-9 * CYCLE_NS  # s
SETS: Final = ("accelerometer 50 Hz", "accelerometer 10 Hz")
"""Sensor sets of recorded cars, of `LOGGERS`."""
NAMES: Final = tuple(signal.name for signal in INPUT_SIGNALS)
WITHHELD: Final = np.array([without_corner(name) in TRANSDUCERS for name in NAMES])


class Track(NamedTuple):
    """A drive as it is played to entries; n cycles of 10 ms."""

    name: str
    config: Config
    values: Vector
    """Samples, NaN: none, shape (n, N_INPUTS)."""
    mu: Vector
    """True friction, shape (n, 4)."""
    pressure: Vector
    """True pressures of the callipers [bar], shape (n, 4)."""
    rows: NDArray[np.bool_]
    """That count, shape (n,)."""


class CarTracks(NamedTuple):
    """Drives of one drawn car."""

    everyday: Track
    stops: list[Track]
    recorded: list[Track]
    """By `SETS`."""


def _track(name: str, config: Config, drive: Drive, columns: dict[str, Vector]) -> Track:
    nothing = np.full(len(drive.t), np.nan)
    values = np.stack([columns.get(signal, nothing) for signal in NAMES], axis=1)
    mu, pressure = (
        np.stack([drive.truth[f"{stem}_{corner}"] for corner in CORNERS], axis=1)
        for stem in ("mu_b", "calliper_pressure")
    )
    return Track(name, config, values, mu, pressure, counted(drive))


def _driven(name: str, seed: int) -> Track:
    scenario = with_draw(shipped(name), "wide")
    update = {"plant": shipped(f"stop-{TESTS[0]}").plant, "wheel_transducers": True}
    return drive_track(name, scenario.model_copy(update=update), seed)


def drive_track(name: str, scenario: Scenario, seed: int) -> Track:
    """Return a drive of the car `seed`, braked by the ECU of config/suv.toml."""
    drive = run(new_loop(scenario, configured(), seed))
    return _track(name, configured(), drive, drive.inputs)


def car_tracks(seed: int) -> CarTracks:
    """Drive everything with the car `seed` of the wide draw."""
    config = uncorrected()
    drive = run(new_loop(recorded_scenario(), config, seed))
    recorded = [_track(name, config, drive, logger_columns(drive, LOGGERS[name])) for name in SETS]
    stops = [_driven(f"stop-{test}", seed) for test in TESTS]
    return CarTracks(_driven(ORDINARY, seed), stops, recorded)


def applications(track: Track) -> Iterator[slice]:
    """Yield the counted rows of each brake application."""
    for first, last in stretches(track.rows).tolist():
        yield slice(first, last)


class RealDrive(NamedTuple):
    """A recorded drive; its track has no truth."""

    track: Track
    results: Vector
    """Of the ECU's replay: speed, pressures, road acceleration; shape (n, N_ROW)."""
    params: RecordArray
    brakings: list[BrakeRow]
    """Whose prediction counts, one row each."""


def real_drive(car: str, log: Path) -> RealDrive:
    """Return a log of frames of the car whose configuration and signal map have this name.

    Raises:
        UserError: there is no such car or log, it holds decoded signals, or no brake application.
    """
    config = load_config(named(car, "config"))
    source = load_source(named(car, "config/maps"))
    if not log.exists():
        raise UserError("--drive", str(log), "no such log")
    if source.columns or kind_of(log) != "frames":
        raise UserError("--drive", str(log), "give a log of frames and the name of a car with a map of them")
    interfaces: list[str] = []
    frames = np.concatenate(list(read_frames(log, interfaces, LogQuality())))
    if source.bus in interfaces:
        frames = frames[frames["bus"] == interfaces.index(source.bus)]
    params = new_params(config)
    params["mapped"] = source.plan.mapped
    ecu, book = new_ecu(params, None), BrakeBook(params)
    results = np.concatenate(
        [rows.values.copy() for rows in run_frames(ecu, source.plan, new_reception(source.plan), [frames])]
    )
    book.add(np.arange(len(results), dtype=np.float64) * PERIOD, results)
    book.end_log()
    frames["stamp_ns"] += START_NS - frames["stamp_ns"][0]
    inputs = ecu_inputs(frames, len(results), source.plan)
    values = np.where(inputs["new"] == 1, inputs["value"], np.nan)
    none = np.full((len(results), 4), np.nan)
    track = Track(log.name, config, values, none, none, np.zeros(len(results), np.bool_))
    counting = [row for row in judged(book.rows) if row.t_start > 0.0]
    if not counting:
        raise UserError(
            "--drive",
            str(log),
            f"no brake application of {car} to predict; `map check` shows what is received",
        )
    return RealDrive(track, results, params, counting)
