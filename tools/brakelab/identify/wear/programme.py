"""Programme of a dynamometer for blocks of road applications: files for the rig, table of its controller.

A block is a file as in `config/rig`, of sections; `lab run` runs it. The controller of Figure 7.5 needs for
each stop: speed, torque, and the disc's temperature at which it begins, not below `CHECK_OFF`. The flywheel
stands for the mass that slows as much as this brake did on the road,

    m = sum E_b / sum (v_in^2 - v_end^2) / 2

so that a block costs what it cost on the road (7.20), though nothing else resists on the rig (7.21).
"""

import csv
import io
from typing import Final, NamedTuple

import numpy as np

from brakelab.identify.friction.sequence import Sequence
from brakelab.identify.wear.applications import KMH, Applications, RoadBlock, Step
from brakelab.results.chart import BLUE, GREY, Line, Panel
from brakelab.results.text_table import Table

CHECK_OFF: Final = 65.0  # degC, section 7.3.2
LOWEST_END: Final = 2.0  # km/h, where a stop to rest ends
WARM_SPEED, WARM_PRESSURE, COOL_SPEED = 80.0, 20.0, 80.0
"""km/h, bar and km/h of the gate, as in the shipped programmes."""
CONTROLLER: Final = ("stop", "speed_km_h", "end_speed_km_h", "deceleration_m_s2", "brake_torque_N_m",
                     "pressure_bar", "disc_temperature_degC")  # fmt: skip
LEGEND: Final = (("on the road", GREY), ("on the rig", BLUE))
TOP: Final = 1.08  # of an axis, over the greatest value


class Brake(NamedTuple):
    """What turns a deceleration into a pressure."""

    radius: float  # m, of the tyre
    lever: float  # m^3, 2 A_k r_eff
    push_out: float  # Pa


class Stop(NamedTuple):
    """An application as asked of the rig."""

    speed: float  # m/s
    end_speed: float  # m/s
    decel: float  # m/s^2
    heat: float  # degC


def mass_of(road: Applications) -> float:
    """Return the mass that slows as much as the brake did [kg]."""
    return float(road.energy.sum() / road.kinetic.sum())


def _asked(step: Step) -> tuple[float, float, float, float]:
    """Return speed and end speed [km/h], deceleration [m/s^2], temperature [degC] as they are written."""
    end = max(step.speed_end / KMH, LOWEST_END)
    return (
        round(step.speed_in / KMH, 1),
        round(end, 1),
        round(step.decel, 3),
        round(max(step.heat, CHECK_OFF)),
    )


def programme_text(block: RoadBlock, mass: float) -> str:
    """Return the programme of a block as TOML."""
    lines = [
        f"# {block.applications} applications that stand for {len(block.road.energy)} on the road.",
        f'title = "{block.name}"',
        f"mass = {mass:.1f}  # kg that the flywheel stands for",
        "",
        "[gate]  # drags that warm the disc wear the pads too: record them with the block",
        f"warm_speed = {WARM_SPEED}  # km/h",
        f"warm_pressure = {WARM_PRESSURE}  # bar",
        f"cool_speed = {COOL_SPEED}  # km/h",
    ]
    for number, step in enumerate(block.steps, 1):
        speed, end, decel, heat = _asked(step)
        lines += [
            "",
            "[[section]]",
            f'name = "{number}"',
            'control = "deceleration"',
            f"speed = {speed}  # km/h",
            f"end_speed = {end}  # km/h",
            f"level = [{decel}]  # m/s^2",
            f"temperature = [{heat}.0]  # degC",
            f"times = {step.times}",
        ]
    return "\n".join([*lines, ""])


def stops_of(programme: Sequence) -> list[Stop]:
    """Return the applications that a programme asks for by their deceleration, in order."""
    return [
        Stop(KMH * section.speed, KMH * section.end_speed, level, heat)
        for section in programme.section
        for level, heat in section.each()
    ]


def controller_text(block: RoadBlock, mass: float, brake: Brake) -> str:
    """Return the set points of the controller of Figure 7.5 as CSV, a row a stop."""
    friction = float(np.nanmean(block.road.friction)) if np.isfinite(block.road.friction).any() else np.nan
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(CONTROLLER)
    stop = 0
    for step in block.steps:
        speed, end, decel, heat = _asked(step)
        torque = mass * decel * brake.radius
        pressure = 1e-5 * (torque / (brake.lever * friction) + brake.push_out)
        shown = f"{pressure:.1f}" if np.isfinite(pressure) else ""
        for _ in range(step.times):
            stop += 1
            rows.writerow([stop, speed, end, decel, f"{torque:.0f}", shown, heat])
    return text.getvalue()


def road_energy(block: RoadBlock) -> float:
    """Return what as many applications as the block has cost the brake on the road [MJ]."""
    return 1e-6 * float(block.road.energy.mean()) * block.applications


def block_table(blocks: list[RoadBlock], mass: float, left_out: int) -> Table:
    """Return the blocks, on the road and on the rig."""
    rows = []
    for block in blocks:
        asked = np.repeat([_asked(step) for step in block.steps], [step.times for step in block.steps], 0)
        road, energy = block.road, road_energy(block)
        kinetic = 0.5e-6 * mass * KMH**2 * float((asked[:, 0] ** 2 - asked[:, 1] ** 2).sum())
        heat = float(np.average(road.heat, weights=road.energy))
        cold = 100.0 * float(np.mean(road.heat < CHECK_OFF))
        rows.append(
            (
                block.name,
                f"{len(road.energy)} / {block.applications}",
                f"{len(block.steps)}",
                f"{road.speed_in.mean() / KMH:.0f} / {asked[:, 0].mean():.0f}",
                f"{road.decel.mean():.2f} / {asked[:, 2].mean():.2f}",
                f"{heat:.0f} / {np.average(asked[:, 3], weights=asked[:, 0] ** 2 - asked[:, 1] ** 2):.0f}",
                f"{energy:.2f} / {kinetic:.2f}",
                f"{100.0 * (1.0 - energy / kinetic):+.1f}",
                f"{cold:.0f}",
            )
        )
    silent = f" {left_out} applications say too little (no temperature, energy or speed) and are left out."
    return Table(
        "Blocks, on the road / on the rig",
        ("block", "applications", "steps", "speed before [km/h]", "deceleration [m/s²]", "disc before [degC]",
         "energy [MJ]", "ΔE_b [%]", f"road below {CHECK_OFF:.0f} degC [%]"),
        rows,
        f"Energy of as many applications; ΔE_b: (7.21) minus (7.20) over (7.21). The flywheel stands for "
        f"{mass:.0f} kg: what this brake slowed on the road. Temperature: by energy; the rig waits for it, "
        f"but not below {CHECK_OFF:.0f} degC (7.3.2).{silent if left_out else ''}",
    )  # fmt: skip


def block_panels(blocks: list[RoadBlock]) -> list[Panel]:
    """Return each block's applications, and the steps that stand for them."""
    panels = []
    for block in blocks:
        asked = np.array([_asked(step) for step in block.steps])
        road = block.road
        speeds = (0.0, TOP * float(max(road.speed_in.max() / KMH, asked[:, 0].max())))
        for title, values, place in (("deceleration [m/s²]", road.decel, 2), ("disc [degC]", road.heat, 3)):
            ends = (0.0, TOP * float(max(values.max(), asked[:, place].max())))
            lines = [
                Line(road.speed_in / KMH, values, GREY, marks=True),
                Line(asked[:, 0], asked[:, place], BLUE, marks=True),
            ]
            panels.append(Panel(f"{block.name}: {title}", "speed before [km/h]", speeds, ends, lines))
    return panels
