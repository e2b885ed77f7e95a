"""One input lies in closed loop, armed: how far the brakes stray, and when the ECU says which input it is.

Twelve brakings of 4 m/s^2 from 28 m/s by an automated demand; from `BEGIN` on one input, or those of one
frame, lie. Brake force is that of linings and motors,

    F = sum (T_b + max(T_m, 0)) / r_w / m                  true values, m: of the configuration

over that of the same car without the lie, in the braking of the same number and at the same time in it, from
`SETTLED_S` on and above `LOWEST_SPEED`. A loss lasts for `w` where F stays below a share that long:

    least over w = min over windows of w of the greatest F in the window
"""

from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from multiprocessing import get_context
from typing import Final, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from brakelab.results.progress import tracked
from brakelab.simulation.closed_loop import Drive, new_loop, run
from brakelab.simulation.faults import Fault
from brakelab.simulation.scenario import Phase, Scenario
from brakelab.stretches import stretches
from ecu.contract.faults import ACCEL_IMPLAUSIBLE, IMPLAUSIBLE, fault_mask
from ecu.contract.signals import CORNERS, INPUT_SIGNALS
from ecu.settings.config import Config, load_config
from ecu.settings.resources import resource

Vector = NDArray[np.float64]

BEGIN: Final = 20.0  # s
BRAKINGS: Final = 12
DECEL: Final = 4.0  # m/s^2
SETTLED_S: Final = 0.5
LOWEST_SPEED: Final = 5.0  # m/s
SHORT_S, LONG_S = 0.3, 2.0
"""A loss of more than 10 % may last for the one, of more than 3 % for the other."""
COSTS: Final = 0.03  # of the force

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
    for rate in (0.1, 0.5, 1.0, -0.1, -0.5, -1.0):
        relative = {"rate": 0.01 * rate, "limit": 0.5}
        found[f"ramp {rate:+g} %/s"] = _fault(signals, "scale_drifting", **relative)
        moved = {"rate": 0.01 * rate * typical, "limit": 0.5 * typical}
        found[f"zero {rate:+g} %/s"] = _fault(signals, "drifting", **moved)
    for delay in (0.05, 0.2):
        found[f"delay {1e3 * delay:g} ms"] = _fault(signals, "delayed", delay=delay)
    if name == "accumulator_pressure":
        found["stuck at 11 bar"] = _fault(signals, "set", amount=11.0)
    if name in PAIRS:
        found["exchanged"] = _fault(PAIRS[name], "swapped")
    return found


INPUTS: Final = (*ANALOGUE, *FLAGS, "accelerator_position")


class Cell(NamedTuple):
    """One car on one road, one of whose inputs lies."""

    car: str
    road: str
    input: str
    lie: str
    least_short: float
    """Brake force over that of the sound car: what it falls below for `SHORT_S`."""
    least_long: float
    """For `LONG_S`."""
    most_long: float
    """What it stays above for `LONG_S`."""
    mean: float
    named_s: float
    """From the beginning of the lie until its fault bit; NaN: never."""
    late_s: float
    """From the beginning of the first 2 s that cost more than `COSTS`; NaN: nothing costs, or never named."""
    costs: bool
    degraded: float
    """Share of the time in mode degraded or failed."""
    locked_s: float
    """A wheel slips by more than 0.3 above 5 m/s, beyond what it does in the sound car."""
    others: int
    """Mask of the faults that neither name the input nor are there in the sound car."""


def scenario(car: str, road: str, fault: list[Fault]) -> Scenario:
    """Return the drive of a car of `CARS` on a road of `ROADS`."""
    phases = [Phase(kind="coast", seconds=1.0)]
    for _ in range(BRAKINGS):
        phases += [
            Phase(kind="brake", decel=DECEL, until_speed=3.0),
            Phase(kind="cruise", speed=30.0, accel=5.0, until_speed=28.0),
            Phase(kind="coast", seconds=0.6),
        ]
    plant, blending = car.partition("-")[0], CARS[car]
    return Scenario.model_validate(
        {"plant": plant, "initial_speed": 28.0, "blending": blending, "phase": phases, "fault": fault}
        | ROADS[road]
    )


def brake_force(drive: Drive, mass: float) -> Vector:
    """Return the true force of all brakes and motors over the mass [m/s^2], shape (n,)."""
    truth = drive.truth
    wheels = [
        (truth[f"brake_torque_{c}"] + np.maximum(truth[f"motor_torque_{c}"], 0.0))
        / truth[f"rolling_radius_{c}"]
        for c in CORNERS
    ]
    force: Vector = np.sum(wheels, axis=0) / mass
    return force


def brakings(drive: Drive) -> list[slice]:
    """Return the rows of each braking, from the demand's full value to `LOWEST_SPEED`."""
    full = (drive.truth["decel_demand"] > 0.95 * DECEL) & (drive.truth["vehicle_speed"] > LOWEST_SPEED)
    return [slice(begin, end) for begin, end in stretches(full).tolist() if end - begin > 100]


def _shares(drive: Drive, sound: Drive, mass: float) -> Iterator[tuple[Vector, Vector]]:
    """Yield time [s] and force over the sound car's of each braking after the lie began."""
    ours, theirs = brake_force(drive, mass), brake_force(sound, mass)
    for rows, reference in zip(brakings(drive), brakings(sound), strict=False):
        settled = round(100 * SETTLED_S)
        place = np.arange(rows.start + settled, rows.stop)
        place = place[drive.t[place] > BEGIN]
        if not len(place):
            continue
        beside = np.minimum(reference.start + place - rows.start, reference.stop - 1)
        yield drive.t[place], ours[place] / theirs[beside]


def _lasting(shares: Vector, seconds: float, least: bool) -> Vector:
    """Return, per window of `seconds`, the bound that all its shares keep to; empty where none is as long."""
    length = round(100 * seconds)
    if len(shares) < length:
        return np.empty(0)
    windows = sliding_window_view(shares, length)
    bound: Vector = windows.max(axis=1) if least else windows.min(axis=1)
    return bound


def _masks(drive: Drive) -> NDArray[np.int64]:
    return np.asarray(fault_mask(drive.outputs), np.int64)


def judge(
    name: tuple[str, str, str, str], drive: Drive, sound: Drive, mass: float, signals: tuple[str, ...]
) -> Cell:
    """Return the cell `name` (car, road, input, lie) of a drive beside that of the sound car."""
    short, long, most, everything, first = [1.0], [1.0], [1.0], [1.0], np.inf
    for t, shares in _shares(drive, sound, mass):
        short.extend(_lasting(shares, SHORT_S, True))
        low, high = _lasting(shares, LONG_S, True), _lasting(shares, LONG_S, False)
        long.extend(low)
        most.extend(high)
        everything.extend(shares)
        beyond = np.flatnonzero((low < 1.0 - COSTS) | (high > 1.0 + COSTS))
        if len(beyond):
            first = min(first, float(t[beyond[0]]))
    after = drive.t >= BEGIN
    masks, usual = _masks(drive)[after], int(np.bitwise_or.reduce(_masks(sound)))
    own = sum(IMPLAUSIBLE.get(signal, 0) for signal in signals)
    own |= ACCEL_IMPLAUSIBLE if "accel_x" in signals else 0
    named = np.flatnonzero(masks & own)
    begin = float(drive.t[after][named[0]]) if len(named) else np.nan
    mode = drive.outputs["mode"][after]
    return Cell(
        *name,
        float(min(short)),
        float(min(long)),
        float(max(most)),
        float(np.mean(everything)),
        begin - BEGIN,
        max(begin - first, 0.0) if np.isfinite(first) else np.nan,
        bool(np.isfinite(first)),
        float(np.mean(mode >= 3.0)),
        max(_locked(drive) - _locked(sound), 0.0),
        int(np.bitwise_or.reduce(masks)) & ~own & ~usual,
    )


def _locked(drive: Drive) -> float:
    fast = drive.truth["vehicle_speed"] > LOWEST_SPEED
    return 0.01 * max(float(np.sum(fast & (drive.truth[f"slip_{c}"] < -0.3))) for c in CORNERS)


def cells(car: str, road: str, name: str, seed: int, wanted: tuple[str, ...] = ()) -> list[Cell]:
    """Drive every lie of an input (or the `wanted` ones) by a car drawn from `seed` on a road."""
    config: Config = load_config(resource(f"config/{car}.toml"))
    sound = run(new_loop(scenario(car, road, []), config, seed))
    found = []
    for lie, fault in lies(name).items():
        if wanted and lie not in wanted:
            continue
        drive = run(new_loop(scenario(car, road, [fault]), config, seed))
        found.append(judge((car, road, name, lie), drive, sound, config.vehicle.mass, tuple(fault.signal)))
    return found


def _one(task: tuple[str, str, str, int]) -> list[Cell]:
    return cells(*task)


def all_cells(seed: int = 1) -> list[Cell]:
    """Drive every input by every car on every road, on all cores."""
    tasks = [(*cell, seed) for cell in product(CARS, ROADS, INPUTS)]
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        return [cell for found in tracked(pool.map(_one, tasks), "lies", len(tasks)) for cell in found]
