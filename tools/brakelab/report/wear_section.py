"""The report's section on wear and dust: its tables, from the ECU's counts in the drive and for life."""

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from brakelab.report.drive import DriveResult
from brakelab.report.page import fixed
from brakelab.report.quality import Quality
from brakelab.report.wear_applications import Application, dirtiest, read_applications
from brakelab.report.wear_missing import counted_share, missing
from brakelab.report.wear_plots import BAND, plots_of_emission, plots_of_wear
from brakelab.report.wear_roads import KINDS, LEAST_KM, distance, roads
from brakelab.results import euro7
from brakelab.results.pads import KEY, PadState, unpacked
from ecu.algorithm.monitoring.dust import UNKNOWN_WORK
from ecu.contract.signals import CORNERS
from ecu.errors import UserError


class Amount(NamedTuple):
    """A quantity per km, as text: in this drive, since counting began, and the limit."""

    name: str
    drive: str
    life: str
    limit: str
    above: bool
    """The drive is above every limit."""


class Section(NamedTuple):
    """Content of the template."""

    pads: list[PadState]
    thickness: list[str]
    """Of each of `pads`, with its 95 % band."""
    known_by: list[str]
    roads: list[Any]
    kinds: str
    amounts: list[Amount]
    linings: float
    """Share of the brakes in the work of brakes and motors; NaN: not known."""
    dirtiest: list[Application]
    counted: bool
    """The dirtiest are by particles, else by mass."""
    missing: list[Any]


def wear_section(
    drive: DriveResult,
    truth: DriveResult | None,
    result: Path,
    quality: Quality | None,
    without_pressure: bool,
) -> tuple[Section, dict[str, dict[str, Any]]]:
    """Return the section on the drive of `result` and its plots by place.

    Raises:
        UserError: the metadata or the file of brake applications are damaged.
    """
    try:
        pads = unpacked(drive.metadata.get(KEY, ""))
    except (ValueError, TypeError, AttributeError) as error:
        remedy = f"not readable ({error!r}); write the result again with `brake-ecu replay`"
        raise UserError(str(result), f"metadata {KEY}", remedy) from None
    applications = read_applications(drive, result)
    lacks = missing(drive, quality, without_pressure, pads, applications)
    shown = not without_pressure and drive.has("vehicle_speed")
    pads = [pad for pad in pads if shown and drive.has(f"pad_wear_{pad.corner}")]
    worst = dirtiest(applications) if shown else []
    section = Section(
        pads,
        [f"{pad.thickness:.2f} ± {BAND * pad.sigma:.2f}" for pad in pads],
        [_known_by(pad) for pad in pads],
        roads(drive, applications) if shown else [],
        ", ".join(f"{name} to {high:.0f} km/h" for name, high in KINDS[:-1]) + f", {KINDS[-1][0]} above",
        _amounts(drive, pads, applications) if shown else [],
        _share(drive),
        worst,
        any(math.isfinite(each.particles) for each in worst),
        lacks,
    )
    plots = {
        "wear_plots": plots_of_wear(drive, truth, pads) if shown else {},
        "emission_plots": plots_of_emission(applications) if shown else {},
    }
    return section, plots


def _known_by(pad: PadState) -> str:
    if pad.measurements:
        times = "once" if pad.measurements == 1 else f"{pad.measurements} times"
        return f"measured {times}, {pad.scale:.2f} of the law"
    return "fitted as new, by the law" if pad.told else "by the law, from half a life"


def _amounts(drive: DriveResult, pads: list[PadState], applications: list[Application]) -> list[Amount]:
    km = 1e-3 * float(distance(drive)[-1])
    weighed = [each for each in applications if math.isfinite(each.mass)]
    per_km, low, high = (
        sum(getattr(each, name) for each in weighed) / km if weighed and km >= LEAST_KM else math.nan
        for name in ("mass", "mass_low", "mass_high")
    )
    band = f" ({low:.1f} to {high:.1f})" if math.isfinite(low + high) else ""
    found = []
    life = float(drive.column("particle_mass_per_km")[-1])
    if math.isfinite(per_km) or math.isfinite(life):
        found.append(
            Amount(
                "Particles of the linings up to 10 µm [mg/km]",
                fixed(per_km, 1) + band,
                fixed(life, 1),
                euro7.WORDS,
                euro7.above_all(low),
            )
        )
    life = float(drive.column("particles_per_km")[-1])
    counted = [each for each in applications if math.isfinite(each.particles)]
    text = fixed(math.nan, 0)
    if counted and km >= LEAST_KM and counted_share(pads, applications) >= 1.0 - UNKNOWN_WORK:
        low, middle, high = (
            1e-9 * sum(getattr(each, name) for each in counted) / km
            for name in ("particles_low", "particles", "particles_high")
        )
        text = f"{middle:.2f} ({low:.2f} to {high:.2f})"
    if counted or math.isfinite(life):
        found.append(Amount("Particles [10⁹/km]", text, fixed(1e-9 * life, 2), "none yet", False))
    return found


def _share(drive: DriveResult) -> float:
    """Return the share of the brakes in the work of brakes and motors while they brake."""
    if not any(drive.has(f"motor_torque_{corner}") for corner in CORNERS):
        return math.nan
    speed = np.nan_to_num(np.abs(drive.column("vehicle_speed")))
    brakes = np.nan_to_num(drive.corners("brake_torque")).clip(min=0.0).sum(axis=1)
    brakes = float((brakes * speed)[drive.column("braking") == 1.0].sum())
    motors = np.nan_to_num(drive.corners("motor_torque")).sum(axis=1).clip(min=0.0)
    whole = brakes + float((motors * speed).sum())
    return brakes / whole if whole > 0.0 else math.nan
