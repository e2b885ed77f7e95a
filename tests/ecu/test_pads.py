"""`brake-ecu wear`: new pads, measured thicknesses, how far they go, and what it says to what cannot be."""

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from ecu.algorithm.monitoring.wear import LEG
from ecu.algorithm.step import new_state
from ecu.contract.records import N_LEGS
from ecu.errors import UserError
from ecu.pads import appraise, pads, rate_per_metre, wear_command
from ecu.recording.store import in_use, open_store, restore, save
from ecu.settings.config import load_config, new_params, store_key

CONFIG = Path(__file__).parents[2] / "config" / "suv.toml"
VEHICLE = load_config(CONFIG)
PARAMS = new_params(VEHICLE)
PER_MM = float(PARAMS["pad_mass"][0, 0])


def driven(km: float, grams: float, legs: np.ndarray | None = None):
    """Return a record of pads that were fitted new, driven `km`, worn by `grams` each by the law.

    3 mm in front are 7.16 mm of the smaller pads at the rear.
    """
    learned = new_state(PARAMS)["learned"].copy()
    wear = learned[0]["wear"]
    wear["odometer"], wear["told"] = 1e3 * km, 1
    wear["regressors"][0] = grams / PARAMS["wear_law"][0, 0]
    if legs is not None:
        wear["legs"] = len(legs)
        wear["leg_ends"][:, 0] = np.cumsum(legs)[:, None] / PARAMS["wear_law"][0, 0]
    return learned


def kept(folder: Path, learned):
    with closing(open_store(folder)) as store:
        save(store, store_key(VEHICLE), learned)
    return folder


def stored(folder: Path):
    with closing(open_store(folder)) as store:
        return restore(store, store_key(VEHICLE), PARAMS["mu_nominal"][0])[1][0]["wear"]


def test_remaining_distance_is_what_is_left_over_what_a_kilometre_takes():
    """3 mm in 20,000 km of 9 mm: 40,000 km are left."""
    legs = np.full(N_LEGS, 3 * PER_MM / 20e3 * LEG / 1e3)
    corner = appraise(PARAMS, driven(20e3, 3 * PER_MM, legs), VEHICLE)[0]
    assert (corner.wear, corner.thickness, corner.driven) == pytest.approx((3.0, 9.0, 20e3))
    assert corner.remaining == pytest.approx(40e3)
    assert corner.remaining_low < 40e3 < corner.remaining_high


def test_uneven_driving_widens_the_band_of_the_distance():
    even = np.full(N_LEGS, 2.0)
    uneven = even * np.tile([0.4, 1.6], N_LEGS // 2)
    widths = [
        (c := appraise(PARAMS, driven(20e3, 50.0, legs), VEHICLE)[0]).remaining_high - c.remaining_low
        for legs in (even, uneven)
    ]
    assert widths[1] > 1.1 * widths[0]


def test_the_leg_in_which_pads_were_fitted_is_no_leg_of_theirs():
    """Fitted after 3.9 legs, then 2 g a leg: a tenth of a leg used to count as one that wears a tenth."""
    learned = driven(2e3, 8.2)
    wear = learned[0]["wear"]
    wear["fitted_at"], wear["legs"] = 3.9 * LEG, 8
    masses = np.array([0.0, 0.0, 0.0, 0.2, 2.2, 4.2, 6.2, 8.2])
    wear["leg_ends"][:, 0] = masses[:, None] / PARAMS["wear_law"][0, 0]
    rate, spread = rate_per_metre(PARAMS[0], wear, 0)
    assert rate == pytest.approx(8.2 / (2e6 - 3.9 * LEG))
    assert spread == pytest.approx(0.0, abs=1e-9)


def test_linings_of_which_nobody_said_anything_are_half_worn_give_or_take_half():
    """Their band holds 95 % of any pads: of a uniform distribution the mean is in the middle."""
    learned = new_state(PARAMS)["learned"].copy()
    for corner, pad in zip(appraise(PARAMS, learned, VEHICLE), pads(VEHICLE), strict=True):
        life = pad.thickness_new - pad.thickness_worn
        assert corner.wear == pytest.approx(0.5 * life)
        assert corner.sigma == pytest.approx(life / np.sqrt(12.0), rel=0.02)


def test_a_measured_thickness_corrects_and_narrows(tmp_path, capsys):
    folder = kept(tmp_path, driven(20e3, 3 * PER_MM))
    before = appraise(PARAMS, driven(20e3, 3 * PER_MM), VEHICLE)
    wear_command(CONFIG, folder, None, "fl=8.4, fr=9.1")
    assert "8.42" in capsys.readouterr().out
    wear = stored(folder)
    assert wear["measurements"].tolist() == [1, 1, 0, 0]
    learned = driven(20e3, 3 * PER_MM)
    learned[0]["wear"] = wear
    after = appraise(PARAMS, learned, VEHICLE)
    assert after[0].scale > 1.1 > after[1].scale
    assert after[0].sigma < 0.4 * before[0].sigma
    assert after[2].sigma == before[2].sigma


def test_new_pads_are_new(tmp_path, capsys):
    folder = kept(tmp_path, driven(20e3, 3 * PER_MM))
    wear_command(CONFIG, folder, "front", None)
    wear = stored(folder)
    assert not wear["regressors"][:, :2].any()
    assert wear["regressors"][0, 2:].all()
    assert wear["fitted_at"].tolist() == [20e6, 20e6, 0.0, 0.0]
    assert "12.00" in capsys.readouterr().out


def test_wear_survives_a_configuration_that_changes(tmp_path, capsys):
    """Another friction of the same car, other wear coefficients: the same regressors, other millimetres."""
    folder = kept(tmp_path, driven(20e3, 3 * PER_MM))
    text = CONFIG.read_text().replace("mu_nominal = 0.45", "mu_nominal = 0.42")
    other = tmp_path / "other.toml"
    other.write_text(text.replace("coefficients = [0.1016", "coefficients = [0.2032", 1))
    wear_command(other, folder, None, None)
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[1] for line in lines[1:5]] == ["6.00", "6.00", "4.84", "4.84"]


REFUSED = {
    "a thickness that grew": ("fl=12.9", "fl=12.9: thicker than the 12 mm of a new pad"),
    "no thickness": ("fl=-1", "without the backplate"),
    "metres": ("fl=0.0098", "in mm, without the backplate"),
    "no corner": ("front=9", "corners fl, fr, rl, rr"),
    "no number": ("fl=nine", "give corner=mm"),
    "nothing": ("fl=nan", "give corner=mm"),
}


@pytest.mark.parametrize(("measured", "said"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_is_one_line_and_changes_nothing(tmp_path, measured, said):
    folder = kept(tmp_path, driven(20e3, 3 * PER_MM))
    with pytest.raises(UserError, match=said) as caught:
        wear_command(CONFIG, folder, None, measured)
    assert "\n" not in str(caught.value)
    assert not stored(folder)["measurements"].any()


def test_a_thickness_that_grew_since_the_last_measurement_is_refused(tmp_path):
    folder = kept(tmp_path, driven(20e3, 3 * PER_MM))
    wear_command(CONFIG, folder, None, "fl=9.0")
    with pytest.raises(UserError, match=r"thicker than the 9\.00 mm measured before"):
        wear_command(CONFIG, folder, None, "fl=9.5")


def test_other_arguments_that_are_wrong(tmp_path):
    with pytest.raises(UserError, match="choose front, rear, all, fl, fr, rl, rr"):
        wear_command(CONFIG, tmp_path, "left", None)
    with pytest.raises(UserError, match="no such folder"):
        wear_command(CONFIG, tmp_path / "none", None, None)
    folder = kept(tmp_path, driven(20e3, 1.0))
    with in_use(folder), pytest.raises(UserError, match="stop it first"):
        wear_command(CONFIG, folder, "front", None)
