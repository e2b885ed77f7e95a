"""Report page: fills the template with facts, tiles, tables and plots with their browser code."""

import json
import math
from collections.abc import Mapping, Sequence
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any, Final, NamedTuple

from bokeh.document import Document
from bokeh.embed import components
from bokeh.resources import Resources
from jinja2 import DictLoader, Environment, StrictUndefined

from brakelab.report.look import DARK
from brakelab.results.outputs import check_outputs
from ecu.errors import UserError

PAGE: Final[Traversable] = files("brakelab.report") / "page.html.j2"
PARTS: Final = (
    "frame.html.j2",
    "figures.html.j2",
    "brakings_table.html.j2",
    "brakes_section.html.j2",
    "wear_section.html.j2",
)
"""What pages extend, import and include."""
_NONE = "–"


class Tile(NamedTuple):
    """One figure of the summary; `warns`: it needs attention."""

    title: str
    value: str
    unit: str
    note: str
    warns: bool = False


def check_page(out: Path, read: Sequence[Path]) -> None:
    """Refuse a page that would not end in .html or replace a file of `read`. Raises UserError."""
    check_outputs(out, [out], read)
    if out.suffix.lower() not in (".html", ".htm"):
        raise UserError("--out", str(out), "the report is a web page; let the name end in .html")


def fixed(value: float, digits: int) -> str:
    """Return the number with `digits` decimals and a true minus sign, a dash if unknown."""
    return f"{value:.{digits}f}".replace("-", "\N{MINUS SIGN}") if math.isfinite(value) else _NONE


def percent(share: float, digits: int) -> str:
    """Return a share as a percentage without the sign for per cent."""
    return fixed(100.0 * share, digits)


def signed_percent(share: float, digits: int) -> str:
    """Return a share as a percentage with its sign."""
    return f"{100.0 * share:+.{digits}f}".replace("-", "\N{MINUS SIGN}") if math.isfinite(share) else _NONE


def kmh(speed: float) -> str:
    """Return a speed in m/s as whole km/h."""
    return fixed(abs(speed) * 3.6, 0)


def _known(value: float | None) -> float:
    return math.nan if value is None else value


def embed(figures: Mapping[str, Any]) -> tuple[str, dict[str, str]]:
    """Return the script that draws the figures, and the place of each, by name."""
    if not figures:
        return "", {}
    document = Document()
    with document.models.freeze():  # else every figure added walks through all of them once more
        for figure in figures.values():
            document.add_root(figure)
    return components(dict(figures))


def environment() -> Environment:
    """Return what fills templates: with the parts and the forms of numbers."""
    here = files("brakelab.report")
    # Autoescape: names of files and metadata come from outside.
    page = Environment(
        loader=DictLoader({name: (here / name).read_text("utf-8") for name in PARTS}),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    page.filters.update(known=_known, fixed=fixed, percent=percent, signed_percent=signed_percent, kmh=kmh)
    return page


def fill(
    plots: Mapping[str, Mapping[str, Any]],
    content: Mapping[str, Any],
    template: Traversable = PAGE,
) -> str:
    """Return the page; `plots` maps the template's places to figures by name, `content` is the rest.

    A page without figures runs no script.
    """
    figures = {name: plot for group in plots.values() for name, plot in group.items()}
    script, divs = embed(figures)
    here = files("brakelab.report")
    return (
        environment()
        .from_string(template.read_text("utf-8"))
        .render(
            css=(here / "page.css").read_text("utf-8"),
            js=(here / "page.js").read_text("utf-8"),
            dark=json.dumps(DARK),
            bokeh=Resources(mode="inline", components=["bokeh"]).render() if figures else "",
            script=script,
            **{
                place: [{"div": divs[name], "height": plot.height} for name, plot in group.items()]
                for place, group in plots.items()
            },
            **content,
        )
    )
