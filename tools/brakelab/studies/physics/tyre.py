"""Tyres and pressure steps of the simulated car beside Figures 4.7, A.5, A.6 and A.10b."""

from typing import Final

import numpy as np

from brakelab.plant.records import RecordArray
from brakelab.plant.tyre import degressive, steady_forces, stiffnesses
from brakelab.results.chart import BLUE, GREEN, GREY, ORANGE, PINK, Line, Panel
from brakelab.studies.physics.staircase import DT, respond

ROAD: Final = 1.2  # dry (A.2.1)
SLIPS: Final = np.concatenate([[0.0], np.geomspace(1e-3, 0.4, 120)])
ANGLES: Final = ((0.0, GREY), (2.0, BLUE), (5.0, GREEN), (10.0, ORANGE))  # degrees
LOADS: Final = (0.5, 1.0, 1.5)
"""Of the nominal one."""
SEVENTH: Final = (60.0, 70.0)  # bar, of the staircase
ZOOM: Final = 0.3  # s

LEGEND: Final = [(f"{angle:.0f}° of side slip", colour) for angle, colour in ANGLES]


def utilisation(car: RecordArray, load: float, slip: float, angle: float) -> tuple[float, float]:
    """Return longitudinal and lateral force over the load [N] of the front left tyre on a dry road.

    `slip` as a share, `angle` [degrees].
    """
    one = car[0]
    peak = degressive(ROAD, one["friction_degression"], load, one["nominal_load"][0])
    along, across, _ = steady_forces(
        one, *stiffnesses(one, 0, load), peak, slip, float(np.tan(np.deg2rad(angle)))
    )
    return along / load, across / load


def tyre_panels(car: RecordArray) -> list[Panel]:
    """Return the figures for a plant's parameters, shape (1,); dashed: what observers take the tyre for."""
    nominal = float(car["nominal_load"][0, 0])
    loads = nominal * np.linspace(0.2, 2.0, 30)
    stiffness = np.array([stiffnesses(car[0], 0, load)[0] for load in loads])
    at_nominal = stiffnesses(car[0], 0, nominal)[0]
    top = 1.05e-3 * max(float(stiffness.max()), 2.0 * at_nominal)
    lines = [
        Line(1e-3 * loads, 1e-3 * stiffness, PINK),
        Line(1e-3 * loads, 1e-3 * at_nominal * loads / nominal, GREY, True),
    ]
    ends = (0.0, 2e-3 * nominal)
    found = [Panel("4.7: slip stiffness [kN]", "wheel load [kN]", ends, (0.0, top), lines)]
    circle, along, across = [], [], []
    for angle, colour in ANGLES:
        x, y = np.array([utilisation(car, nominal, slip, angle) for slip in SLIPS]).T
        circle.append(Line(x, y, colour))
        for share in LOADS:
            x, y = np.array([utilisation(car, share * nominal, slip, angle) for slip in SLIPS]).T
            along.append(Line(100.0 * SLIPS, x, colour, share != 1.0))
            across.append(Line(100.0 * SLIPS, y, colour, share != 1.0))
    most = 1.1 * ROAD
    found += [
        Panel("A.5: lateral over longitudinal", "longitudinal [–]", (0.0, most), (-0.05, most), circle),
        Panel("A.6a: longitudinal; dashed: loads × 0.5, 1.5", "slip [%]", (0.0, 40.0), (0.0, most), along),
        Panel("A.6b: lateral; dashed: loads × 0.5, 1.5", "slip [%]", (0.0, 40.0), (-0.05, most), across),
    ]
    pressure = respond(*SEVENTH)[: round(ZOOM / DT)]
    t = DT * np.arange(1.0, len(pressure) + 1.0)
    step = [Line(t, np.full_like(t, SEVENTH[1]), GREY, True), Line(t, pressure, PINK)]
    return [*found, Panel("A.10b: pressure [bar], step 7", "t [s]", (0.0, ZOOM), (59.0, 72.0), step)]
