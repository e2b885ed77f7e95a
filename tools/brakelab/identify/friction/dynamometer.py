"""The simulated dynamometer with a pad of `patches` or any law of the plant on it, and its sensors.

Rig, stops, disc and gates are those of `plant/dynamometer.py`; what is recorded is what its sensors show, 200
times a second, from the beginning of a stop to its end (3.2).
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.random import Generator

from brakelab.identify.friction.columns import Uncertainty
from brakelab.identify.friction.patches import bedded, draw_pad, run_pad
from brakelab.identify.friction.recording import RATE, THRESHOLD, Recording
from brakelab.plant.disc import cooling_rate
from brakelab.plant.dynamometer import (
    DRAG,
    LONGEST_S,
    STEP,
    TRACE,
    new_stop,
    run_stop,
)
from brakelab.plant.dynamometer_programme import BAR, DRAG_TIME, KMH, MOST_DRAGS, Gate
from brakelab.plant.jit import Record, kernel
from brakelab.plant.linings import Lining, rig_with
from brakelab.plant.records import RecordArray

PAUSE: Final = 5.0  # s between recorded stops, at least
CYCLE_LAW: Final = "SIM"
"""The law of the lining file whose rig mass the flywheel has."""


class Noise(NamedTuple):
    """Errors of the sensors. Assumption: a good laboratory."""

    torque: float = 6.0  # N m, standard deviation
    torque_gain: float = 0.003  # standard deviation, drawn per rig
    pressure: float = 0.10e5  # Pa
    pressure_zero: float = 0.03e5  # Pa, drawn per rig
    speed: float = 0.05  # rad/s
    temperature: float = 0.5  # K
    thermocouple: float = 0.4  # s, time constant

    def stated(self) -> Uncertainty:
        """Return what a certificate of calibration states of these sensors."""
        return Uncertainty(torque_gain=self.torque_gain, pressure=round(1e-5 * self.pressure_zero, 4))


class Bench:
    """A rig with sensors that are drawn once, and either a drawn pad or a law on it."""

    def __init__(self, rig: RecordArray, random: Generator, noise: Noise, brake: str = "") -> None:
        """`rig` as `rig_with` returns it; `brake` A, B or C draws a pad; else the rig's law rubs."""
        self.rig, self.random, self.noise = rig, random, noise
        self.pad = draw_pad(brake, random) if brake else None
        self.state = bedded(float(rig[0]["ambient"]))
        self.torque_gain = 1.0 + noise.torque_gain * random.standard_normal()
        self.pressure_zero = noise.pressure_zero * random.standard_normal()
        self.temperature = float(rig[0]["ambient"])
        self.time = 0.0

    def run(self, stop: RecordArray, fall: float = 0.0, longest: float = LONGEST_S) -> RecordArray:
        """Return the true trace of a stop, dtype TRACE."""
        if self.pad is None:
            trace = run_stop(self.rig, stop, longest=longest)
        else:
            room = np.empty(round(longest / STEP), TRACE)
            arguments = (self.rig[0], stop[0], fall, self.pad[0], self.state[0], self.random)
            trace = room[: run_pad(*arguments, room, STEP)].copy()
        if len(trace):
            self.temperature = float(trace["temperature"][-1])
        self.time += len(trace) * STEP
        return trace

    def wait(self, seconds: float, speed: float) -> None:
        """Cool the disc in the air for `seconds` at `speed` [m/s]."""
        rig = self.rig[0]
        rate = cooling_rate(rig["cooling"], rig["cooling_by_speed"], speed, rig["wetness"])
        self.temperature = rig["ambient"] + (self.temperature - rig["ambient"]) * np.exp(-rate * seconds)
        self.time += seconds

    def bring_to(self, gate: Gate, wanted: float) -> None:
        """Bring the disc to `wanted` [degC], by drags or by the air."""
        rig = self.rig[0]
        if self.temperature > wanted:
            speed = KMH * gate.cool_speed
            rate = cooling_rate(rig["cooling"], rig["cooling_by_speed"], speed, rig["wetness"])
            excess = (self.temperature - rig["ambient"]) / (wanted - rig["ambient"])
            self.wait(float(np.log(excess) / rate), speed)
        for _ in range(MOST_DRAGS):
            if self.temperature >= wanted - 0.5:
                break
            drag = new_stop(
                DRAG,
                KMH * gate.warm_speed,
                0.0,
                self.temperature,
                pressure=BAR * gate.warm_pressure,
                end_temperature=wanted,
            )
            self.run(drag, longest=DRAG_TIME)
        self.time += PAUSE

    def measure(self, stop: RecordArray, fall: float = 0.0) -> Recording:
        """Return the sensors' recording of a stop."""
        begin = self.time
        return self.sense(self.run(stop, fall), begin)

    def sense(self, trace: RecordArray, begin: float) -> Recording:
        """Return the sensors' readings of a true trace that began at `begin` [s]."""
        dt = float(trace["t"][1] - trace["t"][0])
        every = max(round(1.0 / (RATE * dt)), 1)
        shown = lagged(trace["temperature"], dt, self.noise.thermocouple)[::every]
        seen, noise, draw = trace[::every], self.noise, self.random.standard_normal
        count = len(seen)
        pressure = seen["pressure"] + THRESHOLD * np.minimum(seen["share"] * 2.0, 1.0)
        return Recording(
            begin + seen["t"],
            pressure + self.pressure_zero + noise.pressure * draw(count),
            self.torque_gain * seen["torque"] + noise.torque * draw(count),
            seen["speed"] / float(self.rig[0]["tyre_radius"]) + noise.speed * draw(count),
            shown + noise.temperature * draw(count),
        )


@kernel
def _lag(values: Record, share: float, out: Record) -> None:
    shown = values[0]
    for k in range(len(values)):
        shown += share * (values[k] - shown)
        out[k] = shown


def lagged(values: np.ndarray, dt: float, constant: float) -> np.ndarray:
    """Return `values` behind a first-order lag of `constant` [s]; 0: as they are."""
    out = np.array(values, dtype=float)
    if constant > 0.0:
        _lag(np.ascontiguousarray(values), 1.0 - float(np.exp(-dt / constant)), out)
    return out


def new_bench(
    lining: Lining,
    brake: str,
    seed: int,
    noise: Noise | None = None,
    law: str = "",
    mass: float | None = None,
) -> Bench:
    """Return the rig for brake A, B or C with a pad drawn by `seed`, or with `law` of `lining`.

    `mass` [kg] that the flywheel stands for; without, that of the law.
    """
    random = np.random.default_rng([seed, *brake.encode()])
    rig = rig_with(lining, law or CYCLE_LAW, mass)
    return Bench(rig, random, Noise() if noise is None else noise, "" if law else brake)
