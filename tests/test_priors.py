"""What the observer assumes and what the simulated cars are drawn from: no width and no shape on both sides.

A prior taken from the draw would be known, not assumed, and every accuracy with it.
"""

import math
import tomllib
from pathlib import Path

import pytest

from brakelab.plant.draw import load_widths
from ecu.algorithm.estimation.joint.layout import (
    BIAS,
    DRAG,
    MASS,
    OFFSET,
    RADIUS,
    RATIO,
    STIFFNESS,
)
from ecu.algorithm.estimation.joint.prior import LEVEL_AXLE, LEVEL_COMMON, LEVEL_WHEEL, PRIOR
from ecu.algorithm.estimation.joint.wheel import PEAK_DEGRESSION, SHAPE

ROOT = Path(__file__).parent.parent
PLANTS = sorted((ROOT / "config/plant").glob("*.toml"))
WIDE = load_widths(ROOT / "config/plant/draw.toml", "wide")
APART = 0.05  # of the larger


def even(half_width: float) -> float:
    """Return the standard deviation of an even distribution."""
    return half_width / math.sqrt(3.0)


def differ(one: float, other: float) -> bool:
    """Return whether two numbers are not the same for all that matters."""
    return abs(one - other) > APART * max(abs(one), abs(other))


@pytest.mark.parametrize(
    ("name", "prior", "drawn"),
    [  # standard deviations: of the observer's prior, of the wide draw
        ("mass", PRIOR[MASS], even(WIDE.mass)),
        ("drag", PRIOR[DRAG], even(WIDE.drag)),
        ("accelerometer", PRIOR[BIAS], even(WIDE.accel_zero)),
        ("rolling radius", PRIOR[RADIUS], even(WIDE.free_radius)),
        ("slip stiffness", PRIOR[STIFFNESS], even(WIDE.slip_stiffness)),
        ("slip stiffness, rear over front", PRIOR[RATIO], math.sqrt(2.0) * even(WIDE.slip_stiffness_axle)),
        ("push-out pressure", PRIOR[OFFSET], even(WIDE.push_out_pressure)),
        (
            "friction of an axle",
            math.hypot(LEVEL_COMMON, LEVEL_AXLE),
            even(0.5 * (WIDE.friction_axle[1] - WIDE.friction_axle[0])) if WIDE.friction_axle else 0.0,
        ),
        ("friction of a wheel", LEVEL_WHEEL, even(WIDE.friction_wheel)),
    ],
)
def test_the_width_of_a_prior_is_not_that_of_the_draw(name: str, prior: float, drawn: float) -> None:
    assert differ(prior, drawn)


@pytest.mark.parametrize("path", PLANTS, ids=lambda path: path.stem)
def test_the_tyre_of_the_observer_is_that_of_no_simulated_car(path: Path) -> None:
    tyre = tomllib.loads(path.read_text("utf-8")).get("tyre", {})
    if "magic_c" in tyre:
        assert tyre["magic_c"] != SHAPE
        assert tyre["magic_e"] != 0.0  # that of the observer's inverse
    if "friction_degression" in tyre:
        assert differ(tyre["friction_degression"], PEAK_DEGRESSION)


def test_a_prior_of_the_draw_is_found() -> None:
    assert not differ(even(0.03), 0.0173)
    assert differ(even(0.03), 0.03)
