"""Sensors over a whole recording: a torque whose zero is off, a column that hangs, a disc cooled by no air.

Torque. Pads that are let go rub with some N m; what a steady reading shows beyond that is the sensor's zero.
Hung. A column that repeats itself to the digit while the brake is applied again and again does not measure.
Air. A disc that is let go cools in proportion to its excess over the air, T' = -(a + b v)(T - T_air): of
recorded cooling from several temperatures follows T_air, which no other column says.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Array
from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.recording import Recording
from brakelab.stretches import stretches
from ecu.errors import UserError
from ecu.output import say

PRESSED: Final = 1.0  # bar above the push-out pressure
LET_GO: Final = 0.3  # bar, below which pads are let go where the push-out pressure is less
RESIDUAL: Final = 5.0  # N m, of pads that are let go
NOTICED: Final = 0.01  # of the torque of most of the braking
FEWEST_SAMPLES: Final = 50
MOVING: Final = 1.0  # rad/s
HUNG: Final = 5  # applications
DATES: Final = 1e7  # s: a longer time is a date's
MUCH: Final = 0.2  # of the greatest pressure or torque, from which on it counts as an application
STOOD_S: Final = 10.0  # all columns
WARMED: Final = 20.0  # K by the work done meanwhile, where a thermocouple hangs
HEATING: Final = 2.4e-4  # K/J, where no disc is given
EVENED_S: Final = 20.0  # after braking, when pad, hat and rubbed face have evened out
LONGEST_S: Final = 60.0  # of cooling, taken as one
FEWEST_COOLINGS: Final = 8
RADIATES: Final = 250.0  # degC of a cooling: hotter ones radiate, as if the air were warmer
SPREAD: Final = 40.0  # K between the coolest and the warmest of them
AIR: Final = np.arange(-40.0, 160.0, 2.0)  # degC
WARMEST_AIR: Final = 55.0  # degC, of a rig's enclosure
DRAWS: Final = 200
QUANTITIES: Final = ("pressure", "torque", "speed", "temperature")


def without_zero(recording: Recording, described: Columns, where: str) -> Recording:
    """Return a recording whose torque is zero where the brake is let go; what is taken off is said."""
    pressure, push_out = 1e-5 * recording.pressure, described.rig.push_out_pressure
    let_go = np.isfinite(recording.torque) & (pressure < max(push_out, LET_GO))
    braked = recording.torque[pressure > push_out + PRESSED]
    if np.count_nonzero(let_go) < FEWEST_SAMPLES or not len(braked):
        return recording
    low, zero, high = np.percentile(recording.torque[let_go], (10.0, 50.0, 90.0))
    least = max(RESIDUAL, NOTICED * float(np.nanmedian(np.abs(braked))))
    if abs(zero) < least or high - low > abs(zero):
        return recording
    at = since(recording.time, int(np.argmax(let_go)))
    say(
        f"{where}: {described.columns.torque[0]} shows {zero:+.1f} N m where the brake is let go (first at "
        f"{at:.1f} s): taken off as its zero; set it before a run"
    )
    return recording._replace(torque=recording.torque - zero)


def refuse_hung(whole: Recording, described: Columns, where: str, of: tuple[str, ...] = QUANTITIES) -> None:
    """Refuse a recording in which a column `of` quantities stands still while the brake works.

    Raises:
        UserError: names the column, its value and from when to when.
    """
    moving = np.abs(whole.speed) > MOVING
    torque = np.abs(whole.torque)
    cycles, by_torque = (np.cumsum(_begun(_much(values) & moving)) for values in (whole.pressure, torque))
    rows = np.stack([np.asarray(getattr(whole, name)) for name in QUANTITIES])
    same = rows[:, 1:] == rows[:, :-1]
    steps = np.diff(whole.time)
    heating = described.disc.heating or HEATING
    warmed = np.concatenate([[0.0], np.cumsum(heating * (torque * np.abs(whole.speed))[1:] * steps)])
    for name, stays in zip(QUANTITIES, same, strict=True):
        if name not in of:
            continue
        counted = by_torque if name == "pressure" else cycles
        for begin, end in stretches(stays):
            if counted[end] - counted[begin] < HUNG:
                continue
            if name == "temperature" and warmed[end] - warmed[begin] < WARMED:
                continue
            value = float(getattr(whole, name)[begin])
            unit = {"pressure": "Pa", "torque": "N m", "speed": "rad/s", "temperature": "°C"}[name]
            over = f"over {counted[end] - counted[begin]} brake applications"
            raise _hangs(whole, described, where, name, f"{value:.4g} {unit}", over, int(begin), int(end))
    for begin, end in stretches(same.all(axis=0) & moving[1:]):
        if whole.time[end] - whole.time[begin] > STOOD_S:
            raise _hangs(whole, described, where, "time", "all the same values", "", int(begin), int(end))


def since(time: Array, place: int) -> float:
    """Return the time of a sample [s] as its file has it, of dates from the first one."""
    return float(time[place] - (time[0] if abs(time[0]) > DATES else 0.0))


def _much(values: Array) -> NDArray[np.bool_]:
    return np.asarray(values > MUCH * float(np.nanpercentile(values, 99.9)))


def _begun(on: NDArray[np.bool_]) -> NDArray[np.bool_]:
    return on & ~np.concatenate([[False], on[:-1]])


def _hangs(
    whole: Recording, described: Columns, where: str, name: str, what: str, over: str, begin: int, end: int
) -> UserError:
    column = getattr(described.columns, name)[0]
    span = f"from {since(whole.time, begin):.1f} to {since(whole.time, end):.1f} s"
    remedy = "it hangs; leave this file out, or cut these rows where nothing was weighed over them"
    said = f"stands at {what} {span}" if over else f"{what} {span} while the disc turns"
    return UserError(where, column, f"{said}{', ' + over if over else ''}: {remedy}")


def refuse_air(whole: Recording, described: Columns, where: str) -> None:
    """Refuse disc temperatures that cool towards a temperature which no air has.

    Raises:
        UserError: names the column and the temperature.
    """
    found = coolings(whole, described)
    if len(found) < FEWEST_COOLINGS or np.ptp(found[:, 1]) < SPREAD:
        return
    random = np.random.default_rng(0)
    drawn = [air_of(found[random.integers(len(found), size=len(found))]) for _ in range(DRAWS)]
    low, middle = np.percentile(drawn, (2.5, 50.0))
    if low > WARMEST_AIR:
        remedy = (
            f"cools towards {middle:.0f} °C (above {low:.0f}) where the brake is let go, and no air is as "
            "warm: correct its zero by a disc that has stood overnight, or take another thermocouple"
        )
        raise UserError(where, described.columns.temperature[0], remedy)


def coolings(whole: Recording, described: Columns) -> Array:
    """Return rate [K/s], mean temperature [degC] and speed [m/s] of recorded coolings, shape (n, 3)."""
    free = 1e-5 * whole.pressure < described.rig.push_out_pressure + PRESSED
    radius = described.brake.tyre_radius
    found = []
    for begin, end in stretches(free):
        time, heat = whole.time[begin:end], whole.temperature[begin:end]
        if not begin or len(time) < FEWEST_SAMPLES or np.diff(time).max() > 1.0:
            continue
        let_go_s = time - time[0]
        for first in np.arange(EVENED_S, let_go_s[-1] - 0.5 * LONGEST_S, LONGEST_S):
            part = (let_go_s >= first) & (let_go_s < first + LONGEST_S)
            slope, _ = np.polyfit(let_go_s[part], heat[part], 1)
            if (mean := float(heat[part].mean())) > RADIATES:
                continue
            speed = radius * float(np.abs(whole.speed[begin:end][part]).mean())
            found.append((-slope, mean, speed))
    return np.array(found).reshape(-1, 3)


def air_of(found: Array) -> float:
    """Return the temperature [degC] towards which discs cool, by `coolings`."""
    rate, heat, speed = found.T
    excess = heat - AIR[:, None]
    by_speed = excess * speed
    one, both, other = (np.sum(each, axis=1) for each in (excess**2, excess * by_speed, by_speed**2))
    with_one, with_other = excess @ rate, by_speed @ rate
    norm = np.maximum(one * other - both**2, 1e-9 * one * other + 1e-12)
    still = (other * with_one - both * with_other) / norm
    windy = (one * with_other - both * with_one) / norm
    off = rate - still[:, None] * excess - windy[:, None] * by_speed
    return float(AIR[int(np.argmin(np.sum(off**2, axis=1)))])
