"""What pads and disc of a block lost, by its row of the manifest: masses and thicknesses, checked.

Pads of both sides together (`mass_before`, `thickness_before_1…6`) or apart (`inboard_…`, `outboard_…`). Of
the six points of a pad 1 and 2 are at the leading end, 5 and 6 at the trailing one; odd ones at the outer
radius. Taper is what the leading end lost more than the trailing one, and the outer radius more than the
inner.
"""

import math
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from brakelab.arrays import Array
from brakelab.identify.wear.fusion import BALANCE, SURE
from ecu.errors import UserError
from ecu.settings.pad import Pad

POINTS: Final = 6
FEWEST_POINTS: Final = 4  # of a pad
UNEVEN: Final = 0.3  # mm by which a point may lose more or less than the others, beside what all lose
SIDES: Final = ("inboard", "outboard")
THINNEST_DISC, THICKEST_DISC = 3.0, 60.0  # mm
LIGHTEST_DISC, HEAVIEST_DISC = 1e3, 40e3  # g


class Lost(NamedTuple):
    """Lost in a block; NaN: not measured."""

    weighed: tuple[float, float]
    """Both pads before and after by the balance, g."""
    wear: float
    """Of a pad by thickness, mean of both, mm."""
    sides: tuple[float, float]
    """Inboard and outboard by the balance, g."""
    thin: tuple[float, float]
    """Likewise by thickness, mm."""
    along: float
    """Taper from the leading to the trailing end, mean of the pads, mm."""
    across: float
    """Taper from the outer to the inner radius, mm."""
    disc_mass: float
    """g"""
    disc_wear: float
    """Of its thickness, both faces, mm."""

    @property
    def mass(self) -> float:
        """Return what both pads lost by the balance [g]."""
        return self.weighed[0] - self.weighed[1]


class _Row(NamedTuple):
    """A row of the manifest and where it stands."""

    manifest: Path
    where: str
    cells: dict[str, str]

    def number(self, name: str) -> float:
        try:
            value = float(self.cells[name])
        except (KeyError, TypeError, ValueError):
            value = math.nan
        if not math.isfinite(value):
            remedy = f"give a number (found {self.cells.get(name)!r})"
            raise UserError(str(self.manifest), f"{self.where}, {name}", remedy)
        return value

    def has(self, name: str) -> bool:
        return bool(self.cells.get(name))


def read_lost(manifest: Path, line: int, cells: dict[str, str], pad: Pad) -> Lost:
    """Return what a block lost.

    Raises:
        UserError: a number is missing, mistyped, or contradicts another one.
    """
    row = _Row(manifest, f"line {line}", cells)
    apart = [row.has(f"{side}_mass_before") or row.has(f"{side}_mass_after") for side in SIDES]
    pads = [_weighed(row, f"{side}_") for side in SIDES] if any(apart) else [(math.nan, math.nan)] * 2
    sides = tuple(before - after for before, after in pads)
    together = row.has("mass_before") or not any(apart)
    weighed = _weighed(row, "") if together else (pads[0][0] + pads[1][0], pads[0][1] + pads[1][1])
    mass = weighed[0] - weighed[1]
    if together and any(apart) and abs(mass - sum(sides)) > SURE * math.sqrt(6.0) * BALANCE:
        remedy = f"the pads lost {sides[0]:.2f} + {sides[1]:.2f} g, both together {mass:.2f} g; correct one"
        raise UserError(str(manifest), f"{row.where}, block {cells['block']}", remedy)
    names = [f"{side}_" for side in SIDES if _measured(row, f"{side}_")]
    points = [_points(row, name, pad) for name in names or [""] if _measured(row, name)]
    if len(names) == 1:
        other = next(side for side in SIDES if f"{side}_" not in names)
        remedy = "give the thickness of both pads, or of neither"
        raise UserError(str(manifest), f"{row.where}, {other}_thickness_before_1", remedy)
    each = np.mean(points, axis=0) if points else np.full(POINTS, np.nan)
    thin = (float(np.nanmean(points[0])), float(np.nanmean(points[1]))) if names else (math.nan, math.nan)
    return Lost(
        weighed,
        float(np.nanmean(each)) if points else math.nan,
        (sides[0], sides[1]),
        thin,
        float(each[:2].mean() - each[4:].mean()),
        float(each[::2].mean() - each[1::2].mean()),
        _disc_mass(row),
        _disc_wear(row),
    )


def _weighed(row: _Row, side: str) -> tuple[float, float]:
    before, after = (row.number(f"{side}mass_{when}") for when in ("before", "after"))
    if not before > after:
        which = f"{side.rstrip('_')} pad" if side else "pads"
        remedy = f"{which} gained mass ({before:g} to {after:g} g)"
        raise UserError(str(row.manifest), f"{row.where}, block {row.cells['block']}", remedy)
    return before, after


def _measured(row: _Row, side: str) -> bool:
    return any(row.has(f"{side}thickness_before_{point}") for point in range(1, POINTS + 1))


def _points(row: _Row, side: str, pad: Pad) -> Array:
    """Return what each point of a pad lost [mm], NaN where it was not measured before and after."""
    lost: list[float] = []
    names = [f"{side}thickness_before_{point}" for point in range(1, POINTS + 1)]
    names = [name for name in names if row.has(name) and row.has(name.replace("before", "after"))]
    if len(names) < FEWEST_POINTS:
        raise UserError(
            str(row.manifest), f"{row.where}, {side}thickness_before_1…{POINTS}", "too few; measure all"
        )
    for name in names:
        before, after = row.number(name), row.number(name.replace("before", "after"))
        if not 0.0 < before < pad.thickness_new + 1.0:
            remedy = f"{before:g} mm cannot be of a pad that is {pad.thickness_new:g} mm thick when new"
            raise UserError(str(row.manifest), f"{row.where}, {name}", remedy)
        lost.append(before - after)
    _refuse_stray(row, names, np.array(lost), UNEVEN + abs(float(np.median(lost))))
    if np.mean(lost) <= 0.0:
        remedy = f"the pads grew by {-1e3 * float(np.mean(lost)):.0f} µm; measure them cold, same points"
        raise UserError(str(row.manifest), f"{row.where}, {side}thickness_after_1…{POINTS}", remedy)
    everywhere = np.full(POINTS, np.nan)
    everywhere[[int(name[-1]) - 1 for name in names]] = lost
    return everywhere


def _refuse_stray(row: _Row, names: list[str], lost: Array, uneven: float) -> None:
    """Refuse a point that lost over `uneven` [mm] more or less than the others."""
    off = np.abs(lost - np.median(lost))
    if off.max() > uneven:
        name = names[int(np.argmax(off))]
        said = " and ".join(f"{one} {row.cells[one]}" for one in (name, name.replace("before", "after")))
        remedy = f"{off.max():.1f} mm off what the other points lost; correct the reading"
        raise UserError(str(row.manifest), f"{row.where}, {said} mm", remedy)


def _disc_mass(row: _Row) -> float:
    if not (row.has("disc_mass_before") or row.has("disc_mass_after")):
        return math.nan
    before, after = row.number("disc_mass_before"), row.number("disc_mass_after")
    if not min(before, after) > LIGHTEST_DISC or not max(before, after) < HEAVIEST_DISC:
        remedy = f"{before:g} and {after:g} cannot be a disc's mass in g; convert them"
        raise UserError(str(row.manifest), f"{row.where}, disc_mass_before, disc_mass_after", remedy)
    return before - after


def _disc_wear(row: _Row) -> float:
    names = [name for name in row.cells if name.startswith("disc_thickness_before_") and row.has(name)]
    if not names:
        return math.nan
    befores, afters = [], []
    for name in names:
        before, after = row.number(name), row.number(name.replace("before", "after"))
        if not min(before, after) > THINNEST_DISC or not max(before, after) < THICKEST_DISC:
            remedy = f"{before:g} and {after:g} cannot be a disc's thickness in mm; convert them"
            raise UserError(str(row.manifest), f"{row.where}, {name}", remedy)
        befores.append(before)
        afters.append(after)
    lost = np.array(befores) - np.array(afters)
    _refuse_stray(row, names, lost, UNEVEN)
    return float(lost.mean())
