"""The fit of discs whose numbers are known; what a drive cannot tell; how sure it is."""

import numpy as np
import pytest

from brakelab.identify.thermal.fit import (
    BY_SPEED,
    BY_SPEED_WET,
    HEATING,
    STILL,
    STILL_WET,
    autocorrelation_rows,
    fit_axle,
    fit_nothing,
)
from brakelab.identify.thermal.model import Cooling

from .series import TRUE, XI, discs, series

pytestmark = pytest.mark.study

START_XI = 1.7e-4
START = Cooling(1.3e-3, 1.4e-4, 1.3e-3, 2.1e-4)


def in_sigmas(fit) -> np.ndarray:
    found = np.log([fit.heating, *fit.cooling])
    return (found - np.log([XI, *TRUE])) / fit.sigma[:5]


def test_a_dry_and_a_wet_drive_give_all_five_numbers() -> None:
    fit = fit_axle(discs(series(), series(seed=2, rain=True)), START_XI, START)
    assert fit.identified.all()
    assert fit.rank == 6
    assert fit.heating == pytest.approx(XI, rel=0.01)
    assert np.array(fit.cooling) == pytest.approx(np.array(TRUE), rel=0.05)
    assert fit.lag == pytest.approx(2.0, abs=0.5)
    assert fit.starts == pytest.approx(30.0, abs=2.0)
    assert np.abs(in_sigmas(fit)).max() < 3.0


@pytest.mark.parametrize(
    ("drive", "identified", "left"),
    [
        ({}, [HEATING, STILL, BY_SPEED], [STILL_WET, BY_SPEED_WET]),
        ({"rain": True}, [HEATING, STILL_WET, BY_SPEED_WET], [STILL, BY_SPEED]),
        ({"speed": 30.0, "drift": 2.0}, [HEATING, BY_SPEED], [STILL]),  # one speed: one rate
        ({"speed": 0.0}, [STILL], [HEATING, BY_SPEED]),  # cools in the garage
    ],
    ids=["dry", "rain", "one speed", "at rest"],
)
def test_what_a_drive_cannot_identify_stays_as_configured(drive, identified, left) -> None:
    fit = fit_axle(discs(series(**drive)), START_XI, START)
    assert fit.identified[identified].all()
    assert not fit.identified[left].any()
    if STILL_WET in left:  # follows the dry one
        assert fit.cooling.still_wet / fit.cooling.still == pytest.approx(START.still_wet / START.still)


def test_a_rate_is_known_better_than_its_parts() -> None:
    fit = fit_axle(discs(series(speed=30.0)), START_XI, START)
    assert fit.sigma[STILL] > 0.3
    assert fit.stated[1] < 0.05
    assert np.isnan(fit.stated[2])
    assert fit.cooling.still + 30.0 * fit.cooling.by_speed == pytest.approx(1.8e-3 + 30.0 * 1e-4, rel=0.05)


def test_readings_that_jump_are_left_aside() -> None:
    clean = series()
    dirty = series()
    random = np.random.default_rng(5)
    dirty.measured[random.random(len(dirty.speed)) < 0.05, :2] = 900.0
    good, found = (fit_axle(discs(one), START_XI, START) for one in (clean, dirty))
    assert found.heating == pytest.approx(good.heating, rel=0.02)
    assert found.cooling.by_speed == pytest.approx(good.cooling.by_speed, rel=0.05)


def test_a_sensor_that_is_off_moves_xi_by_no_more_than_its_sigma() -> None:
    off = series()
    off.measured[:, :2] += 3.0
    fit = fit_axle(discs(off), START_XI, START)
    assert np.abs(in_sigmas(fit)[[HEATING, STILL, BY_SPEED]]).max() < 2.5


def test_what_the_lump_leaves_over_is_not_taken_for_noise() -> None:
    """Errors that last 200 s and are common to both discs: 12 drives, two sigma of each number."""
    off = np.array(
        [in_sigmas(fit_axle(discs(series(2400, seed, drift=3.0)), START_XI, START))[:3] for seed in range(12)]
    )
    rms, inside = np.sqrt(np.mean(off**2, axis=0)), np.mean(np.abs(off) < 2.0)
    print(f"error over sigma: {np.round(rms, 2)}, inside 2 sigma {100 * inside:.0f} %")
    assert rms.max() < 1.5
    assert inside > 0.85


def test_autocorrelation_time_of_a_known_process() -> None:
    random = np.random.default_rng(3)
    x = np.zeros(200_000)
    for k in range(1, len(x)):
        x[k] = 0.98 * x[k - 1] + random.standard_normal()
    assert autocorrelation_rows(x) == pytest.approx(1.98 / 0.02, rel=0.2)
    assert autocorrelation_rows(random.standard_normal(5000)) == pytest.approx(1.0, abs=0.2)


def test_the_configuration_as_a_fit_keeps_its_numbers() -> None:
    both = discs(series())
    fit = fit_axle(both, START_XI, START)
    before = fit_nothing(both, START_XI, START, fit)
    assert (before.heating, before.cooling) == (START_XI, START)
    assert before.starts.shape == (2,)
