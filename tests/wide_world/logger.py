"""What a logger makes of a stranger's drive: decoded signals, late, coarse, in part and out of scale.

Each channel has its own rate and phase. A sample is value(t - delay) behind a first-order lag, scaled,
shifted, noisy, in steps; drop-outs leave some away, gaps all of a stretch. Rows are the union of all
stamps, null where a channel has no new sample.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray
from scipy.signal import lfilter

from .route import G, Values
from .state import ROW

CORNERS = ("fl", "fr", "rl", "rr")


class Channel(NamedTuple):
    """How a quantity is sampled."""

    rate: float  # Hz, 0: not at all
    noise: float  # standard deviation
    step: float  # of its numbers
    delay: float = 0.0  # s
    lag: float = 0.0  # s, first order


class Logger(NamedTuple):
    """A data logger and its sensors."""

    wheel: Channel  # rad/s
    speed: Channel  # m/s
    pressure: Channel  # bar
    accel: Channel  # m/s^2
    accelerator: Channel  # %
    temperature: Channel  # degC
    motor: Channel  # N m
    speed_for_wheels: bool  # the only speed stands for all wheels too
    speed_of_wheels: bool  # it is counted at the wheels in front, not received by GPS
    speed_scale: float
    pressure_scale: tuple[float, float]  # front, rear
    pressure_zero: tuple[float, float]  # bar
    four_pressures: bool  # of the callipers, not of the lines
    floored: bool  # no pressure below zero
    accel_scale: float
    accel_zero: float  # m/s^2
    lateral_scale: float
    pitch_gradient: float  # rad per m/s^2
    mounting: float  # rad, the accelerometer turned to the left
    rest: float  # %, of the accelerator
    motor_scale: float  # reported over true, 0: not reported
    abs_reported: bool
    drop: float  # share of samples lost
    gaps: tuple[float, ...]  # share of the drive at which each gap of seconds begins
    clock: float  # relative error of the logger's clock
    start: float  # s, its first stamp
    seed: int


def draw_logger(letter: str, electric: bool, rng: np.random.Generator) -> Logger:
    """Return a logger of a set; that of an electric car is the car's own bus."""
    pressure_rate = {"A": (20.0, 50.0, 100.0), "B": (20.0, 25.0, 50.0), "D": (20.0,)}.get(
        letter, (50.0, 100.0)
    )
    accel_rate = {"A": (10.0, 50.0), "B": (20.0, 25.0, 50.0), "D": (20.0,), "F": (100.0,)}.get(
        letter, (20.0, 50.0)
    )
    wheel_rate = {"A": 100.0, "B": 0.0, "C": 0.0, "D": 20.0}.get(letter, 100.0)
    speed = Channel(0.0, 0.0, 0.0)
    if letter == "B":
        lag = rng.uniform(0.16, 0.4)
        speed = Channel(float(rng.choice([4.6, 5.0, 10.0])), 0.1, 0.03, 0.5 * lag, 0.5 * lag)
    elif letter == "C":
        speed = Channel(float(rng.choice([5.0, 10.0, 20.0])), 0.1, 0.03, rng.uniform(0.08, 0.3))
    elif letter == "F":
        speed = Channel(10.0, 0.05, 0.01, rng.uniform(0.05, 0.2))
    wrong = 0.05 if letter == "E" else 0.01
    reports = electric or (letter in "ADE" and bool(rng.random() < 0.3))
    pressure_step, accel_step = float(rng.choice([0.05, 0.1, 0.5])), float(rng.choice([0.01, 0.1]))
    return Logger(
        wheel=Channel(wheel_rate, rng.uniform(0.03, 0.3), float(rng.choice([0.01, 0.06, 0.2]))),
        speed=speed,
        pressure=Channel(float(rng.choice(pressure_rate)), rng.uniform(0.05, 0.5), pressure_step),
        accel=Channel(
            float(rng.choice(accel_rate)), rng.uniform(0.1, 0.5), accel_step, lag=rng.uniform(0.01, 0.1)
        ),
        accelerator=Channel(float(rng.choice([10.0, 20.0, 50.0])), 0.0, 0.5),
        temperature=Channel(5.0 if letter == "D" else 0.0, 1.0, 1.0, 0.0, 0.5),
        motor=Channel(100.0 if electric else 20.0 if reports else 0.0, 3.0, 1.0),
        speed_for_wheels=letter == "B",
        speed_of_wheels=bool(rng.random() < 0.5) and letter == "B",
        speed_scale=rng.normal(1.0, 0.01),
        pressure_scale=(1.0 + rng.uniform(-wrong, wrong), 1.0 + rng.uniform(-wrong, wrong)),
        pressure_zero=(rng.normal(0.0, 0.5), rng.normal(0.0, 0.5)),
        four_pressures=electric,
        floored=bool(rng.random() < 0.25),
        accel_scale=rng.normal(1.0, 0.015),
        accel_zero=rng.normal(0.0, 0.1),
        lateral_scale=rng.normal(1.0, 0.015),
        pitch_gradient=rng.uniform(0.0005, 0.0025) if not electric else rng.uniform(0.0025, 0.0045),
        mounting=rng.normal(0.0, 0.015),
        rest=2.5 if rng.random() < 0.2 else 0.0,
        motor_scale=0.0 if not reports else rng.normal(1.0, 0.04) if electric else 2.5,
        abs_reported=electric and bool(rng.random() < 0.5),
        drop=float(rng.choice([0.0, 0.002, 0.02])),
        gaps=tuple(rng.uniform(0.1, 0.9, int(rng.integers(0, 3)))) if rng.random() < 0.3 else (),
        clock=rng.normal(0.0, 5e-5),
        start=float(rng.choice([0.0, 0.0, 1234.5])),
        seed=int(rng.integers(2**31)),
    )  # fmt: skip


def _sample(values: Values, channel: Channel, rng: np.random.Generator) -> tuple[Values, Values]:
    """Return true stamps [s] and samples of a column of 10 ms rows."""
    length = (len(values) - 1) * ROW
    stamps = np.arange(rng.uniform(0.0, 1.0 / channel.rate), length, 1.0 / channel.rate)
    if channel.lag > 0.0:
        keep = np.exp(-ROW / channel.lag)
        values = lfilter([1.0 - keep], [1.0, -keep], values, zi=[keep * values[0]])[0]
    late = np.interp(stamps - channel.delay, np.arange(len(values)) * ROW, values)
    noisy = late + channel.noise * rng.normal(size=len(late))
    return stamps, np.round(noisy / channel.step) * channel.step if channel.step > 0.0 else noisy


def record(rows: NDArray[np.void], logger: Logger, rolling_radius: Values) -> dict[str, Values]:
    """Return the decoded signals: `t` [s] and inputs by the contract's names, NaN where no sample is new.

    Args:
        rows: of `car.drive`.
        logger: the logger.
        rolling_radius: by which a speed is called a wheel speed [m], shape (4,).
    """
    rng = np.random.default_rng(logger.seed)
    samples: dict[str, tuple[Values, Values]] = {}
    kerb = rows["kerb"] > 0.0
    shaken = rng.normal(size=len(rows)) * kerb
    if logger.wheel.rate > 0.0:
        for i, corner in enumerate(CORNERS):
            column = rows["omega"][:, i] * (1.0 + 0.01 * shaken)
            samples[f"wheel_speed_{corner}"] = _sample(column, logger.wheel, rng)
    if logger.speed.rate > 0.0:
        wheels = rows["omega"][:, :2].mean(axis=1) * rolling_radius[0]
        speed = _sample(
            logger.speed_scale * (wheels if logger.speed_of_wheels else rows["speed"]), logger.speed, rng
        )
        samples["vehicle_speed"] = speed
        if logger.speed_for_wheels:
            for i, corner in enumerate(CORNERS):
                samples[f"wheel_speed_{corner}"] = speed[0], speed[1] / rolling_radius[i]
    for axle in range(2):
        read = rows["line"][:, axle] * logger.pressure_scale[axle] + logger.pressure_zero[axle]
        sample = _sample(read, logger.pressure, rng)
        for corner in CORNERS[2 * axle : 2 * axle + 2]:
            if logger.four_pressures:
                sample = _sample(read, logger.pressure, rng)
            samples[f"calliper_pressure_{corner}"] = sample
            if logger.floored:
                samples[f"calliper_pressure_{corner}"] = sample[0], np.maximum(sample[1], 0.0)
    force = rows["specific_force"]
    pitch = -logger.pitch_gradient * force
    along = force * np.cos(pitch) - G * np.sin(pitch)
    turned = along * np.cos(logger.mounting) + rows["lateral"] * np.sin(logger.mounting)
    accel = logger.accel_scale * turned + logger.accel_zero + 6.0 * shaken
    samples["accel_x"] = _sample(accel, logger.accel, rng)
    samples["accel_y"] = _sample(rows["lateral"] * logger.lateral_scale + 4.0 * shaken, logger.accel, rng)
    samples["yaw_rate"] = _sample(rows["yaw_rate"], logger.accel._replace(noise=0.01, step=0.001), rng)
    pedal = logger.rest + (100.0 - logger.rest) * rows["throttle"]
    samples["accelerator_position"] = _sample(pedal, logger.accelerator, rng)
    if logger.motor.rate > 0.0:
        for i, corner in enumerate(CORNERS):
            if np.any(rows["engine"][:, i]):
                reported = rows["engine"][:, i] * logger.motor_scale
                samples[f"motor_torque_{corner}"] = _sample(reported, logger.motor, rng)
    if logger.temperature.rate > 0.0:
        for i in (0, 2):
            name = f"disc_temperature_measured_{CORNERS[i]}"
            samples[name] = _sample(rows["temperature"][:, i], logger.temperature, rng)
    if logger.abs_reported:
        active = (rows["cut"].min(axis=1) < 0.97).astype(float)
        samples["abs_active"] = _sample(active, Channel(100.0, 0.0, 1.0), rng)
        samples["steering_angle"] = _sample(rows["steering"], Channel(100.0, 0.002, 0.001), rng)
    return _merge(samples, logger, len(rows) * ROW, rng)


def _merge(
    samples: dict[str, tuple[Values, Values]], logger: Logger, length: float, rng: np.random.Generator
) -> dict[str, Values]:
    kept = {}
    silent = [(share * length, share * length + rng.uniform(1.0, 5.0)) for share in logger.gaps]
    lost: dict[int, NDArray[np.bool_]] = {}
    for name, (stamps, values) in samples.items():
        # channels of one message are lost together
        keep = lost.setdefault(id(stamps), rng.random(len(stamps)) >= logger.drop)
        for begin, end in silent:
            keep = keep & ((stamps < begin) | (stamps > end))
        kept[name] = np.round((logger.start + stamps * (1.0 + logger.clock)) * 1e3) / 1e3, values, keep
    t = np.unique(np.concatenate([stamps[keep] for stamps, _, keep in kept.values()]))
    columns = {"t": t}
    for name, (stamps, values, keep) in kept.items():
        columns[name] = np.full(len(t), np.nan)
        columns[name][np.searchsorted(t, stamps[keep])] = values[keep]
    return columns


def truth(rows: NDArray[np.void], logger: Logger) -> dict[str, Values]:
    """Return true columns by the contract's names, 10 ms a row, in the logger's time."""
    columns = {
        "t": logger.start + np.arange(len(rows)) * ROW * (1.0 + logger.clock),
        "vehicle_speed": rows["speed"],
        "accel_x_road": rows["specific_force"],
    }
    for i, corner in enumerate(CORNERS):
        columns |= {
            f"slip_{corner}": -rows["slip"][:, i],
            f"wheel_force_x_{corner}": -rows["force"][:, i],
            f"wheel_force_z_{corner}": rows["load"][:, i],
            f"mu_b_{corner}": rows["mu"][:, i],
            f"brake_torque_{corner}": rows["torque"][:, i],
            f"disc_temperature_{corner}": rows["temperature"][:, i],
            f"wheel_speed_{corner}": rows["omega"][:, i],
        }
    return columns


def write(columns: dict[str, Values], path: Path) -> None:
    """Write columns as Parquet, NaN as null."""
    pq.write_table(pa.table({k: pa.array(v, from_pandas=True) for k, v in columns.items()}), path)
