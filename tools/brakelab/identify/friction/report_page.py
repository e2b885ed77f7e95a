"""Page of `lab report`: friction stop by stop, over pressure, temperature and repeated applications."""

from collections.abc import Callable, Sequence
from html import escape
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Vector
from brakelab.identify.friction.report_tables import Measured, varies_pressure, varies_temperature
from brakelab.identify.friction.sections import MARKS, Part
from brakelab.identify.friction.sheet import html_of, scrolling, write_sheet
from brakelab.results.chart import BLUE, GREEN, ORANGE, PINK, Line, Panel, chart_svg, ends_of
from brakelab.results.text_table import Table

COLOURS: Final = (BLUE, ORANGE, GREEN, PINK, "#333")
OF: Final = (BLUE, ORANGE)
"""Colours of the first recording and the second."""
HEAT: Final = "disc at the start [°C]"
FEWEST_POINTS: Final = 3  # applications that make a line
NAME: Final = 0.12  # of a panel's height, room for the name of a line
TEN: Final = 10.0
ALIKE: Final = (10.0, 0.15)
"""Initial speed (km/h) and pressure (share) within which stops of Figure 3.4 are alike."""
WITHIN: Final = ((120.0, 20.0), (120.0, 60.0), (80.0, 20.0), (80.0, 60.0))
"""km/h and bar of its parts a) to d)."""
LEVEL: Final = 20.0  # K, between its temperatures

Values = Callable[[Measured, Part], Vector]


class _Group(NamedTuple):
    """Sections that vary the same."""

    title: str
    x_name: str
    values: Values
    parts: list[Part]


def write_report_page(
    path: Path, title: str, recordings: Sequence[Measured], tables: Sequence[Table]
) -> None:
    """Write the page of one recording, or of two; `tables` stand below the charts."""
    legend = [(one.name, colour) for one, colour in zip(recordings, OF, strict=False)]
    most = len(COLOURS) // len(recordings)  # sections of a panel
    panels = [
        _lines(recordings, group, group.parts[begin : begin + most])
        for group in _groups(recordings[0])
        for begin in range(0, len(group.parts), most)
    ]
    dashed = f" Dashed: {escape(recordings[1].name)}." if len(recordings) > 1 else ""
    body = [
        f"<h1>{escape(title)}</h1>",
        scrolling(chart_svg([_every(recordings), _heat(recordings)], legend)),
        f"<h2>Sections</h2><p>A point is an application.{dashed}</p>{scrolling(chart_svg(panels, []))}",
    ]
    for one in recordings:
        if inside := within_stops(one):
            marks = [f"at {mark:.0f} km/h" for mark in MARKS]
            names = list(zip(["at the beginning", *marks], COLOURS, strict=False))
            body.append(f"<h2>Friction within a stop, {escape(one.name)}</h2>")
            body.append(scrolling(chart_svg(inside, names)))
    write_sheet(path, title, [*body, *map(html_of, tables)])


def _groups(of: Measured) -> list[_Group]:
    over_pressure = [part for part in of.parts if varies_pressure(of, part)]
    over_heat = [part for part in of.parts if varies_temperature(of, part)]
    fades = [part for part in of.parts if "fade" in part.name]
    running_in = [part for part in of.parts if "green" in part.name or "burnish" in part.name]
    others = [*over_pressure, *over_heat, *fades, *running_in]
    again = [part for part in of.parts if len(part.stops) >= FEWEST_POINTS and part not in others]
    groups = [
        _Group("over pressure", "pressure [bar]", _pressures, over_pressure),
        _Group("over temperature", HEAT, _temperatures, over_heat),
        _Group("in fade", "application", _applications, fades),
        _Group("in running-in", "application", _applications, running_in),
        _Group("application by application", "application", _applications, again),
    ]
    return [group for group in groups if group.parts]


def _pressures(of: Measured, part: Part) -> Vector:
    return np.asarray(of.conditions.pressure[part.stops])


def _temperatures(of: Measured, part: Part) -> Vector:
    return np.asarray(of.conditions.start[part.stops])


def _applications(of: Measured, part: Part) -> Vector:
    return np.asarray(part.places, float) + 1.0


def _lines(recordings: Sequence[Measured], group: _Group, parts: Sequence[Part]) -> Panel:
    lines = []
    for place, one in enumerate(recordings):
        theirs = {part.name: part for part in one.parts}
        for colour, part in zip(COLOURS, parts, strict=False):
            if (mine := theirs.get(part.name)) is not None:
                x = group.values(one, mine)
                order = np.argsort(x, kind="stable")
                lines.append(Line(x[order], one.mu(mine)[order], colour, dashed=place > 0))
    low, high = ends_of(*(line.y for line in lines))
    names = [(part.name, colour) for part, colour in zip(parts, COLOURS, strict=False)]
    axis = ends_of(*(line.x for line in lines))
    if group.values is _applications:
        last = float(max(line.x.max() for line in lines)) + 1.0
        axis = 0.0, last if last < TEN else TEN * float(np.ceil(last / TEN))  # ticks at whole numbers
    span = low - len(names) * NAME * (high - low), high
    return Panel(f"mean friction {group.title}", group.x_name, axis, span, lines, names=names)


def _every(recordings: Sequence[Measured]) -> Panel:
    span = ends_of(*(one.stops.mean for one in recordings))
    lines = [
        Line(_numbers(one), one.stops.mean, colour, marks=True)
        for one, colour in zip(recordings, OF, strict=False)
    ]
    return Panel("mean friction", "stop", ends_of(*map(_numbers, recordings)), span, lines)


def _heat(recordings: Sequence[Measured]) -> Panel:
    lines = [
        Line(_numbers(one), one.conditions.start, colour, marks=True)
        for one, colour in zip(recordings, OF, strict=False)
    ]
    heat = ends_of(*(one.conditions.start for one in recordings))
    return Panel(HEAT, "stop", ends_of(*map(_numbers, recordings)), heat, lines)


def _numbers(of: Measured) -> Vector:
    return np.arange(1.0, len(of.stops) + 1.0)


def within_stops(of: Measured) -> list[Panel]:
    """Return Figure 3.4: friction at the beginning and at MARKS over initial temperature, if it is there."""
    found = of.conditions
    panels = []
    for speed, pressure in WITHIN:
        alike = (np.abs(found.speed - speed) < ALIKE[0]) & np.isfinite(found.at_marks).all(axis=1)
        alike &= np.abs(found.pressure / pressure - 1.0) < ALIKE[1]
        heat, mu = found.start[alike], found.at_marks[alike]
        if len(set(np.round(heat / LEVEL))) >= FEWEST_POINTS:
            lines = [Line(heat, at, colour, marks=True) for at, colour in zip(mu.T, COLOURS, strict=False)]
            title = f"friction from {speed:.0f} km/h at {pressure:.0f} bar"
            panels.append(Panel(title, HEAT, ends_of(heat), ends_of(mu.ravel()), lines))
    return panels
