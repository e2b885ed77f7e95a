"""`brake-ecu config check`: every mistake of a CONFIG file, or the figures of its car.

The figures are for reading: torque per pressure, pressures of a braking, the distribution beside the ideal
one, how hard the whole pedal brakes, how much of it a road holds, how far the car is from what ECE R13-H
forbids. Swapped numbers that are possible show there.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np

from ecu.algorithm.control.distribution import front_share
from ecu.algorithm.estimation.joint.whole_filter import CEILING, FALL, GRIP
from ecu.contract.params import BAR, GRAVITY
from ecu.contract.records import RecordArray
from ecu.output import fault, give
from ecu.settings.annex3 import LEAST_DECEL, full_braking
from ecu.settings.annex5 import DEMANDED, K_RULED, Z_ORDERED, Load, shares, utilisation
from ecu.settings.annex5_picture import picture
from ecu.settings.config import Config, new_params, torque_per_bar, validate_config, violations

RATES: Final = (0.2, 0.4, 0.6, 0.8)  # braking rates z
ROADS: Final = (0.2, 0.4, 0.6, 0.8)
"""Adhesion from snow to a dry road."""

Kept = Callable[[Config, RecordArray], tuple[int, RecordArray] | None]
"""Revision and `LEARNED` that a store holds of a car and its `PARAMS`."""


def check(path: Path, pictured: bool = False, kept: Kept | None = None) -> int:
    """Print each mistake of a CONFIG file in a line and return 2; or the figures of its car, and 0.

    `pictured` adds the distribution beside what Annex 5 forbids, `kept` the ceiling of grip that was learned.

    Raises UserError for a file that is no TOML.
    """
    config = validate_config(path)
    if not isinstance(config, Config):
        for finding in config:
            fault(f"brake-ecu: {finding}")
        give(config=path, mistakes=[str(finding) for finding in config])
        return 2
    record = new_params(config)
    params = record[0]
    found = violations(path, config, params)
    for line in figures(config, params):
        print(line)
    if kept:
        print(learned_grip(params, kept(config, record)))
    give(config=path, mistakes=[str(one) for one in found], figures=figures_of(config, params))
    if pictured:
        print("\n".join(picture(params, config.vehicle.loads())))
    for finding in found:
        fault(f"brake-ecu: {finding}")
    if found:
        return 2
    print(f"{path}: nothing wrong")
    return 0


def figures_of(config: Config, params: Any) -> dict[str, Any]:
    """Return the figures of the car by name: torque per pressure [N m/bar], pressures [bar]."""
    front, rear = axle_torque_per_bar(params)
    return {
        "car": config.name,
        "mass_kg": float(params["mass"]),
        "torque_per_bar_front": front,
        "torque_per_bar_rear": rear,
        "braking": [_braking(params, z) for z in RATES],
    }


def _braking(params: Any, z: float) -> dict[str, float]:
    front, rear = pressures(params, z)
    share = float(front_share(params, z * GRAVITY))
    return {"rate": z, "front_share": share, "pressure_front": front, "pressure_rear": rear}


def figures(config: Config, params: Any) -> list[str]:
    """Return the figures of the car, as lines; `params` is one `PARAMS` of `config`."""
    front_load = params["rear_axle"] / params["wheelbase"]
    found = figures_of(config, params)
    lines = [
        f"car           {config.name}: {params['mass']:.0f} kg, {100 * front_load:.0f} % on the front axle, "
        f"rolling radius {params['wheel_radius'][0]:.3f} and {params['wheel_radius'][2]:.3f} m",
        f"brakes        front {found['torque_per_bar_front']:.1f}, rear {found['torque_per_bar_rear']:.1f} "
        "N m per bar and axle, nominal friction",
    ]
    for braking in found["braking"]:
        z, share = braking["rate"], braking["front_share"]
        ideal = front_load + z * float(params["cog_height"] / params["wheelbase"])
        lines.append(
            f"z = {z:.1f}       front share {100 * share:4.1f} %, ideal {100 * ideal:4.1f} %; "
            f"{braking['pressure_front']:5.1f} bar in front, {braking['pressure_rear']:5.1f} bar in the rear"
        )
    loads = config.vehicle.loads()
    lines.append(
        f"Annex 3       {loads[-1].name}: at the end of the pedal, {params['pedal_decel'][-1]:.2f} m/s^2, "
        f"the linings alone brake by {full_braking(params, loads[-1]):.2f} m/s^2 ({LEAST_DECEL} in 2.1.1)"
    )
    lines += [grip(params, load) for load in loads]
    return lines + [line for load in loads for line in margins(params, load)]


def held_demand(params: Any, load: Load, road: float) -> float:
    """Return the demand [m/s^2] at which the first axle uses all of a road's adhesion, nominal friction."""
    curve = utilisation(params, shares(params), load)
    return float(np.interp(road, np.maximum(curve.front, curve.rear), DEMANDED)) * GRAVITY


def grip(params: Any, load: Load) -> str:
    """Return what the brakes can be asked for on `ROADS`, and the adhesion that the whole pedal takes."""
    held = [held_demand(params, load, road) for road in ROADS]
    pedal = [float(np.interp(one, params["pedal_decel"], params["pedal_position"])) for one in held]
    most = float(params["pedal_decel"][-1])
    curve = utilisation(params, shares(params), load)
    needs = float(np.interp(most / GRAVITY, DEMANDED, np.maximum(curve.front, curve.rear)))
    roads, demands, travels = (
        ", ".join(format(one, form) for one in row)
        for row, form in ((ROADS, ".1f"), (held, ".1f"), (pedal, ".0f"))
    )
    return (
        f"grip          {load.name}: roads of {roads} hold a demand of {demands} m/s^2, {travels} % of the "
        f"pedal; all of it, {most:.1f} m/s^2, needs {needs:.2f}"
    )


def learned_grip(params: Any, found: tuple[int, RecordArray] | None) -> str:
    """Return how much of the pedal the ceiling of grip holds that whole applications have taught."""
    place = GRIP * (GRIP + 3) // 2  # of its variance, lower triangle by rows
    variance = float(found[1]["whole_covariance"][0, place]) if found else 0.0
    if found is None or variance == 0.0:
        return "grip          no ceiling learned: only a car that others brake keeps one"
    learned = found[1]["whole"][0]
    ceiling = CEILING * float(np.exp(learned[GRIP]) * (1.0 - learned[FALL]))
    most = float(params["pedal_decel"][-1])
    travel = float(np.interp(ceiling, params["pedal_decel"], params["pedal_position"]))
    return (
        f"grip          learned: the linings brake by at most {ceiling:.1f} +- {ceiling * variance**0.5:.1f} "
        f"m/s^2, {travel:.0f} % of the pedal; all of it asks for {most:.1f}"
    )


def axle_torque_per_bar(params: Any) -> tuple[float, float]:
    """Return the torque of the front and the rear axle at nominal friction [N m/bar], 4 A_k r_eff mu."""
    both = 2.0 * torque_per_bar(params)
    return float(both[0]), float(both[2])


def pressures(params: Any, z: float) -> tuple[float, float]:
    """Return the pressures of both axles [bar] that brake the car at the rate z by its linings alone."""
    share = float(front_share(params, z * GRAVITY))
    force = z * GRAVITY * float(params["mass"])
    found = [
        part * force * params["wheel_radius"][i] / per_bar + params["push_out_pressure"][i] / BAR
        for part, per_bar, i in zip((share, 1.0 - share), axle_torque_per_bar(params), (0, 2), strict=True)
    ]
    return float(found[0]), float(found[1])


def margins(params: Any, load: Load) -> list[str]:
    """Return how far the distribution is from what Annex 5, 3.1 forbids, at nominal friction."""
    curve = utilisation(params, shares(params), load)
    ordered = (curve.z >= Z_ORDERED[0]) & (curve.z <= Z_ORDERED[1])
    ahead = np.where(ordered, curve.front - curve.rear, np.inf)
    k = np.maximum(curve.front, curve.rear)
    ruled = (k >= K_RULED[0]) & (k <= K_RULED[1])
    spare = np.where(ruled, curve.z - 0.1 - 0.7 * (k - 0.2), np.inf)
    a, b = int(np.argmin(ahead)), int(np.argmin(spare))
    least_ahead, least_spare = (round(float(least), 3) + 0.0 for least in (ahead[a], spare[b]))
    return [
        f"Annex 5       {load.name}: adhesion used in front less rear {least_ahead:.3f} at least (3.1 A, "
        f"z = {curve.z[a]:.2f}); braking rate less what is asked {least_spare:.3f} (3.1 B, k = {k[b]:.2f})"
    ]
