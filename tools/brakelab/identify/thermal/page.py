"""The page beside a CONFIG of `identify thermal`: parameters, logs, measured over predicted, Figure 7.15."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Array
from brakelab.identify.thermal.fit import Disc, Fit
from brakelab.identify.thermal.model import ROW, Cooling
from brakelab.identify.thermal.result import KEYS, REMEDIES, SYMBOLS, Errors, Prediction, values_of
from brakelab.results.chart import BLUE, GREEN, GREY, ORANGE, PINK, Line, Panel, write_chart
from brakelab.results.text_table import Table, markdown
from ecu.contract.signals import CORNERS
from ecu.settings.config import Axle

LEGEND: Final = (
    ("measured", GREY),
    ("predicted", BLUE),
    ("two sigma", PINK),
    ("dry", ORANGE),
    ("rain", GREEN),
)
HIGHEST_SPEED: Final = 45.0  # m/s
MOST_PANELS: Final = 12  # panels of discs


class Judged(NamedTuple):
    """One axle."""

    name: str
    brake: Axle
    """As configured before."""
    discs: list[Disc]
    fit: Fit
    before: Fit
    """The configuration before, as if it were a fit."""
    errors: Errors
    predictions: list[Prediction]


def unidentified(axle: Judged) -> list[str]:
    """Return a line for every parameter that the logs do not identify, with the drive that would."""
    return [
        f"{axle.name} {SYMBOLS[place]}: not identified by these logs, as configured; {remedy}"
        for place, remedy in REMEDIES.items()
        if not axle.fit.identified[place]
    ]


def tables(axles: Sequence[Judged]) -> list[Table]:
    """Return parameters and logs as tables."""
    parameters, logs = [], []
    for axle in axles:
        new = values_of(axle.fit.heating, axle.fit.cooling)
        old = values_of(axle.before.heating, axle.before.cooling)
        for place, (key, unit) in KEYS.items():
            known = bool(axle.fit.identified[place])
            sigma = f"{new[place] * axle.fit.sigma[place]:.2g}" if known else "–"
            row = (
                axle.name,
                SYMBOLS[place],
                f"`{key}`",
                unit,
                f"{old[place]:.4g}",
                f"{new[place]:.4g}",
                sigma,
            )
            parameters.append((*row, "yes" if known else REMEDIES[place]))
        for number, (disc, prediction) in enumerate(zip(axle.discs, axle.predictions, strict=True)):
            series, seen = disc.series, disc.seen
            measured = series.measured[seen, disc.corner]
            logs.append(
                (
                    series.name,
                    CORNERS[disc.corner],
                    f"{ROW * len(series.speed) / 60:.0f}",
                    f"{100 * series.wet.mean():.0f}",
                    f"{measured.min():.0f}–{measured.max():.0f}",
                    f"{axle.fit.starts[number]:+.0f}",
                    f"{axle.fit.offsets[number]:+.1f}",
                    f"{prediction.before:.1f}",
                    f"{prediction.after:.1f}",
                    f"{100 * prediction.inside:.0f}",
                )
            )
    lag = ", ".join(f"{axle.name} {axle.fit.lag:.1f} s" for axle in axles)
    lasts = ", ".join(f"{axle.name} {axle.fit.noise:.1f} K for {axle.fit.lasts:.0f} s" for axle in axles)
    ranks = ", ".join(f"{axle.name} {axle.fit.rank}" for axle in axles)
    return [
        Table(
            "Parameters",
            ("axle", "", "key", "unit", "before", "now", "σ", "identified"),
            parameters,
            f"σ by the residual, which lasts (standard deviation, autocorrelation time: {lasts}). Rank of "
            f"the six parameters, the sensor's lag among them: {ranks}. Otherwise the drive that would.",
        ),
        Table(
            "Logs",
            ("log", "disc", "min", "rain [%]", "measured [°C]", "start [K]", "sensor [K]", "RMSE before [K]",
             "RMSE now [K]", "inside 2σ [%]"),
            logs,
            "By the ECU's own friction torque, from the fitted start above the air; the same for the "
            f"configuration before. Sensor: its constant offset as fitted, in the errors. Lag: {lag}.",
        ),
    ]  # fmt: skip


def _rates(cooling: Cooling, speed: Array) -> tuple[Array, Array]:
    dry = np.zeros(len(speed), np.bool_)
    return 1e3 * cooling.rate(speed, dry), 1e3 * cooling.rate(speed, ~dry)


def cooling_panel(title: str, new: Cooling, old: Cooling | None = None) -> Panel:
    """Return Figure 7.15: the cooling coefficient by speed, dry and wet; `old` dashed."""
    speed = np.linspace(0.0, HIGHEST_SPEED, 50)
    dry, wet = _rates(new, speed)
    lines = [Line(speed, dry, ORANGE), Line(speed, wet, GREEN)]
    if old is not None:
        before = _rates(old, speed)
        lines += [Line(speed, before[0], ORANGE, True), Line(speed, before[1], GREEN, True)]
    top = 1.1 * max(float(line.y.max()) for line in lines)
    return Panel(title, "speed [m/s]", (0.0, HIGHEST_SPEED), (0.0, top), lines)


def disc_panel(title: str, minutes: Array, measured: Array, predicted: Array, sigma: Array) -> Panel:
    """Return measured over predicted temperature with the band of two sigma."""
    low, high = predicted - 2.0 * sigma, predicted + 2.0 * sigma
    both = np.concatenate([measured[np.isfinite(measured)], low, high])
    lines = [
        Line(minutes, low, PINK, True),
        Line(minutes, high, PINK, True),
        Line(minutes, measured, GREY),
        Line(minutes, predicted, BLUE),
    ]
    return Panel(title, "min", (0.0, float(minutes[-1])), (float(both.min()), float(both.max()) + 1.0), lines)


def write_page(page: Path, axles: Sequence[Judged]) -> None:
    """Write the tables with the picture above them."""
    panels = [
        cooling_panel(f"{axle.name}: δ [1/1000 s], before dashed", axle.fit.cooling, axle.before.cooling)
        for axle in axles
    ]
    discs = [pair for axle in axles for pair in zip(axle.discs, axle.predictions, strict=True)]
    for disc, prediction in discs[:MOST_PANELS]:
        series = disc.series
        minutes = np.arange(1, len(series.speed) + 1, dtype=np.float64) * ROW / 60.0
        title = f"{series.name}, {CORNERS[disc.corner]} [°C]"
        panels.append(
            disc_panel(
                title, minutes, series.measured[:, disc.corner], prediction.predicted, prediction.sigma
            )
        )
    picture = page.with_suffix(".svg")
    write_chart(picture, panels, LEGEND)
    head = f"# Disc temperature by {len({id(disc.series) for disc, _ in discs})} logs\n\n"
    head += f"![Cooling by speed, measured over predicted temperature]({picture.name})\n\n"
    parts = "\n".join(markdown(table) for table in tables(axles)).rstrip()
    page.write_text(f"{head}{parts}\n", encoding="utf-8")
