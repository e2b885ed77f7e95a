"""Plots of wear and dust: lining over distance, and emission over energy and temperature."""

from typing import Any, Final

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool
from bokeh.models.annotations import Span

from brakelab.arrays import Vector
from brakelab.report.accuracy import AXLES
from brakelab.report.drive import DriveResult
from brakelab.report.look import FAILED, LEFT, RIGHT, free_figure
from brakelab.report.wear_applications import Application
from brakelab.report.wear_roads import distance
from brakelab.results.pads import PadState
from ecu.contract.signals import CORNERS

BAND: Final = 1.96
"""Standard deviations of a 95 % band."""
POINTS: Final = 400
"""Of a line: wear rises in small steps."""
_COLOURS: Final = (LEFT, RIGHT, LEFT, RIGHT)


def plots_of_wear(drive: DriveResult, truth: DriveResult | None, pads: list[PadState]) -> dict[str, Any]:
    """Return wear in the drive and each axle's lining over distance, by name; empty if nothing is known."""
    worn = drive.corners("pad_wear")
    known = [i for i, corner in enumerate(CORNERS) if drive.has(f"pad_wear_{corner}")]
    if not known:
        return {}
    km = 1e-3 * distance(drive)
    some = np.unique(np.linspace(0, len(km) - 1, POINTS).astype(int))
    plots = {"wear-drive": _in_drive(km[some], worn[some], known, truth, some)}
    for axle, wheels in AXLES.items():
        own = [pad for i, pad in enumerate(pads) if i in known and i in range(4)[wheels]]
        if own:
            sigma = drive.corners("sigma_pad_wear")[some]
            plots[f"lining-{axle}"] = _lining(axle, own, km[some], worn[some], sigma)
    return plots


def _in_drive(km: Vector, worn: Vector, known: list[int], truth: DriveResult | None, some: Any) -> Any:
    plot = _figure("Distance in this drive [km]", "Worn off in this drive [µm]")
    for i in known:
        width, alpha = (2.0, 1.0) if i < 2 else (1.2, 0.6)
        look: dict[str, Any] = {"line_color": _COLOURS[i], "line_width": width, "line_alpha": alpha}
        plot.line(km, 1e3 * (worn[:, i] - worn[0, i]), legend_label=CORNERS[i], **look)
        true = None if truth is None else truth.column(f"pad_wear_{CORNERS[i]}")[some]
        if true is not None and np.isfinite(true).any():
            lost = 1e3 * (true - true[np.isfinite(true)][0])
            plot.line(km, lost, line_color=_COLOURS[i], line_dash="dashed", legend_label="true")
    return plot


def _lining(axle: str, pads: list[PadState], km: Vector, worn: Vector, sigma: Vector) -> Any:
    """Return the thickness in this drive, and from its end on with the wear per km so far."""
    plot = _figure("Distance with these pads [km]", f"Lining {axle} [mm]")
    for pad in pads:
        i = CORNERS.index(pad.corner)
        at = max(pad.driven, km[-1]) - km[-1] + km
        thickness = pad.thickness_new - worn[:, i]
        look: dict[str, Any] = {"fill_color": _COLOURS[i], "fill_alpha": 0.14}
        low, high = (
            np.clip(thickness + sign * BAND * sigma[:, i], 0.0, pad.thickness_new) for sign in (-1.0, 1.0)
        )
        plot.varea(at, low, high, legend_label="95 %", **look)
        plot.line(at, thickness, line_color=_COLOURS[i], line_width=2.0, legend_label=CORNERS[i])
        if np.isfinite(pad.remaining):
            least, end = pad.thickness_worn, at[-1]
            ahead = (end, end + pad.remaining_low, end + pad.remaining_high, end)
            plot.patch(
                ahead, (max(low[-1], least), least, least, max(high[-1], least)), line_color=None, **look
            )
            line = {"line_color": _COLOURS[i], "line_dash": "dotted", "legend_label": "ahead"}
            plot.line((end, end + pad.remaining), (thickness[-1], least), line_width=1.6, **line)
    worn_out = Span(location=pads[0].thickness_worn, dimension="width", line_color=FAILED, line_dash="dashed")
    plot.add_layout(worn_out)
    plot.xaxis.ticker.desired_num_ticks = 5
    plot.y_range.update(start=0.0, end=1.04 * pads[0].thickness_new)
    return plot


def plots_of_emission(applications: list[Application]) -> dict[str, Any]:
    """Return log10 of the particles of a brake over energy and over temperature; empty: none known."""
    energy, heat, factor, low, high = (
        np.array([getattr(each, name) for each in applications]).reshape(-1, 4)
        for name in ("energies", "heat", "factor", "factor_low", "factor_high")
    )
    start = np.array([each.t_start for each in applications])
    plots = {}
    for name, label, x, kind in (
        ("emission-energy", "Energy of the brake [kJ]", 1e-3 * energy, "log"),
        ("emission-heat", "Disc temperature [°C]", heat, "linear"),
    ):
        known = np.isfinite(factor) & np.isfinite(x) & (x > 0.0)
        if not known.any():
            continue
        plot = _figure(label, "Particles of the brake [log10]", x_axis_type=kind)
        for i in np.flatnonzero(known.any(axis=0)):
            rows = known[:, i]
            columns = {"x": x, "factor": factor, "low": low, "high": high}
            source = ColumnDataSource({k: v[rows, i] for k, v in columns.items()} | {"start": start[rows]})
            plot.segment("x", "low", "x", "high", source=source, line_color=_COLOURS[i], line_alpha=0.25)
            look: dict[str, Any] = {
                "marker": "circle" if i < 2 else "triangle",
                "size": 6,
                "line_color": None,
            }
            look |= {"fill_color": _COLOURS[i], "fill_alpha": 0.8, "legend_label": CORNERS[i]}
            dots = plot.scatter("x", "factor", source=source, **look)
            tips = [
                ("start", "@start{0.0} s"),
                ("log10", "@factor{0.00}"),
                ("95 %", "@low{0.00} to @high{0.00}"),
            ]
            plot.add_tools(HoverTool(renderers=[dots], tooltips=tips))
        plots[name] = plot
    return plots


def _figure(x_label: str, y_label: str, **options: Any) -> Any:
    plot = free_figure(x_label, y_label, **options)
    plot.ygrid.grid_line_alpha = 0.6
    return plot
