"""Features of each brake application on a trip with a particle counter (section 8.4, Figures 8.2 to 8.4).

The air takes a while from the disc to the counter: the delay is that of best correlation between counter and
friction power, and the counter's readings are moved back by it before anything else is made of them.

Background: the counter's reading when cruising, long after a brake application, against speed (Figure 8.2): a
line through the medians by speed, times a slow factor by the readings within two minutes.

Applications are found by pressure and end at standstill, where a disc emits nothing. Their
conditions are those of (8.2) and the mean pressure; their emission is (8.1)

    EF = log10 of the integral of Q (c - background) over the application, and a tail for mixing
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Array
from brakelab.stretches import stretches
from ecu.errors import UserError

PERIOD: Final = 0.1  # s, grid of a trip
PRESSED: Final = 1.5  # bar, of the mean over SMOOTH
SMOOTH: Final = 5  # samples
MOVING: Final = 0.5  # m/s: below, the car is at standstill
SHORTEST_APPLICATION: Final = 0.5  # s
LEAST_WORK: Final = 500.0  # J: below it an application counts as negligible
CLEAR_S: Final = 25.0  # after an application, until the counter shows background again
STEADY: Final = 0.4  # m/s^2
SPEED_BIN: Final = 4.0  # m/s
NEAR_S: Final = 60.0  # standard deviation of the window of the slow factor
NEAR_COUNT: Final = 10.0  # prior weight of the line in samples
LONGEST_DELAY_S: Final = 40.0
LEAST_CORRELATION: Final = 0.05  # of counter and power, at the delay of best correlation
BEFORE_S: Final = 2.0  # the plume begins this much before its middle
TAIL_S: Final = 5.0
SEQUENCE: Final = 12  # points of a sequence (8.3)
FEATURES: Final = ("v_in", "v_end", "torque", "temperature", "duration", "pressure")
UNITS: Final = ("m/s", "m/s", "N m", "degC", "s", "bar")


class Recorded(NamedTuple):
    """A trip at `PERIOD`; each array of shape (n,)."""

    name: str
    test: bool
    t: Array
    speed: Array
    pressure: Array
    """bar above push-out"""
    torque: Array
    temperature: Array
    concentration: Array
    """1/cm^3, linear between the counter's samples"""
    flow: Array
    counted: NDArray[np.bool_]
    """False where the counter dropped out"""


class Background(NamedTuple):
    """Of a trip."""

    still: float
    """1/cm^3"""
    by_speed: float
    """1/cm^3 per m/s"""
    speeds: Array
    levels: Array
    """Medians by speed, 1/cm^3; as Figure 8.2"""
    factor: Array
    """About the line, shape (n,)."""

    def at(self, speed: Array) -> Array:
        """Return the background [1/cm^3] along the trip."""
        return np.asarray(self.factor * (self.still + self.by_speed * speed))


class Applications(NamedTuple):
    """Of one trip; m applications."""

    trip: str
    test: bool
    km: float
    start: Array
    """s"""
    features: Array
    """Shape (m, 6), `FEATURES`."""
    sequences: Array
    """Speed, torque, temperature at `SEQUENCE` points each, and the duration; shape (m, 3 SEQUENCE + 1)."""
    particles: Array
    """Counted, may be negative for the weakest."""
    energy: Array
    """J"""
    decel: Array
    """m/s^2, mean"""
    background: Background
    delay_s: float
    """s of the air from disc to counter"""
    recorded: Recorded | None = None
    left_out: int = 0
    """Applications during which the counter dropped out."""

    @property
    def factor(self) -> Array:
        """Return EF (8.1); NaN where particles cannot be distinguished from the background."""
        return np.asarray(np.log10(np.where(self.particles > 0.0, self.particles, np.nan)))


def find_applications(trip: Recorded) -> list[tuple[int, int]]:
    """Return first row and row after the last of each application."""
    kernel = np.full(SMOOTH, 1.0 / SMOOTH)
    pressed = (np.convolve(trip.pressure, kernel, "same") > PRESSED) & (trip.speed > MOVING)
    found = []
    for first, last in stretches(pressed):
        above = first + np.flatnonzero(trip.pressure[first:last] > PRESSED)  # smoothing widens
        if not len(above):
            continue
        start, end = above[0], above[-1] + 1
        part = slice(start, end)
        work = PERIOD * float(np.sum(trip.torque[part] * trip.speed[part]))
        if (end - start) * PERIOD >= SHORTEST_APPLICATION and work > LEAST_WORK:
            found.append((int(start), int(end)))
    return found


def find_background(trip: Recorded, applications: list[tuple[int, int]]) -> Background:
    """Return the background of a trip (Figure 8.2).

    Raises:
        UserError: the trip has no steady driving that shows it.
    """
    since = np.full(len(trip.t), np.inf)
    for start, end in applications:
        since[start:] = 0.0
        since[end:] = PERIOD * np.arange(len(trip.t) - end)
    accel = np.gradient(np.convolve(trip.speed, np.full(11, 1 / 11), "same"), PERIOD)
    every = np.zeros(len(trip.t), bool)
    every[:: round(1.0 / PERIOD)] = True
    clear = every & trip.counted & (since > CLEAR_S) & (np.abs(accel) < STEADY) & (trip.speed > MOVING)
    v, c = trip.speed[clear], trip.concentration[clear]
    bins = np.floor(v / SPEED_BIN).astype(int)
    speeds, levels, counts = [], [], []
    for place in np.unique(bins):
        inside = bins == place
        if np.count_nonzero(inside) >= 10:
            speeds.append(float(np.median(v[inside])))
            levels.append(float(np.median(c[inside])))
            counts.append(np.count_nonzero(inside))
    if not speeds:
        remedy = (
            f"no steady driving {CLEAR_S:.0f} s after a brake application, so nothing shows the background; "
            "give trips that have some"
        )
        raise UserError(f"trip {trip.name}", "vehicle_speed", remedy)
    if len(speeds) == 1:
        return Background(levels[0], 0.0, np.array(speeds), np.array(levels), np.ones(len(trip.t)))
    slope, still = np.polyfit(speeds, levels, 1, w=np.sqrt(counts))
    if slope < 0.0:  # it wandered more than it grew
        slope, still = 0.0, np.average(levels, weights=counts)
    slope, still = float(slope), max(float(still), 1.0)
    ratio = np.log(np.maximum(c, 1.0) / (still + slope * v))
    ratio = np.clip(ratio - np.median(ratio), -1.0, 1.0)
    coarse = trip.t[:: round(5.0 / PERIOD)]
    weight = np.exp(-0.5 * ((coarse[:, None] - trip.t[clear][None, :]) / NEAR_S) ** 2)
    local = weight @ ratio / (weight.sum(axis=1) + NEAR_COUNT)
    factor = np.exp(np.interp(trip.t, coarse, local))
    return Background(still, slope, np.array(speeds), np.array(levels), factor)


def transport_time(trip: Recorded) -> float:
    """Return the transport delay [s] with which the counter follows the friction power best.

    Of the power counts what the speed does not explain: the background grows with that.

    Raises:
        UserError: it follows it at no delay that is sought.
    """
    power, known = trip.torque * trip.speed, np.column_stack([np.ones(len(trip.t)), trip.speed])
    power = power - known @ np.linalg.lstsq(known, power, rcond=None)[0]
    shown = np.where(trip.counted, trip.concentration - trip.concentration[trip.counted].mean(), 0.0)
    lags = range(min(round(LONGEST_DELAY_S / PERIOD), len(power) - 1))
    means = [float(power[: len(power) - lag] @ shown[lag:]) / (len(power) - lag) for lag in lags]
    best = int(np.argmax(means))
    if means[best] < LEAST_CORRELATION * power.std() * shown.std():
        remedy = f"follows the braking by none of 0 to {LONGEST_DELAY_S:.0f} s; align its clock or mend it"
        raise UserError(f"trip {trip.name}", "particle_concentration", remedy)
    return PERIOD * best


def aligned(trip: Recorded, delay: float) -> Recorded:
    """Return a trip whose counter shows at once what the disc emits; its last `delay` [s] are cut off."""
    late = round(delay / PERIOD)
    whole = len(trip.t) - late
    t, speed, pressure, torque, temperature = (column[:whole] for column in trip[2:7])
    shown, counted, flow = trip.concentration[late:], trip.counted[late:], trip.flow[:whole]
    return Recorded(trip.name, trip.test, t, speed, pressure, torque, temperature, shown, flow, counted)


def _conditions(trip: Recorded, start: int, end: int) -> tuple[float, ...]:
    part = slice(start, end)
    return (
        float(trip.speed[start]),
        float(trip.speed[end - 1]),
        float(trip.torque[part].mean()),
        float(trip.temperature[part].mean()),
        PERIOD * (end - start),
        float(trip.pressure[part].mean()),
    )


def _sequence(trip: Recorded, start: int, end: int) -> Array:
    """Return speed, torque and temperature stretched to one length, and the duration (Figure 8.4)."""
    places = np.linspace(start, end - 1, SEQUENCE)
    rows = np.arange(start, end)
    curves = [np.interp(places, rows, y[start:end]) for y in (trip.speed, trip.torque, trip.temperature)]
    return np.concatenate([*curves, [PERIOD * (end - start)]])


def extract(trip: Recorded, radius: float) -> Applications:
    """Return the applications of a trip that were counted; `radius` of the tyre [m]."""
    delay = transport_time(trip)
    trip = aligned(trip, delay)
    every = find_applications(trip)
    background = find_background(trip, every)
    excess = trip.concentration - background.at(trip.speed)
    emitted = np.cumsum(1e6 * trip.flow * excess) * PERIOD
    before = round(min(delay, BEFORE_S) / PERIOD)
    places, particles, energy = [], [], []
    starts = [start for start, _ in every]
    for (start, end), after in zip(every, [*starts[1:], len(emitted) + before], strict=False):
        first = max(start - before, 0)
        last = min(end + round(TAIL_S / PERIOD), after - before)
        last = min(max(last, first + 1), len(emitted) - 1)
        if not trip.counted[first:last].all():
            continue
        places.append((start, end))
        particles.append(float(emitted[last] - emitted[min(first, last)]))
        part = slice(start, end)
        energy.append(PERIOD * float(np.sum(trip.torque[part] * trip.speed[part])) / radius)
    features = np.array([_conditions(trip, *place) for place in places]).reshape(-1, len(FEATURES))
    return Applications(
        trip.name,
        trip.test,
        1e-3 * PERIOD * float(trip.speed.sum()),
        trip.t[[start for start, _ in places]],
        features,
        np.array([_sequence(trip, *place) for place in places]).reshape(-1, 3 * SEQUENCE + 1),
        np.array(particles),
        np.array(energy),
        (features[:, 0] - features[:, 1]) / features[:, 4],
        background,
        delay,
        trip,
        len(every) - len(places),
    )
