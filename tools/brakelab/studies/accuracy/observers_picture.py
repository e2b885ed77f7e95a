"""Consistency of the joint observer: errors over 2σ in stop #1 and squared innovations, as SVG."""

from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.arrays import Vector
from brakelab.results.chart import write_svg
from brakelab.simulation.accuracy import AXLES, columns
from brakelab.simulation.closed_loop import Drive
from brakelab.simulation.configured import configured, shipped
from brakelab.studies.accuracy.observers import JOINT, ORDINARY, counted, drive_car
from brakelab.studies.accuracy.observers_cases import Setup
from ecu.algorithm.estimation.joint.kalman import GATE
from ecu.contract.signals import CORNERS

PICTURED: Final = 5
"""Cars."""
CHANNELS: Final = (*(f"test_ratio_{corner}" for corner in CORNERS), "test_ratio_balance")
EVERY: Final = 10  # cycles
LEFT, WIDTH, TOP, HEIGHT, GAP = 44.0, 520.0, 24.0, 96.0, 40.0
SECONDS, LARGEST_ERROR = 7.0, 2.0  # of the panels' axes
BIN, BINS = 0.25, 16
COLOURS: Final = ("#9aa5b1", "#d55e00")  # cold, adapted


class Consistency(NamedTuple):
    """One car's stop #1, cold and adapted."""

    t: tuple[Vector, Vector]
    """s since the first row that counts."""
    error: tuple[Vector, Vector]
    """Of the axle's mean friction over 2σ, shape (2 axles, n)."""
    ratio: tuple[Vector, Vector]
    """Squared innovations over their variance of every window, shape (channels, n)."""


def _errors(drive: Drive, rows: NDArray[np.bool_]) -> Vector:
    return np.stack(
        [
            (columns(drive.outputs, "mu_b", axle, rows) - columns(drive.truth, "mu_b", axle, rows)).mean(
                axis=0
            )
            / (2.0 * columns(drive.outputs, "sigma_mu_b", axle, rows).mean(axis=0))
            for axle in AXLES
        ]
    )


def innovations(drive: Drive, rows: NDArray[np.bool_]) -> Vector:
    """Return the squared innovations over their variance in `rows` of a drive, shape (channels, n)."""
    ratios = np.stack([drive.outputs[name][rows] for name in CHANNELS])
    return GATE**2 * ratios[:, np.isfinite(ratios).all(axis=0)]


def consistency_of(seed: int) -> Consistency:
    """Drive stop #1 with one car, cold and adapted."""
    _, kept = drive_car(Setup(shipped(ORDINARY), configured()), JOINT, seed)
    t, error, ratio = [], [], []
    for learned in (None, kept):
        drive, _ = drive_car(Setup(shipped("stop-1"), configured()), JOINT, seed, learned)
        rows = counted(drive)
        t.append(drive.t[rows] - drive.t[rows][0])
        error.append(_errors(drive, rows))
        ratio.append(innovations(drive, rows))
    return Consistency((t[0], t[1]), (error[0], error[1]), (ratio[0], ratio[1]))


def mean_ratio(cars: list[Consistency], state: int, channels: slice) -> float:
    """Return the mean squared innovation of some channels; `state` 0: cold, 1: adapted."""
    return float(np.mean(np.concatenate([car.ratio[state][channels].ravel() for car in cars])))


def _frame(title: str, top: float) -> list[str]:
    return [
        f'<text x="{LEFT}" y="{top - 7:.0f}">{title}</text>',
        f'<rect x="{LEFT}" y="{top}" width="{WIDTH}" height="{HEIGHT}" stroke="#c9ced4"/>',
    ]


def _error_panel(title: str, axle: int, top: float, cars: list[Consistency]) -> list[str]:
    parts, middle = _frame(title, top), top + 0.5 * HEIGHT
    scale = 0.5 * HEIGHT / LARGEST_ERROR
    for bound in (-1, 0, 1):
        y = middle - scale * bound
        parts.append(f'<path d="M{LEFT} {y:.1f}h{WIDTH}" stroke="#888" stroke-dasharray="4 4"/>')
        parts.append(f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{bound}</text>')
    for state, colour in enumerate(COLOURS):
        for car in cars:
            x = LEFT + WIDTH * np.minimum(car.t[state][::EVERY] / SECONDS, 1.0)
            y_of = middle - scale * np.clip(car.error[state][axle, ::EVERY], -LARGEST_ERROR, LARGEST_ERROR)
            points = " ".join(f"{a:.0f},{b:.1f}" for a, b in zip(x, y_of, strict=True))
            parts.append(f'<polyline points="{points}" stroke="{colour}"/>')
    return parts


def _histogram(title: str, top: float, cars: list[Consistency]) -> list[str]:
    """Draw the absolute innovations over their σ beside the ideal Gaussian."""
    parts = _frame(title, top)
    edges = BIN * np.arange(BINS + 1)
    gauss = np.sqrt(2.0 / np.pi) * np.exp(-0.5 * edges**2)
    for state, colour in enumerate(COLOURS):
        sizes = np.sqrt(np.concatenate([car.ratio[state].ravel() for car in cars]))
        heights = np.histogram(sizes, edges)[0] / (BIN * len(sizes))
        path = "".join(
            f"V{top + HEIGHT - min(0.5 * HEIGHT * h, HEIGHT):.1f}H{LEFT + WIDTH * (place + 1) / BINS:.1f}"
            for place, h in enumerate(heights)
        )
        parts.append(f'<path d="M{LEFT} {top + HEIGHT}{path}" stroke="{colour}"/>')
    points = " ".join(
        f"{LEFT + WIDTH * a / edges[-1]:.1f},{top + HEIGHT - 0.5 * HEIGHT * b:.1f}"
        for a, b in zip(edges, gauss, strict=True)
    )
    parts.append(f'<polyline points="{points}" stroke="#333" stroke-dasharray="4 4"/>')
    for tick in range(5):
        x = LEFT + WIDTH * tick / edges[-1]
        parts.append(f'<text x="{x:.0f}" y="{top + HEIGHT + 16:.0f}" text-anchor="middle">{tick}</text>')
    return parts


def write_picture(path: Path, cars: list[Consistency]) -> None:
    """Draw errors of both axles and the innovations; nothing where there is no folder for it.

    Raises:
        UserError: the file cannot be written.
    """
    if not path.parent.is_dir():
        return
    names = " and ".join(
        f'<tspan style="fill:{colour}">{name}</tspan>'
        for name, colour in zip(("cold", "adapted"), COLOURS, strict=True)
    )
    body: list[str] = []
    for axle, name in enumerate(AXLES):
        title = f"stop #1, {name}: friction's error over 2σ, {names}; {SECONDS:.0f} s"
        body += _error_panel(title, axle, TOP + axle * (HEIGHT + GAP), cars)
    title = "innovations over their σ, all wheels and total force; dashed: Gaussian"
    body += _histogram(title, TOP + 2 * (HEIGHT + GAP), cars)
    write_svg(path, LEFT + WIDTH + 16.0, TOP + 3 * (HEIGHT + GAP), body)
