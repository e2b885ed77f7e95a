"""Bands and shades of the plots over time hide nothing and do not set the axis; shades cost no model each."""

from pathlib import Path

import numpy as np
import pytest
from bokeh.models import HoverTool

from brakelab.report.drive import DriveResult
from brakelab.report.over_time import plots_over_time
from ecu.contract.signals import CORNERS

from .conftest import braking_between


@pytest.mark.parametrize(("column", "plot"), [("mu_b", "friction-front"), ("disc_temperature", "disc-rear")])
def test_a_wide_band_hides_nothing_and_compresses_nothing(column: str, plot: str, tmp_path: Path) -> None:
    t = np.arange(0.0, 10.0, 0.01)
    columns = {f"{column}_{corner}": 0.4 + 0.01 * t for corner in CORNERS}
    columns |= {f"sigma_{column}_{corner}": np.full(len(t), 5.0) for corner in CORNERS}
    drawn = plots_over_time(DriveResult(t, columns, {}), None, [])[plot]
    glyphs = [type(one.glyph).__name__ for one in drawn.renderers]
    assert glyphs == ["Line"] * 6
    assert {one.glyph.y.split("_")[-2] for one in drawn.y_range.renderers} <= {"b", "temperature"}
    tips = next(tool for tool in drawn.tools if isinstance(tool, HoverTool)).tooltips
    assert [label for label, _ in tips] == [
        "time",
        "left",
        "left +2σ",
        "left −2σ",
        "right",
        "right +2σ",
        "right −2σ",
    ]


def test_many_brake_applications_make_no_more_models() -> None:
    t = np.arange(0.0, 300.0, 0.01)
    columns = {"vehicle_speed": 20.0 + 0.01 * t, "mode": np.ones(len(t)), "braking": np.ones(len(t))}
    drive = DriveResult(t, columns, {})
    few, many = (
        plots_over_time(drive, None, [braking_between(2.0 * i, 2.0 * i + 1.0) for i in range(count)])
        for count in (1, 100)
    )
    assert [len(plot.references()) for plot in few.values()] == [
        len(plot.references()) for plot in many.values()
    ]
    shades = {id(one): one for plot in many.values() for one in plot.renderers if one.level == "image"}
    assert len(shades) == 1  # shared, behind the grid
    for plot in many.values():
        hit = [one for tool in plot.select(type=HoverTool) for one in tool.renderers]
        assert hit
        assert not shades.keys() & map(id, hit)
