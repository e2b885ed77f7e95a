"""Tables of identified models."""

from collections.abc import Callable

import numpy as np

from brakelab.identify.friction.analysis import Components, History
from brakelab.identify.friction.choice import Identified, Judged, ties
from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.fit import Fitted, replayed
from brakelab.identify.friction.heat_capacity import UNSHOWN, HeatCapacity
from brakelab.identify.friction.profile import profile_interval
from brakelab.identify.friction.stops import Stops
from brakelab.plant.friction.law import RigBrake
from brakelab.results.text_table import Table

PARTS = 5
OVERLAP = 0.1
"""Correlation of two inputs from which on their shares of variance overlap by more than their digits."""


def law_tables(identified: Identified, unseen: str) -> list[Table]:
    """Return all laws with their errors, and where not to use each; `unseen` names the data held out."""
    errors = [
        (
            _name(judged, identified),
            str(judged.free),
            f"{judged.error:.2f}",
            f"{judged.held_out:.2f}",
            f"{judged.overall:.2f}",
            f"{judged.criterion:.0f}",
            judged.starts,
        )
        for judged in identified.laws
    ]
    limits = [
        (_name(judged, identified), ", ".join(judged.unidentified) or "–", judged.extrapolates)
        for judged in identified.laws
    ]
    low, high = identified.temperature
    seen = (
        f"Seen: {identified.stops} stops, {low:.0f} to {high:.0f} °C, {1e-5 * identified.pressure[0]:.0f} to "
        f"{1e-5 * identified.pressure[1]:.0f} bar, sliding at {identified.speed[0]:.1f} to "
        f"{identified.speed[1]:.1f} m/s. Beyond these no law is tested."
    )
    chosen = (
        f"Unseen: {unseen}, in closed loop: the measured torque is demanded, the pressure follows from the "
        "law, whose memory starts as on a car. Overall: the law is chosen by it; all stops by their number, "
        f"or what is unseen where it was given. Chosen: {identified.chosen.name}"
    )
    if tied := ties(identified.laws, identified.chosen):
        chosen += f"; a tie with {', '.join(judged.name for judged in tied)}, stop by stop within 2 σ"
    return [
        Table(
            "Laws",
            ("law", "numbers", "nRMSE [%]", "unseen [%]", "overall [%]", "criterion", "agree"),
            errors,
            f"{chosen}.",
        ),
        Table("Where laws end", ("law", "numbers not identified by these stops", "note"), limits, seen),
    ]


def _name(judged: Judged, identified: Identified) -> str:
    return f"{judged.name} *" if judged is identified.chosen else judged.name


def number_table(judged: Judged) -> Table:
    """Return the numbers of a law with their intervals of 95 % by the scatter of the stops alone."""
    rows = [
        (name, f"{value:.4g}", f"{half:.2g}", unit, "no" if name in judged.unidentified else "yes")
        for name, unit, value, half in judged.numbers
    ]
    below = (
        "±: 95 % by the scatter of these stops, residuals of one stop taken together; lag, filters and scale "
        "of the sensors, which shift numbers by several times that, are not in it. "
        "Identified: by these stops."
    )
    return Table(f"Numbers of {judged.name}", ("number", "value", "±", "unit", "identified"), rows, below)


def profile_table(fitted: Fitted, brake: RigBrake, stops: Stops, progress: Callable[[str], None]) -> Table:
    """Return the profile likelihood's intervals beside those of slopes; `progress` receives each number."""
    rows = []
    for place, (free, value, half) in enumerate(
        zip(fitted.candidate.free, fitted.values, fitted.half, strict=True)
    ):
        interval = profile_interval(fitted, brake, stops, place)
        progress(f"profile: {free.name}")
        slopes = f"{value - half:.4g} to {value + half:.4g}"
        rows.append(
            (free.name, f"{value:.4g}", slopes, f"{interval.low:.4g} to {interval.high:.4g}", free.unit)
        )
    columns = ("number", "value", "by slopes", "by profile", "unit")
    below = "Intervals of 95 %. An infinite end: the stops do not bound the number on that side."
    return Table(f"Profile of {fitted.candidate.name}", columns, rows, below)


def residual_table(judged: Judged, columns: Columns, stops: Stops) -> Table:
    """Return the residuals of a law, in fifths of the blocks over temperature, sliding speed and pressure."""
    left = replayed(judged.law, columns.brake, stops, judged.starts_at_measured) - stops.mu
    inputs = (
        ("temperature [°C]", stops.temperature[stops.block_first]),
        ("sliding speed [m/s]", stops.speed[stops.block_first]),
        ("pressure [bar]", 1e-5 * stops.pressure[stops.block_first]),
    )
    rows = []
    for name, values in inputs:
        for part in np.array_split(np.argsort(values, kind="stable"), PARTS):
            seen, off = values[part], left[part] / stops.mu[part].mean()
            span = f"{seen.min():.1f} to {seen.max():.1f}"
            rows.append((name, span, f"{100 * off.mean():+.1f}", f"{100 * np.sqrt(np.mean(off**2)):.1f}"))
    below = "A mean off zero is what the law has no term for."
    return Table(f"What {judged.name} leaves", ("over", "from, to", "mean [%]", "RMS [%]"), rows, below)


def component_table(found: Components) -> Table:
    """Return the principal components of stops beside the true shares of variance.

    The last row has what all inputs explain at once, which is less than the sum where they go together.
    """
    rows = [
        (name, *(f"{100 * value:+.1f}" for value in found.loadings[place]), *cells)
        for place, (name, cells) in enumerate(
            zip(
                ("initial speed", "pressure", "initial temperature", "mean friction"),
                [
                    *(
                        (f"{r:+.2f}", f"{100 * r * r:.1f}", f"{100 * any_form:.1f}")
                        for r, any_form in zip(found.correlation, found.any_form, strict=True)
                    ),
                    ("", f"{100 * found.linear:.1f}", f"{100 * found.together:.1f}"),
                ],
                strict=True,
            )
        )
    ]
    below = (
        f"First three components: {100 * found.first_three:.1f} % of the variance of the four variables, "
        "which is not of friction. Loadings as in Table B.1; shares of the variance of mean friction."
    )
    if found.overlap > OVERLAP:
        below += (
            f" Inputs vary together here (correlation up to {found.overlap:.2f}): their shares overlap, "
            "each is that of all it goes with, and their sum says nothing; the last row counts them once."
        )
    columns = ("variable", "PC1 [%]", "PC2 [%]", "PC3 [%]", "r", "share, linear [%]", "share, any form [%]")
    return Table("Principal components", columns, rows, below)


def history_line(found: History) -> str:
    """Return one sentence on the effect of the stop before."""
    if not np.isfinite(found.slope):
        return "Too few stops to tell what the stop before does to friction."
    return (
        f"A stop after one that ended 100 K hotter has {100 * found.slope:+.2f} ± {100 * found.half:.2f} % "
        "friction, all else equal."
    )


def heat_line(found: HeatCapacity) -> str:
    """Return one sentence on the disc's heat capacity."""
    if not found.known:
        return f"Disc: {UNSHOWN}."
    late = found.lag > 0.0
    thermocouple = f"lags {found.lag:.2f} s" if late else f"leads by {-found.lag:.2f} s of the work"
    return (
        f"Disc: {found.at_100:.0f} ± {found.half:.0f} J/K at 100 °C, {100 * found.rise:+.3f} ± "
        f"{100 * found.rise_half:.3f} % per K; the thermocouple {thermocouple}."
    )
