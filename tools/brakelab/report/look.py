"""Colours and figure style. Each colour has one meaning throughout, distinct for colour-blind readers.

Left and right, estimated and demanded come from the palette of Okabe and Ito (2008); truth is always dashed.
"""

from typing import Any, Final

from bokeh.models import Range1d, SingleIntervalTicker
from bokeh.models.annotations import Legend, Span
from bokeh.models.tools import CrosshairTool
from bokeh.plotting import figure

INK: Final = "#1b1f24"
QUIET: Final = "#5b6470"
GRID: Final = "#e3e6ea"
LEFT: Final = "#0072b2"
RIGHT: Final = "#d55e00"
ESTIMATE: Final = "#0073b3"
DEMAND: Final = "#007d5b"
IDLE: Final = "#c9ced5"
HOLDING: Final = "#7fbfe6"
DEGRADED: Final = "#e69f00"
FAILED: Final = "#a8123a"
SHADE: Final = "#eef1f4"
STAGE_COLOURS: Final = ("#0074b4", "#e69f01", "#007e5c", "#b0588f", "#5b6471")

# Replacement of each colour on a dark screen by the page's script; no value stands on both sides.
DARK: Final = {
    INK: "#e8ebef",
    QUIET: "#a3acb8",
    GRID: "#2c323a",
    LEFT: "#5ab4f0",
    RIGHT: "#ff9248",
    ESTIMATE: "#5ab4f1",
    DEMAND: "#2fc79a",
    IDLE: "#4b535e",
    HOLDING: "#2b6c96",
    DEGRADED: "#e6a817",
    FAILED: "#ff5c7f",
    SHADE: "#20262d",
    STAGE_COLOURS[0]: "#5ab4f2",
    STAGE_COLOURS[1]: "#e6a818",
    STAGE_COLOURS[2]: "#2fc79b",
    STAGE_COLOURS[3]: "#e08cc0",
    STAGE_COLOURS[4]: "#a3acb9",
}

BOUND: Final = {"line_width": 0.7, "line_alpha": 0.6}
"""Style of the ends of a band: filled, it would hide the grid and the other wheel's."""
TIME: Final = "Time [s]"
TOOLS: Final = "xpan,xbox_zoom,box_zoom,xwheel_zoom,undo,reset,save"


def new_figure(x_label: str, y_label: str, height: int = 225, **options: Any) -> Any:
    """Return an empty figure in the page's style, as wide as its place, with its legend above."""
    plot = figure(
        sizing_mode="stretch_width",
        height=height,
        tools=options.pop("tools", TOOLS),
        active_drag=options.pop("active_drag", "xbox_zoom"),
        toolbar_inner=True,
        toolbar_location="right",
        x_axis_label=x_label,
        y_axis_label=y_label,
        background_fill_alpha=0.0,
        border_fill_alpha=0.0,
        outline_line_color=None,
        min_border_left=options.pop("min_border_left", 62),
        min_border_right=12,
        lod_threshold=None,
        **options,
    )
    plot.toolbar.autohide = True
    plot.toolbar.logo = None
    plot.grid.grid_line_color = GRID
    for axis in plot.axis:
        style_axis(axis).axis_label_standoff = 4
    legend = Legend(
        orientation="horizontal",
        border_line_color=None,
        background_fill_alpha=0.0,
        label_text_color=INK,
        label_text_font_size="12px",
        click_policy="hide",
        margin=0,
        spacing=14,
        glyph_width=26,
        inactive_fill_alpha=0.0,
    )
    legend.update(padding=2)
    plot.add_layout(legend, "above")
    return plot


def free_figure(x_label: str, y_label: str, height: int = 300, **options: Any) -> Any:
    """Return an empty figure of no other's range: it is moved and zoomed along both axes."""
    tools = "pan,box_zoom,reset,save"
    return new_figure(x_label, y_label, height, tools=tools, active_drag="box_zoom", **options)


def time_figure(label: str, span: Range1d, least_span: float) -> Any:
    """Return an empty figure over the time of a drive, `span`; its own axis spans `least_span` at least."""
    plot = new_figure(TIME, label, x_range=span, window_axis="x")
    plot.y_range.min_interval = least_span
    return plot


def style_axis(axis: Any) -> Any:
    """Return an axis in the page's style."""
    axis.axis_label_text_font_style = "normal"
    axis.axis_label_text_font_size = "12px"
    axis.major_label_text_font_size = "11px"
    axis.axis_label_text_color = INK
    axis.major_label_text_color = QUIET
    axis.axis_line_color = QUIET
    axis.major_tick_line_color = QUIET
    axis.minor_tick_line_color = None
    return axis


def number_applications(plot: Any, count: int) -> None:
    """Let the x axis count brake applications."""
    plot.xaxis.ticker = SingleIntervalTicker(interval=max(1, -(-count // 15)))
    plot.xgrid.grid_line_color = None


def draw_line(plot: Any, source: Any, name: str, label: str, colour: str, **style: Any) -> None:
    """Draw a quantity over time and enter it in the legend, if the drive has it."""
    if name in source.column_names:
        style = {"line_width": 1.6, **style}
        plot.line("t", name, source=source, line_color=colour, legend_label=label, **style)


def link_crosshair(plots: list[Any]) -> None:
    """Let one vertical line follow the mouse through all plots."""
    span = Span(dimension="height", line_color=QUIET, line_width=1, line_dash="dotted")
    for plot in plots:
        plot.add_tools(CrosshairTool(overlay=span))
