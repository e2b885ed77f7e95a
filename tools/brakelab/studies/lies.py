"""One input lies in closed loop, armed: how far the brakes stray, and when the ECU says which input it is.

Twelve brakings of 4 m/s^2 from 28 m/s by an automated demand; from `BEGIN` on one input, or those of one
frame, lie. `lies_cell.py` says what is measured of a drive.
"""

from itertools import product
from typing import Final, NamedTuple

from brakelab.results.processes import run_each
from brakelab.simulation.closed_loop import new_loop, run
from brakelab.simulation.configured import configured
from brakelab.simulation.faults import Fault
from brakelab.simulation.scenario import Phase, Scenario
from brakelab.studies.lies_cell import BEGIN, DECEL, Cell, judge
from ecu.contract.signals import CORNERS, INPUT_SIGNALS
from ecu.settings.config import Config

BRAKINGS, MANY = 12, 40
"""Of a drive, and of one with a slow drift."""
FAST: Final = (0.1, 0.5, 1.0, -0.1, -0.5, -1.0)  # %/s
SLOW: Final = (0.005, 0.01, 0.02, 0.05, -0.005, -0.01, -0.02, -0.05)  # %/s
SLOW_ON: Final = ("suv", "straight")
CARS: Final = {"suv": False, "suv-blended": True, "sedan": False}
"""Configurations, and whether their motors brake."""
ROADS: Final[dict[str, dict[str, object]]] = {
    "straight": {"road_friction": [(0.0, 1.2)]},
    "curve": {"road_friction": [(0.0, 1.2)], "steering": {"angle": [(0.0, 0.0), (2.0, 0.010)]}},
    "split": {
        "road": {"friction": [(0.0, 0.6, 1.2), (20000.0, 0.6, 1.2)]},
        "steering": {"path": [(0.0, 0.0), (20000.0, 0.0)]},
    },
    "downhill": {"road": {"grade": [(0.0, 0.0), (50.0, -0.06), (20000.0, -0.06)]}},
}
LONGER: Final = 1.5  # than the sound car's drive, at most: a car that has spun gets nowhere
ACCEL, SPLIT_ACCEL = 5.0, 2.0  # m/s^2, between the brakings; on the split one driven axle has less grip


class Input(NamedTuple):
    """An input, or those of one frame, that lie together."""

    signals: tuple[str, ...]
    typical: float
    """Value to which percentages of an offset refer, in the signal's unit."""
    noise: float
    """Standard deviation of a sound sensor (Table 4.1, or an assumption)."""


def _four(stem: str) -> tuple[str, ...]:
    return tuple(f"{stem}_{corner}" for corner in CORNERS)


_SPEED, _PRESSURE, _TORQUE = _four("wheel_speed"), _four("calliper_pressure"), _four("motor_torque")
ANALOGUE: Final = {
    "wheel speed front left": Input(_SPEED[:1], 80.0, 0.1),
    "wheel speed rear right": Input(_SPEED[3:], 80.0, 0.1),
    "wheel speeds front": Input(_SPEED[:2], 80.0, 0.1),
    "wheel speeds rear": Input(_SPEED[2:], 80.0, 0.1),
    "wheel speeds, all": Input(_SPEED, 80.0, 0.1),
    "vehicle_speed": Input(("vehicle_speed",), 30.0, 0.03),
    "accel_x": Input(("accel_x",), 5.0, 0.01),
    "accel_y": Input(("accel_y",), 5.0, 0.01),
    "yaw_rate": Input(("yaw_rate",), 0.5, 0.002),
    "steering_angle": Input(("steering_angle",), 0.2, 0.001),
    "pressure front left": Input(_PRESSURE[:1], 60.0, 1.8),
    "pressure rear right": Input(_PRESSURE[3:], 60.0, 1.8),
    "pressures front": Input(_PRESSURE[:2], 60.0, 1.8),
    "pressures rear": Input(_PRESSURE[2:], 60.0, 1.8),
    "pressures, all": Input(_PRESSURE, 60.0, 1.8),
    "motor torque front left": Input(_TORQUE[:1], 500.0, 10.0),
    "motor torques, all": Input(_TORQUE, 500.0, 10.0),
    "motor limits, all": Input(_four("motor_limit"), 1000.0, 10.0),
    "accumulator_pressure": Input(("accumulator_pressure",), 180.0, 2.0),
    "ambient_temperature": Input(("ambient_temperature",), 20.0, 0.5),
}
FLAGS: Final = ("reverse", "abs_active", "esp_active", "pedal_pressed", "rain", "hydraulic_ready")
PAIRS: Final = {
    "wheel speed front left": ("wheel_speed_fl", "wheel_speed_fr"),
    "wheel speed rear right": ("wheel_speed_rr", "wheel_speed_fr"),
    "pressure front left": ("calliper_pressure_fl", "calliper_pressure_fr"),
    "pressure rear right": ("calliper_pressure_rr", "calliper_pressure_fr"),
    "motor torque front left": ("motor_torque_fl", "motor_torque_rl"),
}
_RANGE: Final = {signal.name: signal for signal in INPUT_SIGNALS}


def _fault(signals: tuple[str, ...], kind: str, **keys: float) -> Fault:
    return Fault.model_validate({"kind": kind, "t": BEGIN, "signal": list(signals), **keys})


def ramps(name: str, rates: tuple[float, ...]) -> dict[str, Fault]:
    """Return the drifts of the scale and of the zero of an input of `ANALOGUE` at `rates` [%/s], by name."""
    signals, typical, _ = ANALOGUE[name]
    found = {}
    for rate in rates:
        relative = {"rate": 0.01 * rate, "limit": 0.5}
        found[f"ramp {rate:+g} %/s"] = _fault(signals, "scale_drifting", **relative)
        moved = {"rate": 0.01 * rate * typical, "limit": 0.5 * typical}
        found[f"zero {rate:+g} %/s"] = _fault(signals, "drifting", **moved)
    return found


def lies(name: str) -> dict[str, Fault]:
    """Return the lies of an input of `INPUTS`, by name."""
    if name in FLAGS:
        return {f"stuck at {value:g}": _fault((name,), "set", amount=value) for value in (0.0, 1.0)}
    if name == "accelerator_position":
        return {f"stuck at {value:g} %": _fault((name,), "set", amount=value) for value in (0.0, 5.0, 50.0)}
    signals, typical, noise = ANALOGUE[name]
    high = _RANGE[signals[0]].high
    found = {
        "stuck": _fault(signals, "stuck"),
        "zero": _fault(signals, "set", amount=0.0),
        "maximum": _fault(signals, "set", amount=0.99 * high),
        "half of the maximum": _fault(signals, "set", amount=0.5 * high),
        "sign": _fault(signals, "scaled", amount=-1.0),
        "noise × 10": _fault(signals, "noisy", amount=10.0 * noise),
    }
    for percent in (5, -5, 20, -20):
        found[f"{percent:+d} %"] = _fault(signals, "scaled", amount=1.0 + 0.01 * percent)
        found[f"zero {percent:+d} %"] = _fault(signals, "biased", amount=0.01 * percent * typical)
    found |= ramps(name, FAST)
    for delay in (0.05, 0.2):
        found[f"delay {1e3 * delay:g} ms"] = _fault(signals, "delayed", delay=delay)
    if name == "accumulator_pressure":
        found["stuck at 11 bar"] = _fault(signals, "set", amount=11.0)
    if name in PAIRS:
        found["exchanged"] = _fault(PAIRS[name], "swapped")
    return found


INPUTS: Final = (*ANALOGUE, *FLAGS, "accelerator_position")


def scenario(car: str, road: str, fault: list[Fault], brakings: int = BRAKINGS) -> Scenario:
    """Return the drive of a car of `CARS` on a road of `ROADS`."""
    phases = [Phase(kind="coast", seconds=1.0)]
    accel = SPLIT_ACCEL if road == "split" else ACCEL
    for _ in range(brakings):
        phases += [
            Phase(kind="brake", decel=DECEL, until_speed=3.0),
            Phase(kind="cruise", speed=30.0, accel=accel, until_speed=28.0),
            Phase(kind="coast", seconds=0.6),
        ]
    plant, blending = car.partition("-")[0], CARS[car]
    return Scenario.model_validate(
        {"plant": plant, "initial_speed": 28.0, "blending": blending, "phase": phases, "fault": fault}
        | ROADS[road]
    )


def cells(
    car: str, road: str, name: str, seed: int, wanted: tuple[str, ...] = (), slow: bool = False
) -> list[Cell]:
    """Drive every lie of an input (or the `wanted` ones) by a car drawn from `seed` on a road.

    `slow`: every slow drift instead, in a longer drive.
    """
    config: Config = configured(car)
    brakings = MANY if slow else BRAKINGS
    sound = run(new_loop(scenario(car, road, [], brakings), config, seed))
    found = []
    for lie, fault in (ramps(name, SLOW) if slow else lies(name)).items():
        if wanted and lie not in wanted:
            continue
        loop = new_loop(scenario(car, road, [fault], brakings), config, seed)
        drive = run(loop, seconds=LONGER * sound.t[-1])
        found.append(judge((car, road, name, lie), drive, sound, config.vehicle.mass, tuple(fault.signal)))
    return found


def _one(task: tuple[str, str, str, int, tuple[str, ...], bool]) -> list[Cell]:
    return cells(*task)


def all_cells(slow: bool = False) -> list[Cell]:
    """Drive every input by every car on every road, on all cores; `slow`: slow drifts, on `SLOW_ON`."""
    every = [(*SLOW_ON, name) for name in ANALOGUE] if slow else product(CARS, ROADS, INPUTS)
    tasks = [(*cell, 1, (), slow) for cell in every]
    return [cell for found in run_each("lies", _one, tasks) for cell in found]
