"""Heating and cooling of the disc beside Figures 3.7 and 3.8, with delta_1 as printed and a tenth of it."""

from typing import Final

import numpy as np

from brakelab.plant.disc import WET, biot_number, cooling_rate
from brakelab.plant.dynamometer import AMBIENT, PRESSURE, cool, new_stop, run_stop
from brakelab.plant.linings import Linings, rig_with
from brakelab.plant.records import RecordArray
from brakelab.results.chart import BLUE, GREY, ORANGE, Line, Panel
from brakelab.results.text_table import Table

KMH: Final = 1.0 / 3.6  # m/s
BRAKES: Final = ("A", "B", "C")
PRINTED: Final = 10.0  # delta_1 of Table C.1 over that of the lining file


def rig_of(linings: Linings, brake: str, law: str, delta_1: float = 1.0) -> RecordArray:
    """Return the rig with this brake's lining, delta_1 multiplied."""
    rig = rig_with(linings.lining[brake], law)
    rig["cooling_by_speed"] *= delta_1
    return rig


def _span(values: list[float]) -> str:
    return f"{min(values):.0f} to {max(values):.0f}"


def heat_panels(linings: Linings) -> list[Panel]:
    """Return Figures 3.6b, 3.7 and 3.8: cooling over speed, a disc that cools, and one that a stop heats.

    Grey: the conventional model (delta_1 = 0); blue: delta_1 as in the lining file; orange: as printed.
    """
    disc = linings.lining["A"].disc
    kinds = ((0.0, GREY), (1.0, BLUE), (PRINTED, ORANGE))
    speed, t = np.linspace(0.0, 40.0, 2), np.linspace(0.0, 900.0, 100)

    def rate(factor: float, at: float) -> float:
        return cooling_rate(disc.cooling, factor * disc.cooling_by_speed, at, 0.0)

    lines = [Line(speed, 1e3 * np.array([rate(factor, v) for v in speed]), c) for factor, c in kinds]
    top = 1.05 * float(lines[-1].y.max())
    found = [Panel("3.6b A: cooling [10⁻³/s]", "speed [m/s]", (0.0, 40.0), (0.0, top), lines)]
    for kmh in (30.0, 130.0):
        lines = [
            Line(t, AMBIENT + (400.0 - AMBIENT) * np.exp(-rate(factor, kmh * KMH) * t), c)
            for factor, c in kinds
        ]
        found.append(Panel(f"3.7 A: disc [°C], {kmh:.0f} km/h", "t [s]", (0.0, 900.0), (0.0, 400.0), lines))
    for kmh in (50.0, 130.0):
        lines = []
        for factor, c in kinds:
            stop = new_stop(PRESSURE, kmh * KMH, 5.0 * KMH, 220.0, pressure=30e5)
            trace = run_stop(rig_of(linings, "A", "SIM", factor), stop)
            lines.append(Line(np.array(trace["t"]), np.array(trace["temperature"]), c))
        ends = (0.0, float(lines[0].x[-1]))
        high = 1.02 * max(float(line.y.max()) for line in lines)
        found.append(Panel(f"3.8 A: disc [°C], from {kmh:.0f} km/h", "t [s]", ends, (215.0, high), lines))
    return found


def heat_tables(linings: Linings) -> list[Table]:
    """Return the tables of cooling, of heating in a stop and of the Biot number."""
    speeds = (0.0, 30.0, 60.0, 100.0, 130.0)
    cooling, heating, biot = [], [], []
    at_100, less = dict[str, list[float]](), dict[float, list[float]]()
    for brake in BRAKES:
        disc = linings.lining[brake].disc
        for name, factor, wetness in (
            ("printed", PRINTED, 0.0),
            ("a tenth", 1.0, 0.0),
            ("a tenth, wet", 1.0, 1.0),
        ):
            rig = rig_of(linings, brake, "R1", factor)
            rig["wetness"] = wetness
            seconds = [cool(rig, speed * KMH, 400.0, 100.0) for speed in speeds]
            at_100.setdefault(name, []).append(seconds[speeds.index(100.0)])
            cooling.append((brake, name, *(f"{value:.0f}" for value in seconds)))
        for start in (50.0, 100.0, 130.0):
            rises = list[float]()
            for factor in (0.0, PRINTED, 1.0):
                rig = rig_of(linings, brake, "SIM", factor)
                trace = run_stop(rig, new_stop(PRESSURE, start * KMH, 5.0 * KMH, 220.0, pressure=30e5))
                rises.append(float(trace["temperature"][-1]) - 220.0)
                less.setdefault(factor, []).append(1.0 - rises[-1] / rises[0])
            rig = rig_of(linings, brake, "SIM")
            adiabatic = 0.5 * float(rig[0]["mass"]) * (start * KMH) ** 2 * disc.heating
            figures = (f"{value:.1f}" for value in (trace["t"][-1], adiabatic, *rises))
            heating.append((f"{brake} {start:.0f} km/h", *figures))
        cells = []
        for speed in (0.0, 30.0):
            for factor in (PRINTED, 1.0):
                rate = cooling_rate(disc.cooling, factor * disc.cooling_by_speed, speed, 0.0)
                cells.append(f"{biot_number(disc.heating, rate, 0.45, 0.5 * disc.diameter):.2f}")
        biot.append((brake, *cells))
    return [
        Table(
            "Disc: seconds from 400 to 100 °C at constant speed",
            ("brake", "delta_1", *(f"{speed:.0f} km/h" for speed in speeds)),
            cooling,
            "Figure 3.7 has no table. It shows cooling from 400 °C at a low and a high cruising speed, "
            "beside the conventional model (delta_1 = 0: the time at 0 km/h, whatever the speed); with both "
            "sets the models part the more the faster the car. At 100 km/h a disc needs "
            f"{_span(at_100['printed'])} s with delta_1 as printed, {_span(at_100['a tenth'])} s with a "
            "tenth of it, which the plant uses. Wet: rain multiplies delta_1 by "
            f"{WET:.0f}, an assumption; Figure 7.15 shows only that rain adds cooling at high speed.",
        ),
        Table(
            "Disc: rise [K] in a stop with 30 bar from 220 °C",
            (
                "stop",
                "duration [s]",
                "no cooling, no ramp",
                "conventional (delta_1 = 0)",
                "printed",
                "a tenth",
            ),
            heating,
            "SIM friction. Figure 3.8 compares the conventional with the corrected model and says that the "
            "correction matters for stops from high speed. Here delta_1 as printed takes "
            f"{_span([100.0 * share for share in less[PRINTED]])} % off the rise, a tenth of it "
            f"{_span([100.0 * share for share in less[1.0]])} %.",
        ),
        Table(
            "Disc: Biot number",
            ("brake", "standing, printed", "standing, a tenth", "30 m/s, printed", "30 m/s, a tenth"),
            biot,
            "h r_out / k with 0.45 m² of cooled surface (both faces and vanes) and 50 W/(m K), both assumed. "
            "The thesis calculates 0.08 and wants less than 0.1.",
        ),
    ]
