"""Page of a wear law: tables, specific wear (Figure 7.9), sensitivity (Figure 7.10), residuals, blending."""

from pathlib import Path
from typing import Final

import numpy as np

from brakelab.arrays import Array
from brakelab.identify.wear.curves import sensitivity, specific_wear, wear_surface
from brakelab.identify.wear.fit import TERMS, UNITS, Fit, leave_one_out
from brakelab.identify.wear.fusion import Fused
from brakelab.identify.wear.reader import Block
from brakelab.identify.wear.reproduced import reproduced_table
from brakelab.identify.wear.running_in import Measured, RunIn
from brakelab.results.chart import BLUE, GREEN, GREY, ORANGE, PINK, Cells, Line, Panel, write_chart
from brakelab.results.text_table import Table, cell, markdown

MOTION: Final = ((5.0, BLUE), (20.0, GREEN), (50.0, ORANGE))  # kW of friction
DECEL: Final = 2.0  # m/s^2 of the surface
SPEED: Final = np.linspace(20.0, 140.0, 25)  # km/h
HEAT: Final = np.linspace(20.0, 400.0, 39)  # degC
FRICTION_ERRORS: Final = np.linspace(-0.3, 0.3, 31)
HEAT_ERRORS: Final = np.linspace(-50.0, 50.0, 41)  # K
APART: Final = (
    "block", "inboard [g]", "outboard [g]", "inboard / outboard", "inboard [µm]", "outboard [µm]",
    "taper along [µm]", "taper across [µm]", "disc [g]", "disc [µm]", "disc [g/MJ]",
)  # fmt: skip
LEGEND: Final = (
    ("5 kW, or coolest block", BLUE),
    ("20 kW", GREEN),
    ("50 kW, or hottest block", ORANGE),
    ("quasi-static", PINK),
)


def curve_panel(extended: Array, static: Array) -> Panel:
    """Return specific wear over disc temperature for a few powers."""
    lines = [
        Line(HEAT, specific_wear(extended, HEAT, 1e-3 * power, 0.15), colour) for power, colour in MOTION
    ]
    lines.append(Line(HEAT, specific_wear(static, HEAT, 0.0, 0.0), PINK, True))
    top = 1.1 * max(float(line.y.max()) for line in lines)
    return Panel("specific wear [g/MJ]", "disc [degC]", (20.0, 400.0), (0.0, top), lines)


def surface_panel(coefficients: Array, mass: float, name: str) -> Panel:
    """Return specific wear over speed and disc temperature as coloured cells."""
    speed, heat = (0.5 * (edges[1:] + edges[:-1]) for edges in (SPEED, HEAT))
    value = wear_surface(coefficients, speed / 3.6, heat, DECEL, mass)
    low, high = 0.0, float(value.max())
    title = f"{name}, {value.min():.2f} to {high:.2f} (dark) g/MJ; disc [degC]"
    cells = Cells(SPEED, HEAT, value, low, high)
    ends = ((float(SPEED[0]), float(SPEED[-1])), (float(HEAT[0]), float(HEAT[-1])))
    return Panel(title, f"speed [km/h], at {DECEL:.0f} m/s²", *ends, [], cells=cells)


def sensitivity_panels(extended: Array, static: Array, cool: Array, hot: Array) -> list[Panel]:
    """Return the error of wear over errors of friction and of temperature, for two blocks' regressors."""
    panels = []
    for of, errors, scale, name in (
        ("friction", FRICTION_ERRORS, 100.0, "error of friction [%]"),
        ("temperature", HEAT_ERRORS, 1.0, "error of disc temperature [K]"),
    ):
        lines = [
            Line(scale * errors, 100.0 * sensitivity(extended, x, errors, of), colour)
            for x, colour in ((cool, BLUE), (hot, ORANGE))
        ]
        lines.append(Line(scale * errors, 100.0 * sensitivity(static, hot, errors, of), PINK, True))
        wide = max(1.1 * max(float(np.abs(line.y).max()) for line in lines), 1.0)
        ends = (scale * float(errors[0]), scale * float(errors[-1]))
        panels.append(Panel("error of wear [%]", name, ends, (-wide, wide), lines))
    return panels


def residual_panels(blocks: list[Block], mass: Array, fit: Fit) -> list[Panel]:
    """Return law over measured, and residuals over temperature, energy and order of the blocks."""
    most = 1.05 * float(max(mass.max(), fit.predicted.max()))
    residual = 100.0 * (fit.predicted / mass - 1.0)
    left_out = 100.0 * (fit.left_out / mass - 1.0)
    wide = max(1.2 * float(np.abs(np.concatenate([residual, left_out])).max()), 1.0)
    diagonal = np.array([0.0, most])
    panels = [
        Panel("by the law over measured [g], pads run in", "measured [g]", (0.0, most), (0.0, most), [
            Line(diagonal, diagonal, GREY, True), Line(mass, fit.predicted, BLUE, marks=True),
        ])
    ]  # fmt: skip
    for name, x in (
        ("mean disc temperature [degC]", np.array([block.temperature for block in blocks])),
        ("energy [MJ]", np.array([block.regressors[0] for block in blocks])),
        ("block, in the order measured", np.arange(1.0, len(blocks) + 1.0)),
    ):
        margin = 0.06 * max(float(np.ptp(x)), 1e-6)
        ends = (float(x.min()) - margin, float(x.max()) + margin)
        lines = [
            Line(np.array(ends), np.zeros(2), GREY, True),
            Line(x, left_out, ORANGE, marks=True),
            Line(x, residual, BLUE, marks=True),
        ]
        panels.append(Panel("residual [%], block left out orange", name, ends, (-wide, wide), lines))
    return panels


def law_panels(blocks: list[Block], mass: Array, fit: Fit, static: Fit, of_brake: float) -> list[Panel]:
    """Return all panels of an identified law; `of_brake`: mass that one brake slows [kg]."""
    heat = [block.temperature for block in blocks]
    cool, hot = blocks[int(np.argmin(heat))].regressors, blocks[int(np.argmax(heat))].regressors
    extended, quasi_static = fit.coefficients, static.coefficients
    return [
        curve_panel(extended, quasi_static),
        surface_panel(extended, of_brake, "extended"),
        *sensitivity_panels(extended, quasi_static, cool, hot),
        *residual_panels(blocks, mass, fit),
    ]


def fusion_panel(blocks: list[Block], fused: Fused) -> list[Panel]:
    """Return mass over linear wear of the blocks, before and after they are blended, with the line of K."""
    wear = np.array([block.lost.wear for block in blocks])
    known = np.isfinite(wear)
    if not np.isfinite(fused.slope):
        return []
    wear, mass, blended = wear[known], np.array([b.lost.mass for b in blocks])[known], fused.mass[known]
    ends = np.array([0.0, 1.1 * float(wear.max())])
    top = float(max(1.1 * mass.max(), fused.slope * ends[1]))
    moved = [
        Line(np.array([x, y / fused.slope]), np.array([m, y]), GREY)
        for x, m, y in zip(wear, mass, blended, strict=True)
    ]
    lines = [
        Line(ends, fused.slope * ends, GREY, True),
        *moved,
        Line(wear, mass, ORANGE, marks=True),
        Line(blended / fused.slope, blended, BLUE, marks=True),
    ]
    title = f"mass [g], measured orange, blended blue; K {fused.slope:.1f} g/mm"
    return [Panel(title, "linear wear [mm]", (0.0, float(ends[1])), (0.0, top), lines)]


def run_in_line(run_in: RunIn) -> str:
    """Return what is known of the running-in of the pads, in one sentence."""
    if not run_in.known:
        return (
            "The masses are not those of one set of pads, block after block: nothing says whether its pads "
            f"were run in ({100 * run_in.sigma:.0f} %, σ)."
        )
    most = 100.0 * float(run_in.factor.max() - 1.0)
    alone = "" if run_in.repeated else "; no block repeats another: only the law tells it from heat"
    return (
        f"Pads wore faster while they ran in, by {most:.0f} % at most, which is taken off (sure to "
        f"{100 * run_in.sigma:.0f} %, σ, over all blocks{alone})."
    )


def tables(blocks: list[Block], wear: Measured, fit: Fit, static: Fit) -> list[Table]:
    """Return coefficients, blocks and the comparison of the two laws as tables."""
    fused = wear.fused
    coefficients = [
        (name, unit, f"{value:.4g}", f"{low:.4g}–{high:.4g}" if value else "left out")
        for name, unit, value, low, high in zip(
            TERMS, UNITS, fit.coefficients, fit.low, fit.high, strict=True
        )
    ]
    rows = [
        (
            block.name,
            f"{block.applications}",
            f"{block.regressors[0]:.1f}",
            f"{block.temperature:.0f}",
            f"{lost:.3f}",
            f"{mass:.3f}",
            f"{predicted:.3f}",
            f"{100 * (predicted / mass - 1):+.1f}",
            f"{100 * (left_out / mass - 1):+.1f}",
        )
        for block, lost, mass, predicted, left_out in zip(
            blocks, fused.mass, wear.mass, fit.predicted, fit.left_out, strict=True
        )
    ]
    laws = [
        (
            name,
            f"{each.r2:.4f}",
            f"{100 * leave_one_out(each, wear.mass):.1f}",
            f"{100 * each.scatter:.1f}",
            f"{each.criterion:.1f}",
            f"{each.rank}",
        )
        for name, each in (("extended (7.13)", fit), ("quasi-static (7.14)", static))
    ]
    slope = (
        f"{fused.slope:.2f} ± {fused.slope_error:.2f} g/mm" if np.isfinite(fused.slope) else "not measured"
    )
    return [
        Table(
            "Law",
            ("term", "unit", "value", "95 % confidence"),
            coefficients,
            "Of both pads of a calliper, disc in degC; the mean of all sets of terms by how they predict "
            "blocks left out, the choice is in the confidence. At discs 50 K hotter or cooler it is sure to "
            f"{100 * fit.elsewhere:.0f} % (σ).",
        ),
        Table(
            "Blocks",
            ("block", "applications", "energy [MJ]", "disc [degC]", "mass [g]", "run in [g]", "law [g]",
             "error [%]", "left out [%]"),
            rows,
            f"Mass: balance and thickness blended (7.11); mass over linear wear K: {slope}. "
            f"{run_in_line(wear.run_in)} Left out: by the law of the other blocks.",
        ),
        Table(
            "The two laws",
            ("law", "R²", "left out, RMS [%]", "scatter [%]", "AICc", "rank"),
            laws,
            "Rank: of the scaled regressors; no set of which the law is the mean has more terms.",
        ),
        *_apart(blocks),
        *_beside(blocks),
    ]  # fmt: skip


def _apart(blocks: list[Block]) -> list[Table]:
    """Return pads and disc of every block one by one, where they were measured."""
    rows = [
        (
            block.name,
            *(cell(mass, ".2f") for mass in block.lost.sides),
            cell(block.lost.sides[0] / block.lost.sides[1], ".2f"),
            *(cell(1e3 * value, ".0f") for value in block.lost.thin),
            *(cell(1e3 * value, "+.0f") for value in (block.lost.along, block.lost.across)),
            cell(block.lost.disc_mass, ".2f"),
            cell(1e3 * block.lost.disc_wear, ".0f"),
            cell(block.lost.disc_mass / float(block.regressors[0]), ".4f"),
        )
        for block in blocks
    ]
    measured = [k for k in range(len(APART)) if any(row[k] != "–" for row in rows)]
    if len(measured) < 2:
        return []
    return [
        Table(
            "Pads and disc apart",
            tuple(APART[k] for k in measured),
            [tuple(row[k] for k in measured) for row in rows],
            "The law is of both pads together. Taper: what the leading end (points 1, 2) lost more than the "
            "trailing one (5, 6), the outer radius (1, 3, 5) more than the inner one. "
            f"{disc_line(blocks)}",
        )
    ]  # fmt: skip


def disc_line(blocks: list[Block]) -> str:
    """Return what the disc loses for the work of the brake, beside the pads, in one sentence."""
    weighed = [block for block in blocks if np.isfinite(block.lost.disc_mass)]
    if not weighed:
        return "No disc was weighed."
    disc, pads, work = np.array([(b.lost.disc_mass, b.lost.mass, b.regressors[0]) for b in weighed]).T
    rate = float(disc.sum() / work.sum())
    spread = float(np.std(disc / work, ddof=1)) if len(weighed) > 1 else np.nan
    sigma = f" (σ of a block {spread:.4f})" if np.isfinite(spread) else ""
    share = 100.0 * float(disc.sum() / (disc.sum() + pads.sum()))
    return (
        f"The disc lost {rate:.4f} g/MJ{sigma}, {share:.0f} % of what disc and pads lost together: no key of "
        "CONFIG, which knows the wear of pads."
    )


def _beside(blocks: list[Block]) -> list[Table]:
    found = [block.reproduced for block in blocks if block.reproduced is not None]
    return [reproduced_table(found)] if found else []


def write_page(
    page: Path, blocks: list[Block], wear: Measured, fit: Fit, static: Fit, of_brake: float
) -> None:
    """Write the tables and the panels of the law; `of_brake`: mass that one brake slows [kg]."""
    picture = page.with_suffix(".svg")
    panels = [*law_panels(blocks, wear.mass, fit, static, of_brake), *fusion_panel(blocks, wear.fused)]
    write_chart(picture, panels, LEGEND)
    parts = [markdown(table) for table in tables(blocks, wear, fit, static)]
    head = (
        f"# Wear law of {len(blocks)} blocks\n\n![Specific wear (Figure 7.9), sensitivity (Figure 7.10), "
        f"residuals, balance and thickness blended (Figures 7.7, 7.8)]({picture.name})\n\n"
    )
    page.write_text(head + "\n".join(parts).rstrip() + "\n", encoding="utf-8")
