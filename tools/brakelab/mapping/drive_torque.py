"""The powertrain's torque at the wheels as motor torque of the driven ones.

A car that has one shows what engine drag and down-shifts do while it brakes; without it they are taken for
friction. The driven axle is the one whose wheels turn faster the more torque there is; positive motor torque
brakes, a powertrain's drives.
"""

from typing import Final

import numpy as np

from brakelab.logs.physics.line import BRAKING, MOVING, Fit, fit, smooth
from brakelab.mapping.motion import Found, Motion
from brakelab.mapping.names import converts, words
from brakelab.mapping.series import Series
from ecu.bus.units import CONVERSIONS, spelled
from ecu.contract.signals import CORNERS

FOLLOWS: Final = 0.7  # correlation with dv/dt while no brake acts, from which a torque is that of the drive
WHEEL: Final = {"whl", "wheel", "wheels", "axle"}
BRAKES: Final = {"brk", "brake", "brakes", "rgen", "regen"}
ASKED: Final = {"rq", "req", "request", "mx", "mn", "max", "min", "lim", "limit"}
SLIPS: Final = (
    0.4  # correlation of the axles' difference with the torque, from which it shows the driven axle
)
LEAST_SIGMA: Final = 0.5  # m/s^2, standard deviation of dv/dt
PER_TORQUE: Final = (250.0, 2000.0)  # N m per m/s^2: mass times radius of a car or van


def drive_torque(series: list[Series], motion: Motion) -> tuple[Series, Fit] | None:
    """Return the torque at the wheels [N m] that the car's acceleration follows best; None: there is none."""
    rows = motion.faster(MOVING) & (motion.change > -BRAKING)
    if not motion.drives or rows.sum() < 2 or motion.change[rows].std() < LEAST_SIGMA:
        return None
    found = []
    for one in series:
        parts = set(words(one.signal))
        if one.flag or not converts(one.unit, "N m") or not parts & WHEEL or parts & (BRAKES | ASKED):
            continue
        line = fit(motion.smoothed(one), motion.change, rows & motion.near(one))
        scaled = line.slope * CONVERSIONS["N m"][spelled(one.unit)][0]
        if line.correlation > FOLLOWS and PER_TORQUE[0] < scaled < PER_TORQUE[1]:
            found.append((line.correlation, one, line))
    return max(found, key=lambda candidate: candidate[0])[1:] if found else None


def driven_wheels(torque: Series, wheels: dict[str, Series], motion: Motion) -> tuple[tuple[float, ...], str]:
    """Return the share of each wheel in the torque, in the order of CORNERS, and the evidence for it."""
    drive = motion.smoothed(torque)
    fl, fr, rl, rr = (smooth(np.abs(motion.values(wheels[corner]))) for corner in CORNERS)
    rows = motion.faster(MOVING)
    ahead = (rl + rr - fl - fr)[rows] / np.maximum(fl + fr, 1e-6)[rows]
    if rows.sum() < 2 or ahead.std() == 0.0 or drive[rows].std() == 0.0:
        return (0.25,) * 4, "all wheels, assumed"
    correlation = float(np.corrcoef(ahead, drive[rows])[0, 1])
    if correlation > SLIPS:
        return (0.0, 0.0, 0.5, 0.5), f"rear wheels slip with it (correlation {correlation:.2f})"
    if correlation < -SLIPS:
        return (0.5, 0.5, 0.0, 0.0), f"front wheels slip with it (correlation {-correlation:.2f})"
    return (0.25,) * 4, "all wheels: neither axle slips more with it"


def motors(series: list[Series], wheels: dict[str, Series], motion: Motion) -> list[Found]:
    """Return the four motor torques that the torque at the wheels gives; none without one."""
    torque = drive_torque(series, motion)
    if torque is None:
        return []
    one, line = torque
    shares, by = driven_wheels(one, wheels, motion)
    scale = CONVERSIONS["N m"][spelled(one.unit)][0]
    evidence = (
        f"torque of the drive, correlation {line.correlation:.2f} with dv/dt, "
        f"{scale * line.slope:.0f} N m per m/s^2 (mass times radius); {by}; positive brakes"
    )
    return [
        Found(f"motor_torque_{corner}", one, -scale * share if share else 0.0, 0.0, "N m", evidence, True)
        for corner, share in zip(CORNERS, shares, strict=True)
    ]
