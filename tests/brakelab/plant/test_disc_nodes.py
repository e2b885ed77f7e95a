"""The disc of two nodes beside scipy's integration, its energy balance, and how far a lump is from it."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from brakelab.plant.disc_nodes import DiscNodes, heat_discs, nodes_like, rates, wind

DISC = DiscNodes(4500.0, 0.17, 25.0, 0.94, 6.0, 9.0, 0.03, 9.0)
POWER = np.where(np.arange(300)[:, None] % 60 < 6, 40e3, 0.0)
SPEED = np.repeat([0.0, 15.0, 35.0], 100)


@pytest.mark.parametrize("wetness", [0.0, 1.0])
def test_temperature_is_that_of_an_integrated_balance(wetness) -> None:
    found = heat_discs(DISC, POWER, SPEED, 15.0, np.full(300, wetness), 40.0, 1.0)

    def slope(t, x):
        row = min(int(t), 299)
        warm, hat = rates(DISC, x[:1], x[1:], POWER[row], SPEED[row], 15.0, wetness)
        return [warm[0], hat[0]]

    exact = solve_ivp(slope, (0.0, 300.0), [40.0, 40.0], t_eval=np.arange(1.0, 300.5), max_step=0.2)
    assert found[:, 0] == pytest.approx(exact.y[0], abs=0.5)
    assert found.max() > 80.0


def test_heat_is_stored_where_nothing_cools() -> None:
    tight = DISC._replace(still=0.0, by_air=0.0, area=0.0)
    found = heat_discs(tight, POWER, SPEED, 15.0, np.zeros(300), 15.0, 1.0)
    rest = heat_discs(tight, 0.0 * POWER, SPEED, 15.0, np.zeros(300), float(found[-1, 0]), 1.0)
    assert rest == pytest.approx(found[-1, 0])
    late = heat_discs(
        tight, np.vstack([POWER, np.zeros((900, 1))]), np.zeros(1200), 15.0, np.zeros(1200), 15.0, 1.0
    )
    rise = late[-1, 0] - 15.0
    ring, hat = tight.capacity * (1 - tight.hat), tight.capacity * tight.hat
    stored = ring * (rise + 0.5 * 6e-4 * ((rise - 5.0) ** 2 - 25.0)) + hat * rise
    assert stored == pytest.approx(0.94 * POWER.sum(), rel=0.01)


@pytest.mark.parametrize(("speed", "wetness"), [(0.0, 0.0), (10.0, 0.0), (30.0, 0.0), (30.0, 1.0)])
def test_air_and_rain_cool_the_more_the_faster(speed, wetness) -> None:
    def after(pace, wet):
        disc = heat_discs(DISC, np.zeros((120, 1)), np.full(120, pace), 15.0, np.full(120, wet), 300.0, 1.0)
        return float(disc[-1, 0])

    assert after(speed + 10.0, wetness) < after(speed, wetness) < 300.0
    if wetness:
        assert after(speed, wetness) < after(speed, 0.0)


def test_a_disc_as_cold_as_the_air_stays_so() -> None:
    found = heat_discs(DISC, 0.0 * POWER, SPEED, 15.0, np.ones(300), 15.0, 1.0)
    assert found == pytest.approx(15.0)


def test_the_discs_of_a_series_differ_from_their_lump() -> None:
    drawn = [nodes_like(2.1e-4, 1.8e-3, 9e-5, np.random.default_rng(seed)) for seed in range(20)]
    assert np.ptp([disc.hat for disc in drawn]) > 0.05
    assert all(disc.share / disc.capacity == pytest.approx(2.1e-4) for disc in drawn)


def test_the_wind_turns_and_has_its_deviation() -> None:
    found = wind(40_000, 1.0, 3.0, np.random.default_rng(1))
    assert found.std() == pytest.approx(3.0, rel=0.15)
    assert abs(found.mean()) < 1.0
