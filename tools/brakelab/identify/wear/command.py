"""Identification of wear (`brake-ecu identify wear`): wear law from dynamometer blocks, as a CONFIG."""

from pathlib import Path
from typing import Final

import numpy as np

from brakelab.arrays import Array
from brakelab.identify.config_file import Section, write_car
from brakelab.identify.measurement_files import open_campaign
from brakelab.identify.wear.curves import SHARE
from brakelab.identify.wear.fit import (
    QUASI_STATIC,
    TERMS,
    UNITS,
    Fit,
    explains,
    fit_law,
    leave_one_out,
    strangers,
)
from brakelab.identify.wear.fusion import SURE, Fused, disagreeing, doubtful, unequal
from brakelab.identify.wear.page import tables, write_page
from brakelab.identify.wear.reader import Block, read_blocks
from brakelab.identify.wear.running_in import Measured, measured, unlinked, worn_before
from brakelab.identify.wear.weighings import SIDES
from ecu.errors import RunFault, UserError
from ecu.output import argument, give, say, wrote
from ecu.settings.config import Axle
from ecu.settings.pad import Pad

DENSITIES: Final = (800.0, 6000.0)  # kg/m^3: organic linings 1500 to 2800, sintered ones up to 5500
KNOWN_SLOPE: Final = 0.15  # relative standard deviation: above, the density of CONFIG is as good
ROAD: Final = 0.20  # relative: what a brake wears on the road beside a dynamometer (7.20, 7.21; +20 %)


def law_error(fit: Fit, mass: Array, run_in: float) -> float:
    """Return the relative standard deviation of a law on the road, of blocks that lost `mass` [g], (n,).

    `run_in`: that of the masses by what is not known of their running-in.
    """
    return float(np.linalg.norm([leave_one_out(fit, mass), fit.elsewhere, run_in, ROAD]))


def slope_is_known(fused: Fused) -> bool:
    """Return whether K is surer than the density of a configuration."""
    return fused.slope_error < KNOWN_SLOPE * fused.slope


def law_section(fit: Fit, error: float, pad: Pad, fused: Fused) -> Section:
    """Return the keys of a pad: its law, the law's `error`, relative, and the density by K where it is known.

    Raises:
        UserError: K cannot be that of a lining of this area.
    """
    numbers = ", ".join(f"{value:.6g}" for value in fit.coefficients)
    measured: Section = {}
    if slope_is_known(fused):
        slope = fused.slope
        density = 0.5 * slope / pad.area  # kg/m is g/mm
        within = 1.0 + SURE * fused.slope_error / slope
        if not DENSITIES[0] / within < density < DENSITIES[1] * within:
            remedy = (
                f"pads lose {slope:.3g} g/mm, {density:.3g} kg/m^3 by an area of {pad.area:g} m^2: "
                "give masses in g, thickness in mm, and the pad's area in CONFIG"
            )
            raise UserError("mass, thickness", "", remedy)
        measured = {"density": (f"{density:.0f}", f"kg/m^3, by {slope:.2f} g/mm of the blocks and the area")}
    return measured | {
        "law": ('"extended"', "from dynamometer blocks, disc in degC"),
        "coefficients": (f"[{numbers}]", "g/MJ, g/MJ/K, g/MJ/K^2, g/MW, g/MW/K, g s/MJ^2, …/K"),
        "sigma": (
            f"{min(max(error, 0.02), 0.9):.4f}",
            "relative: blocks left out, discs 50 K off theirs, running-in, the road",
        ),
    }


def _measured(blocks: list[Block]) -> Measured:
    lost = [block.lost for block in blocks]
    return measured(
        np.array([block.regressors for block in blocks]),
        np.array([one.wear for one in lost]),
        np.array([one.mass for one in lost]),
        worn_before(*np.array([one.weighed for one in lost]).T),
    )


def _agreeing(blocks: list[Block]) -> list[Block]:
    """Return the blocks without those that the law of the others does not come near, which are said.

    Raises:
        UserError: balance and thickness of a block cannot both be right.
    """
    masses = np.array([b.lost.mass for b in blocks])
    for side, name in enumerate(SIDES):
        thin, weighed = (np.array([getattr(b.lost, of)[side] for b in blocks]) for of in ("thin", "sides"))
        _refuse_disagreeing(blocks, f"{name} pad ", thin, weighed)
    _refuse_disagreeing(blocks, "", np.array([b.lost.wear for b in blocks]), masses)
    sides = np.array([b.lost.sides for b in blocks])
    for place, usual in unequal(sides[:, 0], sides[:, 1]):
        inboard, outboard = sides[place]
        say(
            f"block {blocks[place].name}: inboard pad {inboard:.2f} g, outboard {outboard:.2f} g, in the "
            f"others {usual:.2f} to 1; check their weighings"
        )
    for one, other, grams in unlinked(*np.array([block.lost.weighed for block in blocks]).T):
        ended, began = blocks[one].name, blocks[other].name
        say(
            f"block {began}: begins {abs(grams):.2f} g {'heavier' if grams > 0 else 'lighter'} than block "
            f"{ended} ended, unlike the others; check mass_after of {ended} and mass_before of {began}"
        )
    thickness = np.array([block.lost.wear for block in blocks])
    for place, grams in doubtful(thickness, masses):
        say(
            f"block {blocks[place].name}: it lost {masses[place]:.2f} g by the balance, {grams:.2f} g by its "
            "thickness, unlike the others; it counts less: check both"
        )
    every = _measured(blocks)
    strange = strangers(every.regressors, every.mass, every.variance)
    rest = [block for place, block in enumerate(blocks) if place not in strange]
    if strange:
        others = _measured(rest)
        law = fit_law(others.regressors, others.mass, others.variance)
        for place in strange:
            say(
                f"block {blocks[place].name}: left out, it lost {masses[place]:.2f} g, "
                f"{every.regressors[place] @ law.coefficients:.2f} g by the law of the others; check its "
                "weighing and its file"
            )
    return rest


def _refuse_disagreeing(blocks: list[Block], what: str, wear: Array, mass: Array) -> None:
    for place, grams in disagreeing(wear, mass):
        remedy = (
            f"{what}lost {mass[place]:.2f} g by the balance, {grams:.2f} g by its thickness and what the "
            "other blocks lose per mm; correct one of them, or leave the thicknesses of all blocks out"
        )
        raise UserError(f"block {blocks[place].name}", "", remedy)


def identify_wear(manifest: Path, config: Path, axle: str, out: Path, columns: Path | None = None) -> None:
    """Identify the wear law of an axle's linings; write `out` and `out`.md.

    `columns`: file of columns of the blocks.

    Raises:
        UserError: an argument or a file is invalid.
        RunFault: no law explains the blocks.
    """
    vehicle, written = open_campaign(manifest, config, axle, out, columns)
    page = written[1]
    brake: Axle = getattr(vehicle, axle)
    blocks = read_blocks(manifest, vehicle, axle, columns)
    try:
        blocks = _agreeing(blocks)
        wear = _measured(blocks)
        fused = wear.fused
        fit = fit_law(wear.regressors, wear.mass, wear.variance)
        static = fit_law(wear.regressors, wear.mass, wear.variance, QUASI_STATIC)
        if not explains(fit, wear.mass):
            raise RunFault(
                f"{manifest}: no law explains these blocks better than their mean (R² {fit.r2:.2f}, left out "
                f"{100 * leave_one_out(fit, wear.mass):.0f} % RMS); check masses and the units of all files"
            )
        section = law_section(fit, law_error(fit, wear.mass, wear.run_in.sigma), brake.pad, fused)
    except UserError as error:
        raise UserError(
            str(manifest), ": ".join(filter(None, (error.where, error.place))), error.remedy
        ) from None
    head = "# Wear law by `brake-ecu identify wear`."
    write_car(config, out, head, {f"{axle}.pad": section})
    write_page(page, blocks, wear, fit, static, SHARE[axle] * vehicle.vehicle.mass)
    named = zip(TERMS, fit.coefficients, UNITS, strict=True)
    kept = ", ".join(f"{name} = {value:.4g} {unit}" for name, value, unit in named if value)
    if np.isfinite(fused.slope) and not slope_is_known(fused):
        say(
            f"{manifest}: pads lose {fused.slope:.3g} ± {fused.slope_error:.2g} g/mm: too little was worn "
            "off to measure it; the density stays that of CONFIG"
        )
    give(coefficients=dict(zip(TERMS, fit.coefficients, strict=True)), r2=fit.r2)
    give(left_out=leave_one_out(fit, wear.mass), tables=tables(blocks, wear, fit, static))
    for one in (block.reproduced for block in blocks):
        if one is not None and one.verdict != "met":
            say(f"block {one.block}: not run as its programme asks, {one.verdict}; see {page}")
    print(f"{out}: {kept}")
    print(
        f"{page}: {len(blocks)} blocks, R² {fit.r2:.4f} (quasi-static {static.r2:.4f}), blocks left out "
        f"{100 * leave_one_out(fit, wear.mass):.1f} % RMS, rank {fit.rank} of 7"
    )
    wrote(*written, next=f"brake-ecu replay LOG --config {argument(out)} --out drive.parquet")
