"""Tables of `lab report`: sections, characteristic values, lines over pressure, temperature and speed."""

from typing import Final, NamedTuple

import numpy as np
from scipy.stats import t as student

from brakelab.arrays import Vector
from brakelab.identify.friction.analysis import inputs_of, levels
from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.sections import Conditions, Part, conditions_of
from brakelab.identify.friction.stops import Places, Stops
from brakelab.identify.friction.uncertainty import COVERAGE, standard_uncertainty
from brakelab.results.text_table import Table

PRESSURE_RATIO: Final = 1.3
TEMPERATURE_RANGE: Final = 50.0  # K
SPEED_RANGE: Final = 10.0  # km/h
"""Of a section's applications, from which on they make a line."""
SAME_TEMPERATURE: Final = 10.0  # K, of sections that make a line over speed
FEWEST_LEVELS: Final = 3
GRADIENT_RATIO: Final = 2.5
"""Between pressure gradients under the same conditions, that their effect shows."""
FEWEST_STOPS: Final = 8  # that show it
OTHERWISE: Final = ("fade", "burnish")
LAST: Final = 3  # applications by which a recovery or burnish is judged


class Measured(NamedTuple):
    """One recording with its sections."""

    name: str
    stops: Stops
    conditions: Conditions
    parts: list[Part]
    outside: Places
    u: Vector | None  # standard uncertainty of every stop's mean friction

    def mu(self, part: Part) -> Vector:
        """Return mean friction of the applications of a section."""
        return self.stops.mean[part.stops]


def measured(name: str, stops: Stops, columns: Columns, parts: list[Part], outside: Places) -> Measured:
    """Return a recording with its sections and all that its tables need."""
    u = standard_uncertainty(stops, columns)
    return Measured(name, stops, conditions_of(stops, columns), parts, outside, u)


def section_table(title: str, of: Measured) -> Table:
    """Return mean, least and greatest friction of every section, and its conditions as measured."""
    rows = []
    for part in of.parts:
        mu = of.mu(part)
        count = str(len(mu)) if len(mu) == part.asked else f"{len(mu)} of {part.asked}"
        row = (part.name, count, *(f"{value:.3f}" for value in (mu.mean(), mu.min(), mu.max(), mu[-1])))
        rows.append((*row, *_uncertainty(of, part), *_spans(of.conditions, part)))
    stated = ("U",) if of.u is not None else ()
    columns = ("section", "n", "mean μ", "least", "greatest", "last", *stated, "bar", "from °C", "to °C")
    below = "Friction of an application: mean over distance from 90 % of its pressure on."
    if stated:
        below += (
            f" U: expanded uncertainty of the mean (k = {COVERAGE:g}) by what the file of columns states."
        )
    if len(of.outside):
        times = ", ".join(f"{of.stops.begin[k]:.0f}" for k in of.outside[:5])
        more = ", …" if len(of.outside) > len(of.outside[:5]) else ""
        below += f" Stops of no section: {len(of.outside)}, at {times}{more} s."
    return Table(title, columns, rows, below)


def _uncertainty(of: Measured, part: Part) -> tuple[str, ...]:
    return () if of.u is None else (f"{COVERAGE * of.u[part.stops].mean():.3f}",)


def _spans(found: Conditions, part: Part) -> tuple[str, ...]:
    ends = (found.pressure, found.start)
    spans = [(float(values[part.stops].min()), float(values[part.stops].max())) for values in ends]
    texts = [f"{low:.0f}" if round(low) == round(high) else f"{low:.0f} to {high:.0f}" for low, high in spans]
    return (*texts, f"{found.end[part.stops].max():.0f}")


def nominal(of: Measured) -> Part | None:
    """Return the section of nominal friction: the last of characteristic values, None if there is none."""
    found = [part for part in of.parts if "characteristic" in part.name]
    return found[-1] if found else None


def characteristics(of: Measured) -> Table:
    """Return the characteristic values, each with what it is of nominal friction."""
    usual = nominal(of)
    rows: list[tuple[str, ...]] = []

    def add(name: str, value: float, note: str) -> None:
        share = f"{100.0 * (value / of.mu(usual).mean() - 1.0):+.1f}" if usual else "–"
        rows.append((name, f"{value:.3f}", share, note))

    for part in of.parts:
        mu, at = of.mu(part), of.conditions.start[part.stops]
        if "green" in part.name:
            add("green", float(mu.mean()), f"{part.name}; last {LAST}: {mu[-LAST:].mean():.3f}")
        elif "burnish" in part.name:
            add("burnished", float(mu[-LAST:].mean()), f"{part.name}, last {LAST}")
        elif part is usual:
            add("nominal", float(mu.mean()), part.name)
        elif "cold" in part.name:
            add("cold", float(mu.mean()), f"{part.name}, {at.min():.0f} °C")
        elif "motorway" in part.name:
            add("motorway", float(mu.mean()), part.name)
        elif "fade" in part.name:
            least = int(np.argmin(mu))
            place = f"{part.name}, application {part.places[least] + 1}, from {at[least]:.0f} °C"
            add("least in fade", float(mu[least]), place)
        elif "recovery" in part.name:
            add("recovery", float(mu.mean()), f"{part.name}; first {mu[0]:.3f}, last {mu[-1]:.3f}")
    below = "Change: of nominal friction, the mean of the last section of characteristic values."
    return Table(f"Characteristic values, {of.name}", ("value", "μ", "change [%]", "note"), rows, below)


class Slope(NamedTuple):
    """A straight line through applications."""

    name: str
    over: str
    unit: str
    at: tuple[float, float]  # ends
    mu: tuple[float, float]  # measured at the ends
    slope: float  # per `unit`
    half: float  # of its interval of 95 %


def varies_pressure(of: Measured, part: Part) -> bool:
    """Return whether a section is there for its different pressures: burnish and fade are not."""
    pressure = of.conditions.pressure[part.stops]
    spreads = bool(pressure.max() > PRESSURE_RATIO * pressure.min())
    return len(pressure) > FEWEST_LEVELS and spreads and not any(word in part.name for word in OTHERWISE)


def varies_temperature(of: Measured, part: Part) -> bool:
    """Return whether a section is there for its different initial temperatures: burnish and fade are not."""
    heat = of.conditions.start[part.stops]
    spreads = bool(np.ptp(heat) > TEMPERATURE_RANGE)
    return len(heat) > FEWEST_LEVELS and spreads and not any(word in part.name for word in OTHERWISE)


def lines_of(of: Measured) -> list[Slope]:
    """Return lines of the sections over what they vary, and over speed and pressure gradient."""
    found = of.conditions
    slopes, by_speed = [], []
    for part in of.parts:
        mu = of.mu(part)
        if varies_pressure(of, part):
            slopes.append(_line(part.name, "pressure", "10 bar", 10.0, found.pressure[part.stops], mu))
            by_speed.append(part)
        if varies_temperature(of, part):
            slopes.append(_line(part.name, "temperature", "100 K", 100.0, found.start[part.stops], mu))
    usual = np.median([found.start[part.stops].mean() for part in by_speed]) if by_speed else 0.0
    by_speed = [p for p in by_speed if abs(found.start[p.stops].mean() - usual) < SAME_TEMPERATURE]
    levels = np.array([np.median(found.speed[part.stops]) for part in by_speed])
    shared = sorted(set.intersection(*(set(part.places.tolist()) for part in by_speed))) if by_speed else []
    if len(shared) >= FEWEST_LEVELS and np.ptp(levels) > SPEED_RANGE:
        # At one place of these sections the pressure is the same: what is left goes with speed.
        mu = np.array([of.mu(part)[np.isin(part.places, shared)] for part in by_speed])
        centred = mu - mu.mean(axis=0) + mu.mean()
        x = np.repeat(levels, len(shared))
        slopes.append(_line("those over pressure", "speed", "50 km/h", 50.0, x, centred.ravel()))
    gradient = gradient_line(of)
    return slopes if gradient is None else [*slopes, gradient]


def gradient_line(of: Measured) -> Slope | None:
    """Return Figure 3.11: friction over the logarithm of the pressure gradient, per doubling.

    Among stops that begin at the same speed, pressure and temperature; None where their gradients are alike.
    """
    found = of.conditions
    known = np.flatnonzero(np.isfinite(found.gradient))
    if len(known) < FEWEST_STOPS:
        return None
    kinds = levels(inputs_of(of.stops)[known])
    _, kind = np.unique(kinds, axis=0, return_inverse=True)
    x, mu = np.log2(found.gradient[known]), of.stops.mean[known].copy()
    kept = np.zeros(len(known), bool)
    for one in range(int(kind.max(initial=-1)) + 1):
        mine = np.flatnonzero(kind == one)
        if np.ptp(x[mine]) > np.log2(GRADIENT_RATIO):
            kept[mine] = True
            x[mine] -= x[mine].mean()
            mu[mine] -= mu[mine].mean()
    if np.count_nonzero(kept) < FEWEST_STOPS:
        return None
    line = _line("same conditions", "pressure gradient", "doubling", 1.0, x[kept], mu[kept])
    at = found.gradient[known][kept]
    middle = float(of.stops.mean[known][kept].mean())
    ends = middle + line.slope * np.log2(np.array([at.min(), at.max()]) / np.exp(np.log(at).mean()))
    return line._replace(at=(float(at.min()), float(at.max())), mu=(float(ends[0]), float(ends[1])))


def _line(name: str, over: str, unit: str, step: float, x: Vector, mu: Vector) -> Slope:
    middle = x - x.mean()
    slope = float(middle @ mu / (middle @ middle))
    left = mu - mu.mean() - slope * middle
    freedom = len(mu) - 2
    half = float(student.ppf(0.975, freedom) * np.sqrt(left @ left / freedom / (middle @ middle)))
    low, high = float(x.min()), float(x.max())
    at = [float(mu[np.isclose(x, end)].mean()) for end in (low, high)]
    return Slope(name, over, unit, (low, high), (at[0], at[1]), step * slope, step * half)


def line_table(of: Measured) -> Table:
    """Return the lines of a recording."""
    rows = [
        (
            line.name,
            line.over,
            f"{line.at[0]:.0f} to {line.at[1]:.0f}",
            f"{line.mu[0]:.3f} to {line.mu[1]:.3f}",
            f"{line.slope:+.4f} ± {line.half:.4f}",
            line.unit,
        )
        for line in lines_of(of)
    ]
    columns = ("section", "over", "from, to", "μ", "slope", "per")
    below = (
        "μ: as measured at both ends. Slope: of a straight line by least squares, ± 95 % by the scatter "
        "about it, which a bent one widens. Over speed: sections of the same pressures."
    )
    return Table(f"Lines, {of.name}", columns, rows, below)
