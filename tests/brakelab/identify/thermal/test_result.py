"""The band beside a finite difference, and the keys that a fit becomes."""

from pathlib import Path

import numpy as np
import pytest

from brakelab.identify.thermal.fit import fit_axle, fit_nothing
from brakelab.identify.thermal.model import Cooling
from brakelab.identify.thermal.result import (
    AIR_FLOW,
    HEAT_CAPACITY,
    Errors,
    errors_of,
    judge,
    predict,
    section_of,
    start_of,
)
from ecu.settings.config import load_config

from .series import TRUE, XI, discs, series

FRONT = load_config(Path(__file__).parents[4] / "config" / "suv.toml").front


@pytest.fixture(scope="module")
def dry():
    return discs(series())


@pytest.fixture(scope="module")
def fit(dry):
    return fit_axle(dry, FRONT.disc_heating, start_of(FRONT))


@pytest.mark.parametrize(
    ("errors", "heating", "cooling"),
    [(Errors(0.1, 1e-9, 1e-9), 1.001, 1.0), (Errors(1e-9, 0.1, 0.1), 1.0, 1.001)],
)
def test_the_band_is_what_a_wrong_parameter_does(dry, errors, heating, cooling) -> None:
    disc, none = dry[0], np.zeros(len(dry[0].series.speed))
    plain, sigma = predict(disc, XI, TRUE, errors, none, 0.01, 20.0)
    other = Cooling(*(cooling * value for value in TRUE))
    moved, _ = predict(disc, heating * XI, other, errors, none, 0.01, 20.0)
    expected = np.hypot(0.1 * np.abs(moved - plain) / 0.001, 1.5)
    assert sigma[100:] == pytest.approx(expected[100:], rel=0.02)


def test_unsure_friction_widens_the_band(dry) -> None:
    disc = dry[0]
    none = np.zeros(len(disc.series.speed))
    _, sure = predict(disc, XI, TRUE, Errors(0.04, 0.08, 0.2), none, 2.0, 0.0)
    _, unsure = predict(disc, XI, TRUE, Errors(0.04, 0.08, 0.2), none + 0.1, 2.0, 0.0)
    assert (unsure[100:] > 1.1 * sure[100:]).all()


def test_the_fit_is_nearer_than_the_configuration(dry, fit) -> None:
    start = start_of(FRONT)
    before = fit_nothing(dry, FRONT.disc_heating, start, fit)
    friction = np.zeros(len(dry[0].series.speed))
    prediction = judge(dry[0], friction, fit, 0, errors_of(fit, FRONT), before)
    assert prediction.after < 0.6 < 0.8 < prediction.before
    assert prediction.inside > 0.95


def test_a_dry_fit_gives_dry_keys_and_what_follows_from_them(fit) -> None:
    keys = section_of(fit, FRONT, errors_of(fit, FRONT), "a.csv")
    assert list(keys) == [
        "disc_heating",
        "disc_cooling",
        "disc_cooling_by_speed",
        "sigma_disc_heating",
        "sigma_disc_cooling",
    ]
    assert float(keys["disc_heating"][0]) == pytest.approx(XI, rel=0.02)
    assert "±" in keys["disc_heating"][1]
    assert "a.csv" in keys["disc_heating"][1]


def test_no_error_is_below_what_one_drive_cannot_know(fit) -> None:
    errors = errors_of(fit, FRONT)
    assert errors.heating >= HEAT_CAPACITY
    assert errors.cooling >= AIR_FLOW
    assert errors.wet == FRONT.sigma_disc_cooling_wet


def test_a_wet_cooling_that_is_configured_goes_along_with_the_dry_one(dry) -> None:
    axle = FRONT.model_copy(update={"disc_cooling_wet": 2.0 * FRONT.disc_cooling})
    fit = fit_axle(dry, axle.disc_heating, start_of(axle))
    keys = section_of(fit, axle, errors_of(fit, axle), "")
    assert float(keys["disc_cooling_wet"][0]) == pytest.approx(2.0 * fit.cooling.still, rel=1e-3)
