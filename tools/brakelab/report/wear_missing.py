"""Gaps of a result on wear and dust with their reasons: one sentence each, instead of an empty plot."""

from typing import NamedTuple

import numpy as np

from brakelab.report.drive import DriveResult
from brakelab.report.quality import Quality
from brakelab.report.wear_applications import Application
from brakelab.results.pads import PadState
from ecu.algorithm.monitoring.dust import UNKNOWN_WORK
from ecu.contract.signals import CORNERS
from ecu.pads import LEAST_DISTANCE


class Missing(NamedTuple):
    """A quantity and why it is not available."""

    quantity: str
    reason: str


def missing(
    drive: DriveResult,
    quality: Quality | None,
    without_pressure: bool,
    pads: list[PadState],
    applications: list[Application],
) -> list[Missing]:
    """Return the gaps of this drive; the first alone where it holds for everything."""
    columns = [f"pad_wear_{corner}" for corner in CORNERS]
    if not drive.has("vehicle_speed"):
        return [
            Missing("Wear and dust", "no wheel speed came in this drive: neither distance nor work is known.")
        ]
    if not any(name in drive.columns for name in columns):
        return [Missing("Wear and dust", "not in this result: write it again with brake-ecu replay.")]
    lost = [corner for corner in CORNERS if not drive.has(f"pad_wear_{corner}")]
    if without_pressure or len(lost) == len(CORNERS):
        return [Missing("Wear and dust", "no calliper pressure came in this drive: no work is known.")]
    found = []
    if lost:
        found.append(Missing(f"Wear of {', '.join(lost)}", "their calliper pressure is not in this log."))
    own = [pad for pad in pads if pad.corner not in lost]
    found += [*_of_pads(own), *_of_inputs(drive, quality)]
    if not applications and drive.has("braking") and (drive.column("braking") == 1.0).any():
        reason = "RESULT.brakes.parquet is not beside the result: keep the two together."
        found.append(Missing("Work, mass and particles of single brake applications", reason))
    elif own:
        found += _of_particles(own, applications)
    return found


def _of_pads(pads: list[PadState]) -> list[Missing]:
    if not pads:
        reason = "the result does not state the pads: write it again with brake-ecu replay --state."
        return [Missing("Thickness and remaining distance", reason)]
    found = []
    if names := [pad.corner for pad in pads if not pad.told and not pad.measurements]:
        reason = (
            "nobody said what is fitted, so half a life is counted from, give or take half: "
            "brake-ecu wear --new-pads or --measured says it."
        )
        found.append(Missing(f"Thickness of {', '.join(names)} to better than their life", reason))
    if not any(np.isfinite(pad.remaining) for pad in pads):
        driven = max(pad.driven for pad in pads)
        if driven < 1e-3 * LEAST_DISTANCE:
            reason = (
                f"these pads were driven {driven:.1f} km and {1e-3 * LEAST_DISTANCE:.0f} km are needed: "
                "replay the drives before this one with the same --state."
            )
        else:
            reason = "nothing was worn off yet."
        found.append(Missing("Remaining distance", reason))
    if not all(pad.configured for pad in pads):
        reason = "CONFIG names no [front.pad], [rear.pad]: size and law of the thesis's brake A stand in."
        found.append(Missing("Wear of this car's own linings", reason))
    return found


def _of_inputs(drive: DriveResult, quality: Quality | None) -> list[Missing]:
    found = []
    if not any(drive.has(f"motor_torque_{corner}") for corner in CORNERS):
        reason = (
            "no motor torque is in this log; what motors brake, if there are any, counts as the linings'."
        )
        found.append(Missing("Share of motors in braking", reason))
    if not any(drive.has(f"disc_temperature_{corner}") for corner in CORNERS):
        found.append(Missing("Wear and dust against temperature", "no disc temperature is in this result."))
    if quality is not None:
        came = {name for name, _ in quality.inputs}
        if not any(name.startswith("disc_temperature_measured") for name in came):
            reason = (
                "no measured disc temperature is in this log: wear and dust take the ECU's model, which does "
                "not know how long the car stood before."
            )
            found.append(Missing("Error of the disc temperature", reason))
        if "ambient_temperature" not in came:
            reason = "not in this log: the discs cool to the one of CONFIG."
            found.append(Missing("Ambient temperature", reason))
    return found


def _of_particles(pads: list[PadState], applications: list[Application]) -> list[Missing]:
    without = [pad.corner for pad in pads if not pad.emission_model]
    if without:
        what = "Particles" if len(without) == len(pads) else f"Particles of {', '.join(without)}"
        reason = "CONFIG has no emission model for them: brake-ecu identify dust makes one."
        found = [Missing(what, reason)]
        if len(without) == len(pads):
            return found
    else:
        found = []
    share = counted_share(pads, applications)
    if share < 1.0 - UNKNOWN_WORK:
        reason = (
            f"{100.0 * (1.0 - share):.0f} % of the work was outside what the emission model was trained on."
        )
        found.append(Missing("Particles per km in this drive", reason))
    return found


def counted_share(pads: list[PadState], applications: list[Application]) -> float:
    """Return the share of the work of brakes with an emission model whose particles are counted."""
    wheels = [CORNERS.index(pad.corner) for pad in pads if pad.emission_model]
    work = np.array([np.nansum(each.energies[wheels]) for each in applications])
    counted = np.array([np.isfinite(each.particles) for each in applications], bool)
    return float(work[counted].sum() / work.sum()) if work.sum() > 0.0 else 1.0
