"""A car to test: the sport utility vehicle as described, with nothing drawn."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brakelab.plant.description import Plant, load_plant, nominal
from brakelab.plant.friction.ilvo_bounded import DEBRIS, HEAT, SPEED
from brakelab.plant.jit import kernel
from brakelab.plant.records import COMMANDS, RecordArray, new_record
from brakelab.plant.vehicle import STEP, advance, new_state

CONFIG = Path(__file__).parents[3] / "config" / "plant"


@dataclass
class Car:
    """One car on a dry road; `run` moves it on and shows every step to `watch`, `states` keeps every one."""

    params: RecordArray
    state: RecordArray
    commands: RecordArray

    @property
    def now(self) -> Any:
        return self.state[0]

    def run(self, seconds: float, dt: float = STEP, watch: Callable[[Any], None] | None = None) -> None:
        steps = round(seconds / dt)
        if watch is None:
            advance_steps(self.params, self.state, self.commands, dt, steps, self.state[:0])
            return
        for _ in range(steps):
            advance(self.params[0], self.state[0], self.commands[0], dt)
            watch(self.state[0])

    def states(self, seconds: float) -> RecordArray:
        """Run on and return the states after every step, shape (steps,)."""
        seen = np.zeros(round(seconds / STEP), self.state.dtype)
        advance_steps(self.params, self.state, self.commands, STEP, len(seen), seen)
        return seen

    def press(self, front_bar: float, rear_bar: float) -> None:
        """Hold these pressures, as if they had been asked for long ago."""
        pressure = [1e5 * bar for bar in (front_bar, front_bar, rear_bar, rear_bar)]
        self.commands["pressure_demand"] = pressure
        self.state["pressure"] = self.state["turning_point"] = pressure
        self.state["demand_history"][0, :, :] = pressure

    def freeze_friction(self) -> None:
        """Make lining friction a constant and discs stay cool."""
        self.params["friction_row"][0, :, [DEBRIS, SPEED, HEAT]] = 0.0
        for name in ("heating", "cooling", "cooling_by_speed"):
            self.params[name] = 0.0


@kernel
def advance_steps(params: Any, state: Any, commands: Any, dt: float, steps: int, seen: Any) -> None:
    """Advance one car; keep its states in `seen`, shape (steps,) or (0,)."""
    for k in range(steps):
        advance(params[0], state[0], commands[0], dt)
        if k < len(seen):
            seen[k] = state[0]


def make_car(params: RecordArray, speed: float) -> Car:
    commands = new_record(COMMANDS)
    commands["road_friction"] = 1.2
    commands["ambient_temperature"] = 20.0
    return Car(params, new_state(params, speed, (100.0, 100.0)), commands)


@pytest.fixture(scope="session")
def suv() -> Plant:
    return load_plant(CONFIG / "suv.toml")


@pytest.fixture
def car_at(suv: Plant) -> Callable[[float], Car]:
    """Return a maker of cars that roll at a speed [m/s]."""
    return lambda speed: make_car(nominal(suv), speed)


@pytest.fixture
def shipped() -> Callable[[str, float], Car]:
    """Return a maker of any shipped car at a speed [m/s]."""
    return lambda name, speed: make_car(nominal(load_plant(CONFIG / f"{name}.toml")), speed)
