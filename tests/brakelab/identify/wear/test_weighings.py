"""What a row of the manifest says a block's pads and disc lost, pad by pad; what is refused of it."""

from pathlib import Path

import numpy as np
import pytest

from brakelab.identify.wear.weighings import read_lost
from ecu.errors import UserError
from ecu.settings.config import load_config

PAD = load_config(Path(__file__).parents[4] / "config" / "suv.toml").front.pad
MANIFEST = Path("m.csv")


def row(taper: float = 0.0, **changed) -> dict[str, str]:
    """Return a row of pads measured apart: 1.6 and 1.4 g, 0.11 and 0.10 mm, disc 0.9 g and 12 µm."""
    cells = {"block": "b"}
    lean = taper * np.array([0.5, 0.5, 0.0, 0.0, -0.5, -0.5])
    for side, mass, wear in (("inboard", 1.6, 0.11), ("outboard", 1.4, 0.10)):
        cells |= {f"{side}_mass_before": "225.0", f"{side}_mass_after": f"{225.0 - mass:.3f}"}
        for point, more in enumerate(lean, 1):
            before = 11.0 + 0.02 * point
            cells[f"{side}_thickness_before_{point}"] = f"{before:.3f}"
            cells[f"{side}_thickness_after_{point}"] = f"{before - wear - more:.3f}"
    cells |= {"disc_mass_before": "9120.40", "disc_mass_after": "9119.50"}
    cells |= {f"disc_thickness_before_{k}": f"{28.0 + 0.003 * k:.3f}" for k in range(1, 5)}
    cells |= {f"disc_thickness_after_{k}": f"{27.988 + 0.003 * k:.3f}" for k in range(1, 5)}
    return cells | changed


def test_pads_apart_are_what_they_are_together():
    lost = read_lost(MANIFEST, 2, row(taper=0.04), PAD)
    assert lost.mass == pytest.approx(3.0)
    assert lost.wear == pytest.approx(0.105)
    assert lost.sides == pytest.approx((1.6, 1.4))
    assert lost.thin == pytest.approx((0.11, 0.10))
    assert lost.along == pytest.approx(0.04)
    assert lost.across == pytest.approx(0.0, abs=1e-9)
    assert (lost.disc_mass, lost.disc_wear) == pytest.approx((0.9, 0.012))


def test_what_was_not_measured_is_nan():
    lost = read_lost(MANIFEST, 2, {"block": "b", "mass_before": "450", "mass_after": "447"}, PAD)
    assert lost.mass == 3.0
    assert np.isnan([lost.wear, *lost.sides, *lost.thin, lost.along, lost.disc_mass, lost.disc_wear]).all()


def test_a_disc_may_gain_mass_from_its_pads():
    """Transfer films do that; a pad cannot."""
    assert read_lost(MANIFEST, 2, row(disc_mass_after="9120.5"), PAD).disc_mass == pytest.approx(-0.1)


def test_a_point_that_was_not_measured_counts_for_nothing():
    lost = read_lost(MANIFEST, 2, row(inboard_thickness_after_1="", outboard_thickness_before_4=""), PAD)
    assert lost.thin == pytest.approx((0.11, 0.10))
    assert lost.wear == pytest.approx(0.105)
    assert np.isnan(lost.along)


BAD = {
    "too few points": (
        {f"inboard_thickness_after_{point}": "" for point in range(1, 4)},
        "inboard_thickness_before_1…6: too few; measure all",
    ),
    "one pad's mass alone": ({"outboard_mass_before": ""}, r"line 2, outboard_mass_before: give a number"),
    "a pad that gained": ({"inboard_mass_after": "226"}, "block b: inboard pad gained mass"),
    "both together, but other": (
        {"mass_before": "450", "mass_after": "445"},
        r"the pads lost 1.60 \+ 1.40 g, both together 5.00 g",
    ),
    "one pad's thickness alone": (
        {f"outboard_thickness_before_{point}": "" for point in range(1, 7)},
        "outboard_thickness_before_1: give the thickness of both pads",
    ),
    "a point mistyped": (
        {"inboard_thickness_after_3": "1.95"},
        "inboard_thickness_before_3 11.060 and inboard_thickness_after_3 1.95 mm",
    ),
    "a pad as thick as a disc": ({"inboard_thickness_before_2": "28"}, "28 mm cannot be of a pad"),
    "a disc in kg": ({"disc_mass_before": "9.1204", "disc_mass_after": "9.1195"}, "cannot be a disc's mass"),
    "a disc's thickness in m": ({"disc_thickness_before_2": "0.028"}, "cannot be a disc's thickness"),
    "a point of the disc mistyped": ({"disc_thickness_after_2": "27.0"}, "disc_thickness_before_2 28.006"),
    "text": ({"disc_mass_after": "heavy"}, "line 2, disc_mass_after: give a number"),
}


@pytest.mark.parametrize(("changed", "said"), BAD.values(), ids=BAD)
def test_what_is_wrong_is_one_line_that_names_the_place(changed, said):
    with pytest.raises(UserError, match=said) as caught:
        read_lost(MANIFEST, 2, row(**changed), PAD)
    assert "\n" not in str(caught.value)
