"""Page of an identification: tables of what was identified and what was not, and how good the fits are."""

from collections.abc import Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np

from brakelab.identify.vehicle.model import Place, motion, seen, stiffness_of
from brakelab.identify.vehicle.parameters import Parameter
from brakelab.identify.vehicle.solve import Identified
from brakelab.results.chart import BLUE, ORANGE, PINK, Line, Panel, ends_of, write_chart
from brakelab.results.text_table import Table, markdown
from ecu.contract.params import GRAVITY

SPEEDS: Final = (3.0, 8.0, 14.0, 20.0, 26.0, 32.0, 45.0)  # m/s, of the table of overrun
FEWEST_WINDOWS: Final = 4  # windows of a speed
SHOWN: Final = (1.0, 99.0)  # percentiles that an axis shows of windows
_ends = partial(ends_of, margin=0.08)


def fitted_table(parameters: Sequence[Parameter]) -> Table:
    """Return the keys that were identified."""
    rows = [
        (one.key, one.unit, f"{one.start:.4g}", f"{one.value:.4g}", f"{one.sigma:.2g}",
         f"{one.windows}", one.source + one.doubt)
        for one in parameters if not one.remedy
    ]  # fmt: skip
    return Table(
        "Identified", ("key", "unit", "START", "value", "±σ", "windows", "note"), rows,
        "Windows of half a second; σ is robust to errors that a manoeuvre has in common.",
    )  # fmt: skip


def left_table(parameters: Sequence[Parameter]) -> Table:
    """Return the keys that were not identified, with the drive that would identify them."""
    rows = [(one.key, f"{one.start:.4g} {one.unit}", one.remedy) for one in parameters if one.remedy]
    return Table(
        "Not identified",
        ("key", "START's value, kept", "note"),
        rows,
        "The note names the drive that would identify it.",
    )


def zeros_table(found: Identified) -> Table:
    """Return the zeros of the sensors."""
    zeros = found.zeros
    named = [("accel_x", "m/s^2", zeros.accel_x), ("accel_y", "m/s^2", zeros.accel_y),
             ("yaw_rate", "rad/s", zeros.yaw_rate)]  # fmt: skip
    named += [(name, "bar", (value, sigma)) for name, value, sigma in zeros.pressure]
    rows = [(name, unit, f"{zero[0]:+.4g}", f"{zero[1]:.2g}") for name, unit, zero in named if zero]
    return Table(
        "Zeros of sensors", ("input", "unit", "reads at 0", "±σ"), rows,
        "CONFIG has no keys for them: the ECU learns them, or the signal map takes them off.",
    )  # fmt: skip


def overrun_table(found: Identified, params: Any) -> Table:
    """Return the force of the drive by speed, accelerator released, beyond drag and rolling resistance."""
    windows, theta = found.windows, found.fit.theta
    moving = motion(theta, seen(windows, 0), params)
    accel = (windows.accel.mean(axis=0) - theta[Place.ZERO]) / (1.0 + GRAVITY * theta[Place.PITCH])
    rest = np.exp(theta[Place.DRAG] - theta[Place.MASS]) * moving.reference**2
    drive = -accel - rest - GRAVITY * theta[Place.ROLLING]
    reported = np.nan_to_num(windows.motor.mean(axis=1)).sum(axis=0)
    pulled = reported < 0.0 if found.signals.torque else accel > 0.0
    rows = []
    for low, high in pairwise(SPEEDS):
        own = windows.free & windows.steady & windows.straight & ~pulled
        own = own & (moving.reference >= low) & (moving.reference < high)
        if own.sum() < FEWEST_WINDOWS:
            continue
        least, mid, most = np.percentile(drive[own], (16, 50, 84))
        torque = f"{np.median(reported[own]):.0f}" if found.signals.torque else "–"
        spread = f"{least:.3f} to {most:.3f}"
        rows.append((f"{low:.0f} to {high:.0f}", f"{mid:.3f}", spread, torque, f"{own.sum()}"))
    return Table(
        "Drag of the drive, accelerator and brake released",
        ("m/s", "m/s^2", "68 %", "reported [N m]", "windows"), rows,
        "Deceleration beyond drag and rolling resistance. The gear is not known, so it is listed by speed.",
    )  # fmt: skip


def panels_of(found: Identified, params: Any) -> list[Panel]:
    """Return coast-down, slip against force, radius against speed and dive."""
    windows, theta = found.windows, found.fit.theta
    moving = motion(theta, seen(windows, 0), params)
    kappa = 1.0 + GRAVITY * theta[Place.PITCH]
    mass = float(np.exp(theta[Place.MASS]))
    accel = (windows.accel.mean(axis=0) - theta[Place.ZERO]) / kappa
    good = windows.steady & windows.straight
    free = good & windows.free
    rolling = theta[Place.ROLLING] * mass * GRAVITY
    other = moving.force.sum(axis=0) + rolling
    resistance = other - mass * accel
    v = np.linspace(0.0, 1.02 * float(np.max(moving.reference[free], initial=1.0)), 60)
    law = rolling + np.exp(theta[Place.DRAG]) * v**2
    coast = Panel(
        "resistance [N]: specific force, less the drive's", "speed [m/s]", (0.0, float(v[-1])),
        _ends(resistance[free], law, shown=SHOWN),
        [Line(moving.reference[free], resistance[free], BLUE, marks=True), Line(v, law, PINK)],
    )  # fmt: skip
    used = good & (windows.free | windows.braking)
    speeds = windows.omega.mean(axis=1).reshape(2, 2, -1).mean(axis=1)
    pair = np.where(used, speeds, np.nan)
    roll = np.exp(theta[[Place.RADIUS_F, Place.RADIUS_R]])
    sink = np.exp(theta[Place.DEFLECTION]) * accel * np.array([[1.0], [-1.0]])
    reference = np.where(used, moving.reference, np.nan)
    slip = 100.0 * (roll[:, None] * (1.0 + sink) * pair / reference - 1.0)
    force = 1e-3 * moving.force
    stiffness = stiffness_of(theta)
    ends = _ends(force[:, used].reshape(-1))
    line = np.linspace(*ends, 60)
    slips = Panel("slip [%] of the axles", "force [kN]", ends, _ends(slip[:, used].reshape(-1)), [
        *(Line(force[k, used], slip[k, used], colour, marks=True) for k, colour in enumerate((BLUE, ORANGE))),
        *(Line(line, 1e5 * line / stiffness[k], colour) for k, colour in enumerate((BLUE, ORANGE))),
    ])  # fmt: skip
    radius = 1e3 * moving.reference / pair * (1.0 + moving.slip)
    radii = Panel("rolling radius [mm], slip taken off", "speed [m/s]", (0.0, float(v[-1])),
                  _ends(radius[:, used].reshape(-1), shown=SHOWN),
                  [Line(moving.reference[used], radius[k, used], colour, marks=True)
                   for k, colour in enumerate((BLUE, ORANGE))])  # fmt: skip
    steps = found.steps
    change = steps.change.mean(axis=0)
    short = steps.straight & (steps.seconds <= 1.0)
    dive = steps.felt.mean(axis=0) - change - theta[Place.ZERO]
    ends = _ends(change[short])
    return [coast, slips, radii, Panel(
        "accelerometer beyond v' [m/s^2]: dive, slopes", "v' [m/s^2]", ends, _ends(dive[short]),
        [Line(change[short], dive[short], BLUE, marks=True),
         Line(np.linspace(*ends, 60), (kappa - 1.0) * np.linspace(*ends, 60), PINK)],
    )]  # fmt: skip


def write_page(
    page: Path,
    found: Identified,
    parameters: Sequence[Parameter],
    params: Any,
    drives: Sequence[str],
    checked: str,
) -> None:
    """Write the page, with the line of the cross-check, and its picture beside it."""
    picture = page.with_suffix(".svg")
    write_chart(picture, panels_of(found, params), [("front, or all", BLUE), ("rear", ORANGE), ("fit", PINK)])
    tables = [
        fitted_table(parameters),
        left_table(parameters),
        zeros_table(found),
        overrun_table(found, params),
    ]
    parts = [markdown(table) for table in tables if table.rows]
    head = f"# The car of {', '.join(drives)}\n\n![Fits]({picture.name})\n\n"
    head += f"{checked}.\n\n"
    page.write_text(head + "\n".join(parts).rstrip() + "\n", encoding="utf-8")
