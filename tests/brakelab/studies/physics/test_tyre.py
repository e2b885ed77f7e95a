"""Tyre figures: Kamm's circle, the peak falls with load, the stiffness is the slope at no slip."""

import numpy as np
import pytest

from brakelab.plant.description import load_plant, nominal
from brakelab.studies.physics.tyre import ROAD, tyre_panels, utilisation
from ecu.settings.resources import resource


def test_the_figures_are_of_the_tyre() -> None:
    car = nominal(load_plant(resource("config/plant/suv.toml")))
    load = float(car["nominal_load"][0, 0])
    stiffness, circle, along, across, step = tyre_panels(car)
    assert [panel.title.split(":")[0] for panel in (stiffness, circle, along, across, step)] == [
        "4.7", "A.5", "A.6a", "A.6b", "A.10b",
    ]  # fmt: skip
    for line in circle.lines:
        assert np.hypot(line.x, line.y).max() <= ROAD + 1e-9
    assert max(line.y.max() for line in along.lines[1:2]) == pytest.approx(ROAD, rel=0.01)
    light, heavy = along.lines[0].y.max(), along.lines[2].y.max()
    assert light > ROAD > heavy
    assert [line.y[0] for line in across.lines[1::3]] == sorted(line.y[0] for line in across.lines[1::3])
    slope = utilisation(car, load, 1e-5, 0.0)[0] / 1e-5
    at = np.interp(1e-3 * load, stiffness.lines[0].x, stiffness.lines[0].y)
    assert slope * load == pytest.approx(1e3 * at, rel=0.01)
    pressure = step.lines[1]
    assert np.interp(0.02, pressure.x, pressure.y) == pytest.approx(60.0, abs=0.2)
    assert pressure.y[-1] == pytest.approx(70.0, abs=0.3)
