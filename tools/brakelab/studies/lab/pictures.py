"""Figures 2.6 to 2.9, 3.2, 3.3, 3.6a, B.1 to B.3 and C.1 with the drawn pads, as SVG."""

from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector
from brakelab.identify.friction.analysis import Components, levels
from brakelab.identify.friction.cost import Cost
from brakelab.identify.friction.estimators import NETWORK, OSTERMEYER, SURFACE
from brakelab.identify.friction.heat_capacity import AT, HeatCapacity
from brakelab.results.chart import BLUE, GREEN, GREY, ORANGE, PINK, Cells, Line, Panel, ends_of, write_chart
from brakelab.studies.lab.brakes import Brake
from brakelab.studies.lab.run import Lab
from brakelab.studies.lab.searches import Searches
from brakelab.studies.lab.trips import FACTORS, OnTrips, median_wrong
from brakelab.studies.physics.heat import BRAKES

NAMES: Final = ("speed", "pressure", "temperature", "friction")
COLOURS: Final = (PINK, BLUE, ORANGE, GREEN)
OF_ESTIMATOR: Final = {SURFACE: BLUE, OSTERMEYER: ORANGE, NETWORK: GREEN}
UNITS: Final = (
    ("initial sliding speed [m/s]", 1.0),
    ("pressure [bar]", 1e-5),
    ("initial temperature [°C]", 1.0),
)
MU: Final = (0.28, 0.54)
SCORES: Final = 4.0  # scores are drawn over this


def write_pictures(folder: Path, lab: Lab) -> None:
    """Draw all figures into `folder`; nothing where there is no such folder. Raises `UserError`."""
    pictures: dict[str, tuple[Callable[[], list[Panel]], list[tuple[str, str]], int]] = {
        "cpc": (lambda: correlations(lab.brakes), [("stops", GREY), ("mean of a level", ORANGE)], 3),
        "surface": (lambda: surfaces(lab.brakes["A"]), [("mean friction of a stop, light to dark", BLUE)], 3),
        "components": (
            lambda: components(lab.brakes["A"]),
            [("stops", GREY), *zip(NAMES, COLOURS, strict=True)],
            2,
        ),
        "heat": (lambda: [heat(lab.brakes[brake].heat, brake) for brake in BRAKES], HEAT, 3),
        "cost": (lambda: costs(lab.searches), SEARCH, 3),
        "estimators": (lambda: estimators(lab.on_trips), ESTIMATORS, 4),
    }
    for name, (panels, legend, columns) in pictures.items():
        write_chart(folder / f"lab-{name}.svg", panels(), legend, columns)


HEAT: Final = [("stops", GREY), ("found", BLUE), ("interval of 95 %", ORANGE)]
SEARCH: Final = [("least squares", ORANGE), ("simplex", PINK), ("profile", BLUE), ("quadratic", GREY)]
ESTIMATORS: Final = [
    ("measured", "#333"),
    *((name, colour) for name, colour in OF_ESTIMATOR.items()),
    ("lumped temperature", PINK),
]


def correlations(brakes: dict[str, Brake]) -> list[Panel]:
    """Return mean friction over pressure, speed and temperature (Figure 3.3), a row a brake."""
    panels = []
    for name, brake in brakes.items():
        numbers = levels(brake.inputs)
        for place in (1, 0, 2):
            label, factor = UNITS[place]
            values = factor * brake.inputs[:, place]
            level = numbers[:, place]
            middles, means = _by_level(values, level), _by_level(brake.mean, level)
            title = f"{name}: mean friction, r = {brake.components.correlation[place]:+.2f}"
            lines = [Line(values, brake.mean, GREY, marks=True), Line(middles, means, ORANGE)]
            panels.append(Panel(title, label, ends_of(values), MU, lines))
    return panels


def surfaces(brake: Brake) -> list[Panel]:
    """Return mean friction over temperature and pressure at every initial speed (Figure 3.2)."""
    speed, pressure, temperature = levels(brake.inputs).T
    low, high = float(brake.mean.min()), float(brake.mean.max())
    x = _edges(_by_level(brake.inputs[:, 2], temperature))
    y = _edges(1e-5 * _by_level(brake.inputs[:, 1], pressure))
    panels = []
    for each, at in enumerate(_by_level(brake.inputs[:, 0], speed)):
        grid = np.full((len(y) - 1, len(x) - 1), np.nan)
        seen = speed == each
        grid[pressure[seen], temperature[seen]] = brake.mean[seen]
        title = f"from {at:.1f} m/s: pressure [bar]; {low:.2f} to {high:.2f}"
        cells = Cells(x, y, grid, low, high)
        panels.append(Panel(title, UNITS[2][0], (x[0], x[-1]), (y[0], y[-1]), [], cells=cells))
    return panels


def components(brake: Brake) -> list[Panel]:
    """Return Figures B.1, B.2 and both of B.3."""
    data = np.column_stack([brake.inputs, brake.mean])
    data = (data - data.mean(axis=0)) / data.std(axis=0)
    found = brake.components
    scores = data @ found.loadings
    return [
        _two(data[:, 2], data[:, 3], found.correlation[2]),
        _pareto(found),
        _biplot(found, scores, 1),
        _biplot(found, scores, 2),
    ]


def _two(x: Vector, y: Vector, r: float) -> Panel:
    """Return friction over temperature with their two components: the diagonals, of 1 + r and 1 - r."""
    ends = np.array([-2.5, 2.5])
    title = f"B.1: friction; PC1 {50 * (1 + abs(r)):.0f} %, PC2 (dashed) {50 * (1 - abs(r)):.0f} %"
    lines = [
        Line(x, y, GREY, marks=True),
        Line(ends, np.sign(r) * ends, "#333"),
        Line(ends, -np.sign(r) * ends, "#333", True),
    ]
    return Panel(title, "temperature, standardised", (-3.0, 3.0), (-3.0, 3.0), lines)


def _pareto(found: Components) -> Panel:
    places = np.arange(1.0, 5.0)
    bars = [
        Line(np.array([k - 0.3, k - 0.3, k + 0.3, k + 0.3]), np.array([0.0, s, s, 0.0]), BLUE)
        for k, s in zip(places, 100.0 * found.shares, strict=True)
    ]
    summed = Line(places, 100.0 * np.cumsum(found.shares), ORANGE)
    title = "B.2: variance of all four variables [%], and its sum"
    return Panel(title, "component", (0.5, 4.5), (0.0, 100.0), [*bars, summed])


def _biplot(found: Components, scores: NDArray[np.float64], second: int) -> Panel:
    lines = [Line(scores[:, 0] / SCORES, scores[:, second] / SCORES, GREY, marks=True)]
    for place, colour in enumerate(COLOURS):
        x, y = found.loadings[place, 0], found.loadings[place, second]
        lines.append(Line(np.array([0.0, x]), np.array([0.0, y]), colour))
    title = f"B.3: PC{second + 1}; loadings, and scores over {SCORES:g}"
    return Panel(title, "PC1", (-1.05, 1.05), (-1.05, 1.05), lines)


def heat(found: HeatCapacity, brake: str) -> Panel:
    """Return the disc's heat capacity over temperature (Figure 3.6a)."""
    x = np.linspace(40.0, 300.0, 20)
    line = found.at_100 * (1.0 + found.rise * (x - AT))
    half = np.hypot(found.half, found.at_100 * found.rise_half * (x - AT))
    lines = [
        Line(found.temperature, found.each, GREY, marks=True),
        Line(x, line - half, ORANGE),
        Line(x, line + half, ORANGE),
        Line(x, line, BLUE),
    ]
    title = f"{brake}: heat capacity [J/K], {1e4 * found.rise:+.1f} ± {1e4 * found.rise_half:.1f} % per 100 K"
    span = (0.7 * found.at_100, 1.4 * found.at_100)
    return Panel(title, "mean temperature of the stop [°C]", (40.0, 300.0), span, lines)


def costs(found: Searches) -> list[Panel]:
    """Return the cost over two numbers with both searches (Figure C.1), and ILVO's profiles."""
    panels = [_cost(name, cost) for name, cost in found.costs.items()]
    for profile in found.profiles:
        x = np.linspace(-2.0, 2.0, len(profile.values))
        lines = [
            Line(x, x**2, GREY, True),
            Line(x, profile.rise, BLUE),
            Line(x, np.ones_like(x), "#333", True),
        ]
        panels.append(
            Panel(f"ilvo {profile.name}: profile, 1: 95 %", "half intervals", (-2.0, 2.0), (0.0, 4.0), lines)
        )
    return panels


def _cost(name: str, cost: Cost) -> Panel:
    x, y = _edges(cost.x), _edges(cost.y)
    depth = np.log10(cost.nrmse)
    low, high = float(depth.min()), float(np.quantile(depth, 0.98))
    lines = [
        Line(path.points[:, 0], path.points[:, 1], colour)
        for path, colour in ((cost.simplex, PINK), (cost.least_squares, ORANGE))
    ]
    lines.append(Line(np.array([cost.best[0]]), np.array([cost.best[1]]), "#333", marks=True))
    title = f"{name}: {cost.names[1]}; nRMSE {10**low:.1f} (light) to {10**high:.0f} %"
    cells = Cells(x, y, depth, low, high)
    label = f"{cost.names[0]}, both as shares of their bounds"
    return Panel(title, label, (x[0], x[-1]), (y[0], y[-1]), lines, cells=cells)


def estimators(pads: list[OnTrips]) -> list[Panel]:
    """Return Figures 2.8 (friction above, temperature below), 2.6, 2.7 of the first pad, and 2.9 of all."""
    found = pads[0]
    above, below = [], []
    for kind, trace in found.traces.items():
        ends = (0.0, float(trace.t[-1]))
        lines = [Line(trace.t, trace.mu, "#333")]
        lines += [Line(trace.t, trace.estimates[name], colour) for name, colour in OF_ESTIMATOR.items()]
        spread = np.concatenate([line.y for line in lines])
        title = f"2.8 {kind}: friction, from {3.6 * trace.speed[0]:.0f} to {3.6 * trace.speed[-1]:.0f} km/h"
        above.append(Panel(title, "t [s]", ends, ends_of(spread), lines))
        heats = [Line(trace.t, trace.temperature, "#333"), Line(trace.t, trace.lumped, PINK)]
        span = ends_of(*(line.y for line in heats))
        below.append(Panel(f"2.8 {kind}: disc [°C]", "t [s]", ends, span, heats))
    low = min(float(np.nanmin(each.mu)) for each in found.maps.values())
    high = max(float(np.nanmax(each.mu)) for each in found.maps.values())
    maps = []
    for (name, each), number in zip(found.maps.items(), ("2.6", "2.7"), strict=True):
        y = 1e-5 * each.pressure
        title = f"{number} {name}: pressure [bar]; friction {low:.2f} to {high:.2f}"
        cells = Cells(each.speed, y, each.mu, low, high)
        label = f"sliding speed [m/s], at {each.temperature:.0f} °C"
        maps.append(Panel(title, label, (0.0, float(each.speed[-1])), (0.0, float(y[-1])), [], cells=cells))
    x = np.array(FACTORS)
    errors = median_wrong(pads)
    wrong = [Line(x, errors[name], colour) for name, colour in OF_ESTIMATOR.items()]
    top = 1.1 * max(float(line.y.max()) for line in wrong)
    last = Panel("2.9: nRMSE [%]", "temperature shown over true", (x[0], x[-1]), (0.0, top), wrong)
    return [*above, *below, *maps, last]


def _by_level(values: Vector, level: NDArray[np.int64]) -> Vector:
    """Return the mean of `values` at each level."""
    return np.asarray(np.bincount(level, values) / np.bincount(level))


def _edges(middles: Vector) -> Vector:
    """Return the edges of cells about rising `middles`, shape (n + 1,)."""
    between = 0.5 * (middles[1:] + middles[:-1])
    return np.concatenate([[2.0 * middles[0] - between[0]], between, [2.0 * middles[-1] - between[-1]]])
