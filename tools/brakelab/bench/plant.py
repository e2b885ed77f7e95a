"""Time of the simulated vehicle per millisecond of its drive, with fourteen and seven degrees of freedom.

The car brakes, steers and drives over a rough road, so that all states are excited. Beside it the multi-body
model of commonroad-vehicle-models under scipy, where both are installed: a stop and a step-steer of its
own car.
"""

import time
from collections.abc import Callable
from importlib import import_module
from importlib.metadata import PackageNotFoundError
from typing import Any, Final

import numba
import numpy as np

from brakelab.plant.description import load_plant
from brakelab.plant.draw import draw, load_widths
from brakelab.plant.fleet import advance_fleet
from brakelab.plant.jit import kernel
from brakelab.plant.records import COMMANDS, RecordArray
from brakelab.plant.vehicle import STEP, advance, new_state
from brakelab.studies.measure import Figure, Row, Task, alternate, installed, timed
from ecu.settings.resources import resource

ROUNDS: Final = 11
STEPS: Final = 10_000
"""Of 1 ms in a round: 10 s from 50 m/s."""
CARS: Final = 16
"""Of the fleet, in which each runs a quarter of `STEPS`."""
PEER: Final = "commonroad-vehicle-models"
PEER_SECONDS: Final = 3.0
MILLISECONDS: Final = 1e3
ROUGHNESS: Final = 0.004  # m, amplitude of the road under each side


@kernel
def _drive(params: Any, state: Any, commands: Any, steps: int) -> None:
    for k in range(steps):
        for wheel in range(4):
            commands.road_height[wheel] = ROUGHNESS * np.sin(0.05 * k + wheel)
        advance(params, state, commands, STEP)


def cars(name: str, count: int) -> tuple[RecordArray, RecordArray, RecordArray]:
    """Return parameters, states at 50 m/s and commands of `count` drawn cars, shape (count,) each."""
    plant = load_plant(resource(f"config/plant/{name}.toml"))
    width = load_widths(resource("config/plant/draw.toml"), "wide")
    params = np.concatenate([draw(plant, seed, width) for seed in range(count)])
    states = np.concatenate([new_state(params[i : i + 1], 50.0, (100.0, 100.0)) for i in range(count)])
    commands = np.zeros(count, COMMANDS)
    commands["road_friction"], commands["ambient_temperature"] = 1.2, 20.0
    commands["steering_angle"], commands["pressure_demand"] = 0.002, 10e5
    return params, states, commands


def _alone(name: str, steps: int) -> Task:
    params, states, commands = cars(name, 1)
    start = states.copy()

    def again() -> None:
        states[:] = start

    return timed(lambda: _drive(params[0], states[0], commands[0], steps), steps, again)


def _fleet(name: str, steps: int, cores: int) -> Task:
    """Return a task timed by the clock: the processor time of one thread excludes the others."""
    params, states, commands = cars(name, CARS)
    start = states.copy()

    def task() -> float:
        states[:] = start
        numba.set_num_threads(cores)
        return by_clock(lambda: advance_fleet(params, states, commands, steps, STEP)) / (CARS * steps)

    return task


def peer_task(accel: float, steering: float) -> Task:
    """Return the task of the peer's own car at 20 m/s.

    Raises:
        ImportError: it is not installed.
    """
    dynamics = import_module("vehiclemodels.vehicle_dynamics_mb").vehicle_dynamics_mb
    car = import_module("vehiclemodels.parameters_vehicle2").parameters_vehicle2()
    start = import_module("vehiclemodels.init_mb").init_mb([0.0, 0.0, 0.0, 20.0, 0.0, 0.0, 0.0], car)
    solve = import_module("scipy.integrate").solve_ivp

    def rates(t: float, x: Any) -> Any:
        return dynamics(list(x), [steering if t < 0.1 else 0.0, accel], car)

    return timed(
        lambda: solve(rates, (0.0, PEER_SECONDS), start, rtol=1e-6, atol=1e-8),
        round(PEER_SECONDS * MILLISECONDS),
    )


def by_clock(run: Callable[[], object]) -> float:
    """Return the time [µs] that `run` takes."""
    start = time.perf_counter_ns()
    run()
    return (time.perf_counter_ns() - start) / 1e3


def plant_rows(rounds: int = ROUNDS, steps: int = STEPS) -> list[Row]:
    """Return the rows; times per millisecond of one car's drive."""
    most = numba.config.NUMBA_NUM_THREADS
    names = ("suv14", "suv")
    tasks = [_alone(name, steps) for name in names]
    tasks += [_fleet(names[0], steps // 4, cores) for cores in (1, most)]
    try:
        tasks += [peer_task(-4.0, 0.0), peer_task(0.0, 0.2)]
        note = f"{installed(PEER)}, multi-body under {installed('scipy')}"
    except (ImportError, PackageNotFoundError):
        note = f"no peer: pip install {PEER}"
    figures = alternate(rounds, tasks)
    braking: Figure | None = figures[4] if len(figures) > 4 else None
    steering: Figure | None = figures[5] if len(figures) > 4 else None

    def row(what: str, ours: Figure, peer: Figure | None, of: str) -> Row:
        return Row(what, ours, peer, "µs", f"{MILLISECONDS / ours.median:.0f} times real time; {of}")

    return [
        row("14 degrees of freedom", figures[0], braking, f"{note}, braking"),
        row("14 degrees of freedom", figures[0], steering, f"{note}, step-steer"),
        row("7 degrees of freedom", figures[1], None, "the reduced form"),
        row(f"{CARS} cars, 14 degrees, 1 core", figures[2], None, "by the clock"),
        row(f"{CARS} cars, 14 degrees, {most} cores", figures[3], None, "by the clock"),
    ]
