"""Drives of a drawn car with thermocouples on its discs, in closed loop, for the fit of the disc temperature.

The discs that are measured are those of `plant/disc_nodes.py`: ring and hat, heat capacity by temperature,
wind, radiation, a film of water. No lump follows them, and the ECU's torque, which the fit goes by, is not
theirs. Thermocouples rub on the ring: they lag, scatter, and are off by a constant and a factor.
"""

from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.random import Generator

from brakelab.arrays import Array
from brakelab.identify.thermal.model import ROW
from brakelab.identify.thermal.reader import USED, ThermalLog, as_drive
from brakelab.logs.physics.samples import KEPT
from brakelab.plant.disc_nodes import heat_discs, nodes_like, wind
from brakelab.simulation.closed_loop import Loop, new_loop, run_blocks
from brakelab.simulation.configured import configured
from brakelab.simulation.scenario import Scenario, Trace
from brakelab.simulation.simulate import write_columns
from brakelab.simulation.vehicle_bus import TRUTH_COLUMNS
from brakelab.studies.wear.drives import trip_scenario
from ecu.contract.signals import CORNERS, DISC_TEMPERATURE_MEASURED, INPUT_SIGNALS, OUTPUT

GUST: Final = 3.0  # m/s along the car
AIR_AT_WHEEL: Final = 2.0  # K: standard deviation of the air at the discs about that at the sensor, of a day
SAMPLE: Final = 10  # cycles between two samples of a thermocouple
ROW_CYCLES: Final = round(100 * ROW)
RAINFALL: Final = 0.3  # standard deviation of the logarithm of the water on the discs, of a day
LAG: Final = (1.0, 4.0)  # s
NOISE: Final = (0.5, 1.5)  # K
OFFSET: Final = 1.5  # K, standard deviation
GAIN: Final = 0.01
RESOLUTION: Final = 0.1  # K
WEATHER: Final = (("dry", "lively", 18.0, 0.0), ("rain", "usual", 9.0, 1.0))
"""Name, driver, air [degC] and wetness of a trip to identify by."""
BEYOND_TOWN: Final = 0.4
LONGEST_DRIVE: Final = 10_000.0  # s


class Measured(NamedTuple):
    """One drive with its thermocouples."""

    outputs: Array
    """`USED` outputs of the ECU, shape (n, len(USED))."""
    samples: Array
    """`KEPT` inputs, shape (n, len(KEPT))."""
    said: Array
    """Disc temperature by the ECU [degC], every row, shape (m, 4) …"""
    sigma: Array
    """… and its standard deviation [K]."""
    true: Array
    """The rings' [degC], shape (m, 4)."""
    inputs: Array
    """All inputs as decoded, shape (n, N_INPUTS); without rows if not wanted."""

    def drive(self, name: str, air: float) -> ThermalLog:
        """Return it as read from a log."""
        return as_drive(Path(name), self.outputs, self.samples, air)


def thermocouples(true: Array, cycles: int, random: Generator) -> Array:
    """Return readings of thermocouples on discs of `true` temperature, rows to cycles, shape (cycles, 4)."""
    found = np.full((cycles, 4), np.nan)
    at = np.arange(0, cycles, SAMPLE)
    rows = (np.arange(len(true)) + 1.0) * ROW_CYCLES
    for i in range(4):
        lag, noise = random.uniform(*LAG), random.uniform(*NOISE)
        stays = np.exp(-0.01 * SAMPLE / lag)
        shown, now = np.interp(at, rows, true[:, i]), float(true[0, i])
        for k, value in enumerate(shown):
            now = stays * now + (1.0 - stays) * float(value)
            shown[k] = now
        read = shown * (1.0 + GAIN * random.standard_normal()) + OFFSET * random.standard_normal()
        read += noise * random.standard_normal(len(at))
        found[at, i] = RESOLUTION * np.round(read / RESOLUTION)
    return found


def measured_trip(seed: int, driver: str, air: float, wetness: float, from_share: float = 0.0) -> Scenario:
    """Return a trip of real driving whose discs begin as cold as the air [degC].

    `from_share`: it starts at the last stop before that share of the trip, beyond its first town.
    """
    trip = trip_scenario(seed, driver)
    assert trip.trace is not None
    assert trip.trace.speed is not None
    speeds, grade = np.array(trip.trace.speed), np.array(trip.grade)
    stops = speeds[(speeds[:, 1] == 0.0) & (speeds[:, 0] <= from_share * speeds[-1, 0]), 0]
    begin = float(stops[-1])
    speed = speeds[speeds[:, 0] >= begin] - (begin, 0.0)
    slope = np.column_stack([grade[:, 0] - begin, grade[:, 1]])
    slope = np.vstack([(0.0, np.interp(0.0, *slope.T)), slope[slope[:, 0] > 0.0]])
    changed = {
        "trace": Trace(speed=[(float(t), float(v)) for t, v in speed]),
        "grade": [(float(t), float(rise)) for t, rise in slope],
        "wetness": wetness,
        "ambient_temperature": air,
        "initial_disc_temperature": (air, air),
    }
    return trip.model_copy(update=changed)


def drive_measured(
    loop: Loop, seed: int, air: float, wetness: float, start: float, seconds: float, with_inputs: bool = False
) -> Measured:
    """Drive a new loop for at most `seconds` with discs of two nodes at `start` [degC] beside the plant's.

    `seed` draws what the plant's lump does not have: one car has one.
    """
    lump = loop.sides.vehicle.params[0]
    random = np.random.default_rng([seed, 41])
    names = ("heating", "cooling", "cooling_by_speed")
    lumps = [[float(lump[name][i]) for name in names] for i in (0, 2)]
    axles = [nodes_like(heating, still, by_speed, random) for heating, still, by_speed in lumps]
    torque, omega, speed = map(TRUTH_COLUMNS.index, ("brake_torque_fl", "wheel_speed_fl", "vehicle_speed"))
    parts: list[tuple[Array, ...]] = []
    temperature, sure = OUTPUT["disc_temperature_fl"], OUTPUT["sigma_disc_temperature_fl"]
    for block in run_blocks(loop, seconds):
        power = block.truth[:, torque : torque + 4] * np.abs(block.truth[:, omega : omega + 4])
        parts.append(
            (
                block.outputs[:, USED].copy(),
                block.decoded[:, KEPT].copy(),
                block.outputs[:, [*range(temperature, temperature + 4), *range(sure, sure + 4)]],
                power,
                block.truth[:, speed].copy(),
                block.decoded.copy() if with_inputs else block.decoded[:, :0].copy(),
            )
        )
    outputs, samples, said, power, speeds, inputs = (
        np.concatenate(part) for part in zip(*parts, strict=True)
    )
    rows = len(outputs) // ROW_CYCLES
    mean = power[: rows * ROW_CYCLES].reshape(rows, ROW_CYCLES, 4).mean(axis=1)
    pace = speeds[: rows * ROW_CYCLES].reshape(rows, ROW_CYCLES).mean(axis=1)
    day = np.random.default_rng([seed, 43, round(seconds), len(outputs)])
    along = pace + wind(rows, ROW, GUST, day)
    wet = np.full(rows, wetness * np.exp(RAINFALL * day.standard_normal()))
    around = air + AIR_AT_WHEEL * day.standard_normal()
    true = np.column_stack(
        [heat_discs(axles[k], mean[:, 2 * k : 2 * k + 2], along, around, wet, start, ROW) for k in (0, 1)]
    )
    place = KEPT.index(DISC_TEMPERATURE_MEASURED)
    samples[:, place : place + 4] = thermocouples(true, len(outputs), np.random.default_rng([seed, 42]))
    ends = np.arange(1, rows + 1) * ROW_CYCLES - 1
    return Measured(outputs, samples, said[ends, :4], said[ends, 4:], true, inputs)


def write_log(path: Path, driven: Measured) -> None:
    """Write the inputs with the measured temperatures as a signal file; `driven` has its inputs."""
    columns = {signal.name: driven.inputs[:, k] for k, signal in enumerate(INPUT_SIGNALS)}
    place = KEPT.index(DISC_TEMPERATURE_MEASURED)
    columns |= {
        f"disc_temperature_measured_{corner}": driven.samples[:, place + i]
        for i, corner in enumerate(CORNERS)
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    write_columns(path, 0.01 * np.arange(len(driven.inputs), dtype=np.float64), columns, {})


def write_drives(folder: Path, seed: int, seconds: float = LONGEST_DRIVE) -> list[Path]:
    """Write a dry and a rainy trip of the SUV of a seed as `dry.parquet` and `rain.parquet`; return them."""
    config = configured()
    paths = []
    for number, (name, driver, air, wetness) in enumerate(WEATHER):
        path = folder / f"{name}.parquet"
        loop = new_loop(measured_trip(100 * seed + number, driver, air, wetness, BEYOND_TOWN), config, seed)
        write_log(path, drive_measured(loop, seed, air, wetness, air, seconds, with_inputs=True))
        paths.append(path)
    return paths
