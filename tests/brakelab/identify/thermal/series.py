"""Drives of a lump whose numbers are known, integrated apart from the model that is fitted to them."""

import numpy as np

from brakelab.identify.thermal.fit import Disc
from brakelab.identify.thermal.model import Cooling, Series

XI = 2.2e-4
DRY = (1.8e-3, 1.0e-4)
WET = (2.6e-3, 2.2e-4)
TRUE = Cooling(*DRY, *WET)
AIR = 12.0


def driven(
    seconds: int, seed: int, stops: bool = True, speed: float | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return speed [m/s] and power of one disc [W] every second; `stops`: it rests at the end."""
    random = np.random.default_rng(seed)
    pace = np.repeat(random.uniform(0.0, 38.0, seconds // 120 + 1), 120)[:seconds]
    if speed is not None:
        pace[:] = speed
    elif stops:
        pace[-seconds // 6 :] = 0.0
    power = np.zeros(seconds)
    for begin in range(40, seconds - 10, 60):
        power[begin : begin + 5] = random.uniform(0.3, 1.5) * 900.0 * pace[begin]
    return pace, power


def temperature(pace, power, wet, start: float, xi: float = XI, cooling: Cooling = TRUE) -> np.ndarray:
    """Integrate (3.7) in steps of 10 ms by Heun, shape (n,) at the ends of seconds [degC]."""
    theta, found = start, np.empty(len(pace))
    for k in range(len(pace)):
        rate = cooling[2] + cooling[3] * pace[k] if wet[k] else cooling[0] + cooling[1] * pace[k]
        for _ in range(100):
            first = xi * power[k] - rate * theta
            second = xi * power[k] - rate * (theta + 0.01 * first)
            theta += 0.005 * (first + second)
        found[k] = AIR + theta
    return found


def series(
    seconds: int = 2400,
    seed: int = 1,
    rain: bool = False,
    noise: float = 0.5,
    drift: float = 0.0,
    start: float = 30.0,
    lag: float = 2.0,
    **kind,
) -> Series:
    """Return a drive with two measured front discs; `drift` [K]: a slow error that both share."""
    random = np.random.default_rng([seed, 2])
    pace, power = driven(seconds, seed, **kind)
    wet = np.full(seconds, rain)
    true = temperature(pace, power, wet, start)
    measured = np.full((seconds, 4), np.nan)
    wander = np.zeros(seconds)
    for k in range(1, seconds):
        wander[k] = wander[k - 1] * (1 - 1 / 200) + drift * np.sqrt(2 / 200) * random.standard_normal()
    for i in range(2):
        shown = np.empty(seconds)
        now = true[0]
        for k in range(seconds):
            now += (1.0 - np.exp(-1.0 / lag)) * (true[k] - now)
            shown[k] = now
        measured[:, i] = shown + wander + noise * random.standard_normal(seconds)
    powers = np.column_stack([power, power, 0.0 * power, 0.0 * power])
    return Series("drive", powers, pace, wet, np.full(seconds, AIR), True, measured)


def discs(*drives: Series) -> list[Disc]:
    """Return both front discs of the drives."""
    return [Disc(one, corner) for one in drives for corner in (0, 1)]
