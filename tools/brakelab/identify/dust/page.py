"""Page of an identification of dust: trips (Table 8.1), models by Table 8.3, Figures 8.2 to 8.8."""

from pathlib import Path
from typing import Final

import numpy as np

from brakelab.arrays import Array
from brakelab.identify.dust.features import Applications
from brakelab.identify.dust.fit import Judged, spearman
from brakelab.identify.dust.model import LEAST_PARTICLES, resample, samples_of
from brakelab.results.chart import BLUE, GREY, ORANGE, PINK, Cells, Line, Panel, write_chart
from brakelab.results.text_table import Table, markdown
from ecu.contract.dust import FEATURES

LEGEND: Final = (("chosen", BLUE), ("others", ORANGE), ("95 %, and the background's line", PINK))
CELLS: Final = 25  # edges of the map's cells, in each direction
SHOWN_S: Final = 300.0  # of a trip
CLASS: Final = 0.25  # of EF
THESIS: Final = {"LUT": -32.68, "static ANN": -9.07, "dynamic ANN": -3.95}
"""%, sum of particles of Trip 8, Table 8.2."""


def trip_table(trips: list[Applications]) -> Table:
    """Return the trips beside Table 8.1."""
    rows = [
        (
            trip.trip + (" (test)" if trip.test else ""),
            f"{trip.km:.0f}",
            f"{trip.decel.mean():.2f}",
            f"{trip.decel.var():.2f}",
            f"{len(trip.particles)}",
            f"{1e-6 * trip.energy.sum():.2f}",
            f"{1e-9 * trip.particles.sum() / trip.km:.2f}",
            f"{trip.background.still:.0f} + {trip.background.by_speed:.0f} v",
            f"{trip.delay_s:.1f}",
        )
        for trip in trips
    ]
    return Table(
        "Trips",
        ("trip", "km", "mean a_x [m/s²]", "var a_x", "applications", "E_b [MJ]", "ΣPN [10⁹/km]",
         "background [1/cm³]", "transport delay of the air [s]"),
        rows,
        "As Table 8.1: one front brake. Background: what cruising shows against the speed v in m/s "
        "(Figure 8.2). Transport delay: until the counter follows the friction power best.",
    )  # fmt: skip


def model_table(judged: list[Judged], chosen: Judged) -> Table:
    """Return the models' KPIs (Table 8.3, Figure 8.9), and Table 8.2's errors beside."""
    rows = []
    for one in judged:
        test = one.test
        rows.append(
            (
                f"**{one.name}**" if one is chosen else one.name,
                f"{one.model.size}",
                f"{one.seconds:.2f}",
                f"{one.left_out_rms:.3f}",
                f"{100 * one.left_out_sum:.1f}",
                f"{100 * one.left_out_root:.1f}",
                f"{one.factor:.2f}",
                f"{one.below:+.2f} … {one.above:+.2f}",
                *(
                    ("–",) * 5
                    if test is None
                    else (
                        f"{100 * test.sum_error:+.1f}",
                        f"{100 * ((1.0 + test.sum_error) / one.factor - 1.0):+.1f}",
                        f"{test.vaf:.2f}",
                        f"{test.nrmse:.4f}",
                        f"{100 * test.covered:.0f}",
                    )
                ),
                f"{THESIS[one.name]:+.1f}" if one.name in THESIS else "–",
            )
        )
    return Table(
        "Models",
        ("model", "numbers", "training [s]", "left out: EF, RMS", "left out: ΣPN, RMS [%]",
         "left out: √PN, RMS [%]", "factor", "95 % of EF", "test: ΣPN [%]", "without factor [%]", "VAF",
         "nRMSE", "inside 95 % [%]", "thesis: ΣPN [%]"),
        rows,
        "Left out: each trip by a model of the others; the least √PN is chosen. Factor: particles over ten "
        "to the EF, for the mean of a logarithm is not the logarithm of the mean. ΣPN: predicted over "
        "counted, minus 1, as Table 8.2 (the definition in Table 8.3 has the other sign). Bold: goes into "
        "the configuration.",
    )  # fmt: skip


def spearman_table(trips: list[Applications]) -> Table:
    """Return the rank correlations (Figure 8.6)."""
    names, matrix = spearman(trips)
    rows = [
        (name, *(f"{value:+.2f}" for value in row)) for name, row in zip(names, np.array(matrix), strict=True)
    ]
    return Table("Spearman", ("", *names), rows, "Rank correlations of all trips, as Figure 8.6.")


def _pairs(judged: Judged, trips: list[Applications]) -> tuple[Array, Array]:
    """Return counted and predicted EF in the order of the counted one."""
    features, sequences, counted = (
        np.concatenate([getattr(trip, name) for trip in trips])
        for name in ("features", "sequences", "particles")
    )
    known = counted > LEAST_PARTICLES
    measured = np.log10(counted[known])
    order = np.argsort(measured)
    return measured[order], judged.model.predict(features, sequences)[known][order]


def _beside(ends: tuple[float, float], less: float, colour: str) -> Line:
    """Return the line y = x - `less` where both are within `ends`."""
    x = np.array([max(ends[0], ends[0] + less), min(ends[1], ends[1] + less)])
    return Line(x, x - less, colour, less != 0.0)


def dust_panels(trips: list[Applications], judged: list[Judged], chosen: Judged) -> list[Panel]:
    """Return Figures 8.2, 8.8, 8.4, 8.5 and 8.3: background by speed, predicted over counted EF, the map."""
    shown = [trip for trip in trips if trip.test] or trips
    first = shown[0].background
    top = 1.3 * float(max(first.levels.max(initial=1.0), first.still))
    speed = np.linspace(0.0, 35.0, 50)
    line = first.still + first.by_speed * speed
    panels = [
        Panel("background [1/cm³]", "speed [m/s]", (0.0, 35.0), (0.0, max(top, float(line[-1]))), [
            Line(first.speeds, first.levels, BLUE), Line(speed, line, PINK, True),
        ])
    ]  # fmt: skip
    for one in judged:
        counted, said = _pairs(one, shown)
        ends = float(np.floor(min(counted.min(), said.min()))), float(np.ceil(max(counted.max(), said.max())))
        lines = [
            Line(counted, said, BLUE if one is chosen else ORANGE, marks=True),
            _beside(ends, 0.0, GREY),
            _beside(ends, one.below, PINK),
            _beside(ends, one.above, PINK),
        ]
        panels.append(Panel(f"EF by {one.name}", "EF counted", ends, ends, lines))
    trained = [trip for trip in trips if not trip.test]
    table = next(one for one in judged if one.name == "LUT")
    return [*panels, resampling_panel(trained), map_panel(trained, table), *extraction_panels(shown[0])]


def map_panel(trips: list[Applications], table: Judged) -> Panel:
    """Return the EF of the table over speed and pressure, beside the counted applications (Figure 8.5)."""
    features = np.concatenate([trip.features for trip in trips])
    speeds, pressures = features[:, FEATURES.index("v_in")], features[:, FEATURES.index("pressure")]
    x, y = (np.linspace(0.0, float(np.quantile(values, 0.99)), CELLS) for values in (speeds, pressures))
    grid = np.zeros((CELLS - 1, CELLS - 1, len(FEATURES)))
    grid[..., FEATURES.index("v_in")] = 0.5 * (x[1:] + x[:-1])
    grid[..., FEATURES.index("pressure")] = 0.5 * (y[1:] + y[:-1])[:, None]
    value = table.model.predict(grid.reshape(-1, len(FEATURES)), np.empty(0)).reshape(CELLS - 1, CELLS - 1)
    low, high = float(value.min()), float(value.max())
    title = f"EF by LUT, {low:.1f} to {high:.1f} (dark), 2σ {2.0 * table.left_out_rms:.1f}; pressure [bar]"
    inside = (speeds <= x[-1]) & (pressures <= y[-1])
    dots = Line(speeds[inside], pressures[inside], ORANGE, marks=True)
    ends = ((0.0, float(x[-1])), (0.0, float(y[-1])))
    return Panel(title, "speed before [m/s]", *ends, [dots], cells=Cells(x, y, value, low, high))


def extraction_panels(trip: Applications) -> list[Panel]:
    """Return some minutes of a trip with its applications and their means (Figure 8.3)."""
    of = trip.recorded
    if of is None or len(trip.start) == 0:
        return []
    begin = float(trip.start[len(trip.start) // 2]) - 0.5 * SHOWN_S
    rows = (of.t >= begin) & (of.t < begin + SHOWN_S)
    t, means = of.t[rows], (trip.start >= begin) & (trip.start < begin + SHOWN_S)
    ends = trip.start + trip.features[:, FEATURES.index("duration")]
    braked = [(t >= start) & (t <= end) for start, end in zip(trip.start[means], ends[means], strict=True)]
    found = []
    for title, values, feature in (
        ("speed [m/s]", of.speed, ""),
        ("pressure [bar]", of.pressure, "pressure"),
        ("torque [N m]", of.torque, "torque"),
        ("disc [°C]", of.temperature, "temperature"),
        ("counter [1/cm³]", of.concentration, ""),
    ):
        shown = values[rows]
        lines = [Line(t, shown, GREY), *(Line(t[part], shown[part], ORANGE) for part in braked)]
        if feature:
            middle = 0.5 * (trip.start + ends)[means]
            lines.append(Line(middle, trip.features[means, FEATURES.index(feature)], BLUE, marks=True))
        low, high = float(shown.min()), float(shown.max())
        margin = 0.05 * max(high - low, 1e-9)
        span = (low - margin, high + margin)
        found.append(Panel(f"{trip.trip}: {title}", "t [s]", (begin, begin + SHOWN_S), span, lines))
    return found


def resampling_panel(trips: list[Applications]) -> Panel:
    """Return how frequent each EF is, as counted and as networks are trained (Figure 8.4)."""
    factor = samples_of(trips).factor
    edges = np.arange(np.floor(factor.min()), np.ceil(factor.max()) + CLASS, CLASS)
    shares = [
        100.0 * np.histogram(values, edges)[0] / len(values)
        for values in (factor, factor[resample(factor, 0)])
    ]
    lines = [
        Line(np.repeat(edges, 2)[1:-1], np.repeat(share, 2), colour)
        for share, colour in zip(shares, (GREY, BLUE), strict=True)
    ]
    top = 1.1 * float(max(share.max() for share in shares))
    title = "applications [%], as counted grey, resampled blue"
    return Panel(title, "EF", (float(edges[0]), float(edges[-1])), (0.0, top), lines)


def write_page(page: Path, trips: list[Applications], judged: list[Judged], chosen: Judged) -> None:
    """Write the tables with the panels of `dust_panels` above them."""
    picture = page.with_suffix(".svg")
    write_chart(picture, dust_panels(trips, judged, chosen), LEGEND)
    tables = [model_table(judged, chosen), trip_table(trips), spearman_table(trips)]
    figures = f"![Figures 8.2, 8.8, 8.4, 8.5 and 8.3]({picture.name})"
    head = f"# Emission of one brake by {len(trips)} trips\n\n{figures}\n\n"
    page.write_text(head + "\n".join(map(markdown, tables)).rstrip() + "\n", encoding="utf-8")
