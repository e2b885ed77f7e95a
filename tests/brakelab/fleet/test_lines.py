"""Few vehicles: one line each over the drives that tell the quantity."""

from typing import Any

import numpy as np

from brakelab.fleet.lines import FEW, lines_of_vehicles
from brakelab.fleet.statistics import QUANTITIES


def drive(vehicle: str, bias: float | None) -> dict[str, Any]:
    return {"vehicle": vehicle, "prediction_bias": bias}


def test_a_line_each_in_percent_without_the_drives_that_do_not_tell() -> None:
    done = [drive("a", 0.01), drive("b", None), drive("a", None), drive("a", -0.02), drive("b", 0.03)]
    plot = lines_of_vehicles(done, QUANTITIES[2])
    found = [r.data_source.data for r in plot.renderers if type(r.glyph).__name__ == "Line"]
    np.testing.assert_allclose(found[0]["x"], [1, 3])
    np.testing.assert_allclose(found[0]["y"], [1.0, -2.0])
    np.testing.assert_allclose(found[1]["x"], [2])


def test_there_is_no_half_a_drive() -> None:
    assert lines_of_vehicles([drive("a", 0.01)], QUANTITIES[2]).xaxis[0].ticker.interval == 1
    assert lines_of_vehicles([drive("a", 0.01)] * 90, QUANTITIES[2]).xaxis[0].ticker.interval == 6


def test_lines_of_all_vehicles_differ() -> None:
    done = [drive(f"{k}", 0.01) for k in range(FEW)]
    plot = lines_of_vehicles(done, QUANTITIES[2])
    looks = {
        (r.glyph.line_color, str(r.glyph.line_dash)) for r in plot.renderers if hasattr(r.glyph, "line_dash")
    }
    assert len(looks) >= FEW
