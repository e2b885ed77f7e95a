"""Doubts a recording: units and sensors that would make no physical sense, one line each with the remedy.

Three numbers of a recording have to fit known physics, and every usual mistake moves them differently:

    friction  median of T / (2 A_k r_eff p)                    0.42, give or take a third
    inertia   torque impulse over the loss of speed            of the flywheel, or 60 kg m^2 within a factor 4
    heating   rise of the disc over the friction energy, K/J   of the disc, or 0.96 / (8 kg 500 J/(kg K))

What a disc is heated by lies between its rise at the end of a stop, when the surface is ahead of the rest or
the thermocouple behind it, and that some seconds later, when both have evened out and the air has cooled it.

Recordings of friction have a file of columns, in which a unit is mended; blocks of wear and trips of dust
have fixed units, to which a column is converted (`refuse_units`).
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Vector
from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.recording import Recording
from brakelab.identify.friction.sensors import refuse_air, refuse_hung
from brakelab.identify.friction.stops import Stops, find_stops
from brakelab.identify.units import UNITS
from brakelab.simulation.configured import with_keys
from ecu.errors import UserError
from ecu.output import say

USUAL: Final = (0.42, 60.0, 2.4e-4)  # friction, inertia [kg m^2], heating [K/J]
TOLERANCE: Final = (0.33, 1.4, 0.55)  # standard deviations of the logarithms, where nothing is given
GIVEN: Final = 0.15  # likewise where the file of columns gives the number
CONFIGURED: Final = 0.3  # likewise where CONFIG does, of any disc of this car
DOUBTFUL: Final = 2.0  # standard deviations
CLEARER: Final = 4.0  # a mistake must explain the numbers better by this much, in squares
HIGHEST_TEMPERATURE: Final = 900.0  # degC
LOWEST_TEMPERATURE: Final = -40.0  # degC
WARM: Final = 250.0  # degC; no programme keeps a disc above this all the time
STILL: Final = 1.0  # K in every application, of a thermocouple that does not see the disc
PRESSED: Final = 1.0  # bar
EVENED_S: Final = 10.0  # after a stop
RECORDED_S: Final = 1.0  # between samples; what is further apart was not recorded
UNLIKE: Final = 1.3  # times the heating of the other recordings: rain and wind make a fifth, °F 1.8
USUAL_DELAY_S: Final = 2.5  # s behind the braking; a thermocouple that rubs on the disc lags by less than 1 s
LONGEST_DELAY_S: Final = 20.0
STEP_S: Final = 0.1
CLEARLY: Final = 1.3  # times what it follows at once
SLIGHT: Final = 0.2  # least of what is left of the rise at the end of a stop
SAMPLES: Final = (1e-4, 0.05)  # s between them, least and greatest


class Mistake(NamedTuple):
    """A mistake of units: its factors on the three numbers, and its remedy."""

    friction: float
    inertia: float
    heating: float
    place: str
    remedy: str


def mistakes(columns: Columns) -> list[Mistake]:
    """Return the mistakes that a recording so described can hold: other units, pads, another thermocouple."""
    found: list[Mistake] = []
    for quantity, units in UNITS.items():
        given = columns.columns.model_dump()[quantity][1]
        for unit, factor in units.items():
            ratio = _factor(factor, columns) / _factor(units[given], columns)
            effect = _effect(quantity, ratio)
            if abs(ratio - 1.0) > 1e-6 and effect not in [mistake[:3] for mistake in found]:
                found.append(Mistake(*effect, quantity, f'reads like {unit}: give the unit "{unit}"'))
    if columns.rig.pads == 2:
        found.append(Mistake(0.5, 0.5, 2.0, "torque", "reads like that of one pad: set pads = 1 in [rig]"))
    else:
        found.append(Mistake(2.0, 2.0, 0.5, "torque", "reads like that of both pads: set pads = 2 in [rig]"))
    plate = "rises like a backing plate's: take the column of the disc"
    return [*found, Mistake(1.0, 1.0, 0.2, "temperature", plate)]


def _factor(factor: float, columns: Columns) -> float:
    return factor if factor > 0.0 else -factor / columns.brake.tyre_radius


def _effect(quantity: str, ratio: float) -> tuple[float, float, float]:
    """Return the factors on friction, inertia and heating; `ratio`: of the true unit to the given."""
    return {
        "pressure": (ratio, 1.0, 1.0),
        "torque": (1.0 / ratio, 1.0 / ratio, ratio),
        "speed": (1.0, ratio, ratio),
        "temperature": (1.0, 1.0, 1.0 / ratio),
        "time": (1.0, 1.0 / ratio, ratio),
    }[quantity]


class Numbers(NamedTuple):
    """The three numbers."""

    friction: float
    inertia: float
    heating: float
    """By the rise at the end of the stops."""
    evened: float
    """By that some seconds later."""


def numbers_of(applications: Sequence[Recording], columns: Columns, whole: Recording) -> Numbers:
    """Return the three numbers of brake applications, by those in which the car slows, if any does.

    `whole`: the recording that they are of, with what is between them.
    """
    slowing = [one for one in applications if one.speed[-1] < 0.9 * one.speed[0]]
    disc, brake = columns.disc, columns.brake
    push_out, lever = 1e5 * columns.rig.push_out_pressure, 2.0 * brake.piston_area * brake.effective_radius
    friction, inertia, work, rise = [], [], [], []
    for one in slowing or applications:
        pressed = float(np.sum(np.maximum(one.pressure - push_out, 0.0)))
        friction.append(float(np.sum(one.torque)) / max(lever * pressed, 1e-9))
        lost = float(one.speed[0] - one.speed[-1])
        inertia.append(float(np.trapezoid(one.torque, one.time)) / lost if lost > 0.0 else USUAL[1])
        rate = disc.cooling + disc.cooling_by_speed * brake.tyre_radius * float(one.speed.mean())
        kept = max(1.0 - 0.5 * rate * float(one.time[-1] - one.time[0]), 0.3)
        work.append(kept * float(np.trapezoid(one.torque * one.speed, one.time)))
        rise.append(float(one.temperature[-1] - one.temperature[0]))
    ends = np.array([one.time[-1] for one in slowing or applications])
    after = _evened(ends, columns, whole)
    heating, evened = _heating(np.array(work), np.array(rise), after)
    return Numbers(float(np.median(friction)), float(np.median(inertia)), heating, evened)


def thermocouple_delay(whole: Recording) -> float:
    """Return how long after the friction power the disc of a recording warms [s]; 0: about at once."""
    known = np.isfinite(whole.temperature)
    step = max(STEP_S, float(np.median(np.diff(whole.time))))
    grid = np.arange(whole.time[0], whole.time[-1], step)
    power = np.interp(grid, whole.time, whole.torque * whole.speed)
    power -= power.mean()
    rate = np.gradient(np.interp(grid, whole.time[known], whole.temperature[known]))
    lags = np.arange(min(round(LONGEST_DELAY_S / step), len(grid) - 1))
    if len(lags) * step <= USUAL_DELAY_S or step > USUAL_DELAY_S:
        return 0.0
    follows = np.array([power[: len(grid) - lag] @ rate[lag:] for lag in lags])
    best = int(np.argmax(follows))
    soon = follows[: round(USUAL_DELAY_S / step)].max()
    return step * best if best * step > USUAL_DELAY_S and follows[best] > CLEARLY * soon else 0.0


def say_unlike(names: Sequence[str], found: Sequence[Numbers], where: str, what: str) -> None:
    """Say of which recordings of one disc, blocks or trips, the work heats it as it does in no other."""
    high = np.maximum([max(one.heating, one.evened) for one in found], 1e-9)
    low = np.maximum([min(one.heating, one.evened) for one in found], SLIGHT * high)
    bounds = np.column_stack([low, high])
    middle = np.sqrt(bounds.prod(axis=1))
    usual = float(np.median(middle))
    for name, (least, most), own in zip(names, bounds / usual, middle / usual, strict=True):
        if least > UNLIKE or most < 1.0 / UNLIKE:
            say(
                f"{where}: {what} {name}: the same work heats its disc {own:.1f} times as much as in the "
                f"other {what}s; check units and scales of temperature, torque and speed"
            )


def _heating(work: Vector, rise: Vector, after: Vector) -> tuple[float, float]:
    """Return what the harder half of stops heats the disc by [K/J], at their ends and `after` them [K]."""
    hard = work >= np.median(work)
    done = max(float(np.sum(work[hard])), 1e-9)
    return float(np.sum(rise[hard])) / done, float(np.sum((rise + after)[hard])) / done


def _evened(ends: Vector, columns: Columns, whole: Recording) -> Vector:
    """Return what the disc warms by after the `ends` [s] of stops until it is braked again [K]."""
    known = np.isfinite(whole.temperature)
    time, heat = whole.time[known], whole.temperature[known]
    braked = whole.time[whole.pressure > 1e5 * (columns.rig.push_out_pressure + PRESSED)]
    again = np.append(braked, np.inf)[np.searchsorted(braked, ends + RECORDED_S)]
    cut = np.append(time[:-1][np.diff(time) > RECORDED_S], time[-1])
    recorded = cut[np.minimum(np.searchsorted(cut, ends), len(cut) - 1)]
    until = np.maximum(np.minimum(np.minimum(ends + EVENED_S, again), recorded), ends)
    return np.asarray(np.interp(until, time, heat) - np.interp(ends, time, heat))


def refuse_units(
    applications: Sequence[Recording], columns: Columns, where: str, whole: Recording
) -> Numbers:
    """Return the numbers of applications of a `whole`, in the units of a recording; refuse other units.

    Raises:
        UserError: names the column, the finding and the remedy.
    """
    numbers = numbers_of(applications, columns, whole)
    if max(float(np.ptp(one.temperature)) for one in applications) < STILL:
        name = columns.columns.temperature[0]
        raise UserError(where, name, "does not rise when the brake is applied; give the disc's thermocouple")
    refuse_hung(whole, columns, where)
    refuse_air(whole, columns, where)
    if late := thermocouple_delay(whole):
        remedy = f"follows the braking {late:.1f} s late; shift the column, or take a faster thermocouple"
        raise UserError(where, columns.columns.temperature[0], remedy)
    mistake = likeliest(numbers, columns, CONFIGURED)
    if mistake is None or mistake.place not in UNITS:  # areas and radii count for nothing here
        return numbers
    name, unit = getattr(columns.columns, mistake.place)
    remedy = mistake.remedy.partition(":")[0]
    convert = "give that of both" if "pad" in remedy else f"convert it to {unit}"
    raise UserError(where, f"{name} ({_found(numbers)})", f"{remedy}: {convert}")


def measure(recording: Recording, columns: Columns, where: str) -> tuple[Numbers, Stops]:
    """Return the three numbers of a recording, and its stops. Raises `UserError`, one line."""
    free = with_keys(columns, {"rig.inertia": None})
    stops = find_stops(recording, free, where)
    radius = columns.brake.effective_radius
    energy, rise = [], []
    for begin, end in zip(stops.first[:-1], stops.first[1:], strict=True):
        few = stops.per_block
        energy.append(float((stops.torque[begin:end] * stops.speed[begin:end]).sum()) / radius * stops.dt)
        temperature = stops.temperature
        rise.append(temperature[end - few : end].mean() - temperature[begin : begin + few].mean())
    ends = stops.begin + stops.dt * np.diff(stops.first)
    heating = _heating(np.array(energy), np.array(rise), _evened(ends, columns, recording))
    return Numbers(float(np.median(stops.mu)), stops.inertia, *heating), stops


def refuse_nonsense(recording: Recording, columns: Columns, where: str) -> Numbers:
    """Return the three numbers of a recording that makes sense.

    Raises:
        UserError: it does not; names the column, the finding and the remedy.
    """
    hottest, coldest = float(recording.temperature.max()), float(recording.temperature.min())
    if hottest > HIGHEST_TEMPERATURE or coldest < LOWEST_TEMPERATURE:
        place = f"temperature {coldest:.0f} to {hottest:.0f} °C"
        raise UserError(where, place, "no brake disc is that; check its unit, and the thermocouple")
    if coldest > WARM:
        raise UserError(where, f"temperature {coldest:.0f} °C and more", 'reads like K: give the unit "K"')
    between = float(np.median(np.diff(recording.time)))
    if not SAMPLES[0] <= between <= SAMPLES[1]:
        raise UserError(where, f"time, {between:.3g} s between samples", "check its unit; 50 Hz are needed")
    if np.ptp(recording.speed) < 1e-3:
        raise UserError(where, "speed", "does not change; give the column of the disc's speed")
    if np.ptp(recording.temperature) < STILL:
        raise UserError(where, "temperature", "does not change; give the column of the disc's thermocouple")
    refuse_hung(recording, columns, where, ("pressure", "speed", "temperature"))
    refuse_air(recording, columns, where)
    numbers, _ = measure(recording, columns, where)
    mistake = likeliest(numbers, columns)
    if mistake is not None:
        raise UserError(where, f"{mistake.place} ({_found(numbers)})", mistake.remedy)
    return numbers


def likeliest(numbers: Numbers, columns: Columns, given: float = GIVEN) -> Mistake | None:
    """Return the mistake that the three numbers show, None if they make sense.

    `given`: standard deviation of the logarithm of the disc's heating where `columns` gives it.
    """
    known = (None, columns.rig.inertia, columns.disc.heating)
    surely = (None, GIVEN, given)
    expected = np.array([one or usual for one, usual in zip(known, USUAL, strict=True)])
    spread = [usual if one is None else by for one, usual, by in zip(known, TOLERANCE, surely, strict=True)]
    off = np.log(np.maximum(numbers, 1e-9)) - np.log([*expected, expected[2]])
    # The thermocouple lags and the air cools: a disc seems to heat less than it does.
    off[2:] += 0.15

    def badness(mistake: Mistake, end_alone: bool = False) -> float:
        *others, end, evened = off - np.log([*mistake[:3], mistake.heating])
        heating = end if end_alone else np.clip(0.0, min(end, evened), max(end, evened))
        return float(np.sum((np.array([*others, heating]) / spread) ** 2))

    fine = Mistake(1.0, 1.0, 1.0, "", "")
    worst = np.abs(np.array([*off[:2], np.clip(0.0, min(off[2:]), max(off[2:]))]) / spread)
    if worst.max() < DOUBTFUL:
        return None
    best = min(mistakes(columns), key=lambda one: badness(one, end_alone=True))
    if badness(best) + CLEARER < badness(fine):
        return best
    return fine._replace(place="brake", remedy="fits no known mistake: check areas, radii, inertia and disc")


def _found(numbers: Numbers) -> str:
    return (
        f"friction {numbers.friction:.3g}, inertia {numbers.inertia:.3g} kg m², "
        f"disc heated by {numbers.heating:.3g} K/J"
    )
