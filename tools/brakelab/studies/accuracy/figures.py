"""`brake-ecu bench figures`: what chapters 1, 3, 4, 5 and 6 draw over time, with one drawn car."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector
from brakelab.plant.description import load_plant, nominal, read_file
from brakelab.plant.linings import Linings
from brakelab.results.chart import BLUE, GREEN, GREY, ORANGE, PINK, Line, Panel, write_chart
from brakelab.results.processes import run_each
from brakelab.results.text_table import Table
from brakelab.simulation.accuracy import AXLES, LOWEST_SPEED, achieved_decel, columns, nrmse, window
from brakelab.simulation.closed_loop import Drive, FrictionOverride, new_loop, run
from brakelab.simulation.configured import configured, shipped
from brakelab.simulation.scenario import Scenario
from brakelab.studies.physics import tyre
from brakelab.studies.physics.heat import heat_panels
from brakelab.studies.study import Asked, Measured, Study
from ecu.contract.signals import CORNERS
from ecu.settings.resources import resource

CAR: Final = 0
LEGEND: Final = [("true", GREY), ("estimate, front", BLUE), ("estimate, rear", ORANGE)]
DISC: Final = [("delta_1 = 0", GREY), ("as the plant has it", BLUE), ("as printed", ORANGE)]
COLOURS: Final = dict(zip(AXLES, (BLUE, ORANGE), strict=True))
SHARES: Final = {0: GREY, 20: GREEN, 40: BLUE, 60: ORANGE, 80: PINK}
ERRORS: Final = tuple(round(0.1 * step, 1) for step in range(-3, 4))
"""Of the friction in use, relative to the true one."""
BEFORE: Final = 1.0  # s shown before the brake application
PAUSE: Final = 1000  # cycles between brake applications that are not drawn together
BRAKED: Final = 0.5  # m/s^2: errors are counted from here
PEDAL: Final = 40.0  # %, of the fifth run of section 6.2.1


class Shown(NamedTuple):
    """A drive and what is drawn of it."""

    figure: str
    scenario: str
    stems: tuple[str, ...]
    pedal: float | None = None
    """Of every brake application [%], in place of the scenario's."""


QUANTITIES: Final = {
    "mu_b": "friction [–]",
    "wheel_force_x": "longitudinal force [kN]",
    "wheel_force_z": "vertical force [kN]",
    "brake_torque": "brake torque [kN m]",
}
PICTURES: Final = {
    "stops": (
        Shown("4.8", "stop-1", ("mu_b", "wheel_force_x")),
        Shown("4.9", "stop-2", ("mu_b", "wheel_force_x")),
        Shown("4.10", "stop-4", ("mu_b", "wheel_force_x")),
    ),
    "loads": (Shown("4.6", "lane-change", ("wheel_force_z",)),),
    "blending": (
        Shown("5.4", "blending-60", ("brake_torque", "mu_b")),
        Shown("5.5", "low-grip", ("brake_torque", "mu_b")),
    ),
    "pedal": (
        Shown("6.1", "fixed-pedal", ("mu_b", "wheel_force_x")),
        Shown("6.2", "repeated", ("mu_b", "wheel_force_x"), PEDAL),
    ),
}


def _scenario(name: str, pedal: float | None = None) -> Scenario:
    found = shipped(name)
    if pedal is None:
        return found
    phases = [one if one.pedal is None else one.model_copy(update={"pedal": pedal}) for one in found.phase]
    return found.model_copy(update={"phase": phases})


def _driven(shown: Shown) -> tuple[Drive, Vector]:
    """Return a drive, and its deceleration by the torques [m/s^2]."""
    loop = new_loop(_scenario(shown.scenario, shown.pedal), configured(), CAR)
    drive = run(loop)
    return drive, achieved_decel(loop, drive)


def _rows(drive: Drive) -> NDArray[np.bool_]:
    """Return the rows drawn: of the last brake applications that follow each other, or all without one."""
    truth = drive.truth
    braked = np.flatnonzero((truth["decel_demand"] > 0.0) | (truth["pedal_position"] > 0.0))
    if len(braked) == 0:
        return np.ones(len(drive.t), np.bool_)
    pauses = np.flatnonzero(np.diff(braked) > PAUSE)
    begin = braked[pauses[-1] + 1] if len(pauses) else braked[0]
    return np.asarray((drive.t >= drive.t[begin] - BEFORE) & (drive.t <= drive.t[braked[-1]]))


def panels(shown: Shown, drive: Drive, decel: Vector) -> list[Panel]:
    """Return deceleration and speed of a drive, and its quantities, true and estimated."""
    rows = _rows(drive)
    t = drive.t[rows] - drive.t[rows][0]
    speed = drive.truth["vehicle_speed"][rows]
    title = f"{shown.figure}: deceleration [m/s²]; speed / 10 m/s (dashed)"
    found = [_panel(title, t, [Line(t, decel[rows], GREY), Line(t, 0.1 * speed, GREY, True)])]
    for stem in shown.stems:
        kilo = 1.0 if stem == "mu_b" else 1e-3
        for group in CORNERS if stem == "wheel_force_z" else AXLES:
            of = (group,) if group in CORNERS else AXLES[group]
            true, estimate = (
                kilo * np.mean([table[f"{stem}_{corner}"][rows] for corner in of], axis=0)
                for table in (drive.truth, drive.outputs)
            )
            colour = COLOURS["front" if of[0].startswith("f") else "rear"]
            lines = [Line(t, true, GREY), Line(t, estimate, colour)]
            found.append(_panel(f"{shown.figure}: {QUANTITIES[stem]}, {group}", t, lines))
    return found


def _panel(title: str, t: Vector, lines: Sequence[Line]) -> Panel:
    values = np.concatenate([line.y[np.isfinite(line.y)] for line in lines])
    edge = 0.05 * max(float(np.ptp(values)), 0.02)
    low, high = float(values.min()) - edge, float(values.max()) + edge
    return Panel(title, "t [s]", (float(t[0]), float(t[-1])), (low, high), lines)


def blended(drives: dict[int, Drive]) -> list[Panel]:
    """Return Figure 5.6: friction of both axles by the share of the motors, estimates over the true ones."""
    found = []
    for axle in AXLES:
        lines = []
        for share, drive in drives.items():
            rows = _rows(drive)
            t = drive.t[rows] - drive.t[rows][0]
            ratio = columns(drive.outputs, "mu_b", axle, rows) / columns(drive.truth, "mu_b", axle, rows)
            lines.append(Line(t, ratio.mean(axis=0), SHARES[share]))
        end = max(float(line.x[-1]) for line in lines)
        names = [(f"f = 0.{share // 10}", SHARES[share]) for share in drives]
        title = f"5.6: friction, estimate over true, {axle}"
        found.append(Panel(title, "t [s]", (0.0, end), (0.5, 1.5), lines, names=names))
    return found


def error_of(wrong: float) -> float:
    """Return the mean error of the deceleration [%] in stop #1 where the friction in use is `wrong`."""
    loop = new_loop(_scenario("stop-1"), configured(), CAR)
    drive = run(loop, override=FrictionOverride(1.0 + wrong))
    rows = window(drive)
    return float(100.0 * np.mean(achieved_decel(loop, drive)[rows] / drive.truth["decel_demand"][rows] - 1.0))


def _error_row(shown: Shown, drive: Drive, decel: Vector) -> tuple[str, ...]:
    rows = _rows(drive)
    if "wheel_force_z" not in shown.stems:
        rows &= (decel > BRAKED) & (drive.truth["vehicle_speed"] > LOWEST_SPEED)
    cells = []
    for stem in QUANTITIES:
        for axle in AXLES:
            true, estimate = (columns(table, stem, axle, rows) for table in (drive.truth, drive.outputs))
            known = np.isfinite(estimate)
            cells.append(f"{abs(nrmse(estimate[known], true[known])):.1f}" if stem in shown.stems else "–")
    return (shown.figure, shown.scenario, *cells)


TEXT: Final = (
    "What the thesis draws over time in chapters 1, 3, 4, 5 and 6, with drawn car 0 of config/plant/suv.toml "
    "(wide) and the ECU of config/suv.toml, which has learned nothing before. Accuracy over many cars: "
    "[observers.md](observers.md), [compensation.md](compensation.md).\n\n"
    "![Figures 4.8 to 4.10](images/figures-stops.svg)\n\n![Figure 4.6](images/figures-loads.svg)\n\n"
    "![Figures 5.4 to 5.6](images/figures-blending.svg)\n\n"
    "![Figures 6.1 and 6.2](images/figures-pedal.svg)\n\n![Figure 1.5](images/figures-error.svg)\n\n"
    "![Figures 3.6b, 3.7 and 3.8](images/figures-disc.svg)\n\n"
    "![Figures 4.7, A.5, A.6 and A.10b](images/figures-tyre.svg)\n\n"
    "The mean of an axle is drawn, in 4.6 each wheel. Figure 1.5: the controller uses a friction that is "
    "wrong by so much in stop #1; dashed: 1 / (1 + error). Figures of the tyre: the undrawn car, front left, "
    "on a dry road; dashed in 4.7: in proportion to the load (4.35)."
)


def _run(asked: Asked) -> Measured:
    every = [shown for group in PICTURES.values() for shown in group]
    drives = dict(zip(every, run_each("figures", _driven, every), strict=True))
    shares = run_each("shares", _driven, [Shown("5.6", f"blending-{share}", ()) for share in SHARES])
    off = run_each("errors", error_of, ERRORS)
    linings = read_file(resource("config/plant/linings.toml"), Linings)

    def draw(folder: Path) -> None:
        for name, group in PICTURES.items():
            found = [panel for shown in group for panel in panels(shown, *drives[shown])]
            if name == "blending":
                found += blended({share: drive for share, (drive, _) in zip(SHARES, shares, strict=True)})
            write_chart(folder / f"figures-{name}.svg", found, LEGEND, 3 if name == "loads" else 5)
        write_chart(folder / "figures-disc.svg", heat_panels(linings), DISC, 5)
        car = nominal(load_plant(resource("config/plant/suv.toml")))
        write_chart(folder / "figures-tyre.svg", tyre.tyre_panels(car), tyre.LEGEND, 5)
        x = 100.0 * np.array(ERRORS)
        lines = [Line(x, np.array(off), BLUE), Line(x, 100.0 / (1.0 + np.array(ERRORS)) - 100.0, GREY, True)]
        title = "1.5: error of the deceleration [%]"
        only = [Panel(title, "error of the friction in use [%]", (x[0], x[-1]), (-30.0, 50.0), lines)]
        write_chart(folder / "figures-error.svg", only, [("stop #1", BLUE)], 1)

    axles = [f"{name.partition(' [')[0]}, {axle}" for name in QUANTITIES.values() for axle in AXLES]
    rows = [_error_row(shown, *drive) for shown, drive in drives.items()]
    table = Table(
        "nRMSE of what is drawn [%]", ("figure", "scenario", *axles), rows, "Both wheels of an axle."
    )
    wrong = [(f"{100 * by:+.0f}", f"{value:+.1f}") for by, value in zip(ERRORS, off, strict=True)]
    names = ("error of the friction in use [%]", "error of the deceleration [%]")
    return Measured([table, Table("Figure 1.5", names, wrong, "Stop #1, 4 m/s².")], draw=draw)


STUDY: Final = Study("Figures over time", TEXT, _run)
