"""Principal components against their closed form in a full factorial, and the effect of the stop before."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from brakelab.identify.friction.analysis import history_effect, levels, principal_components
from brakelab.identify.friction.stops import Stops, some
from brakelab.identify.friction.tables import component_table, history_line


def factorial(stops: Stops, slopes: tuple[float, float, float], noise: float, before: float = 0.0) -> Stops:
    """Return 315 stops of made-up mean friction, linear in standardised inputs and the stop before."""
    random = np.random.default_rng(0)
    grid = np.array(list(product(np.arange(7.0), np.arange(5.0), np.arange(9.0))))
    order = random.permutation(len(grid))
    temperature, speed, pressure = grid[order].T
    ends = 100.0 + 200.0 * random.random(len(grid))
    scaled = [(c - c.mean()) / c.std() for c in (speed, pressure, temperature)]
    mean = 0.4 + 0.02 * sum(s * c for s, c in zip(slopes, scaled, strict=True))
    mean += 0.02 * noise * random.standard_normal(len(grid))
    mean[1:] *= 1.0 + before * (ends[:-1] - ends.mean()) / 100.0
    return replace(
        stops,
        start_speed=2.0 * speed + 8.0,
        held_pressure=1e6 * (pressure + 1.0),
        start_temperature=25.0 * temperature + 50.0,
        mean=mean,
        temperature=ends,
        first=np.arange(len(grid) + 1),
    )


def test_components_are_those_of_the_closed_form(stops: Stops) -> None:
    """Eigenvalues 1 + R, 1, 1, 1 - R; first loadings r_i / (R sqrt 2) and 1 / sqrt 2 (Table 3.2)."""
    found = principal_components(factorial(stops, (-0.1, 0.4, 0.6), 0.7))
    r = found.correlation
    total = float(np.sqrt(np.sum(r**2)))
    assert found.shares == pytest.approx(np.array([1.0 + total, 1.0, 1.0, 1.0 - total]) / 4.0, rel=1e-6)
    assert found.loadings[:, 0] == pytest.approx([*(r / (total * np.sqrt(2.0))), np.sqrt(0.5)], rel=1e-6)
    assert found.linear == pytest.approx(total**2)


def test_a_loading_is_no_share_of_variance(stops: Stops) -> None:
    """Table 3.2's 60 % for temperature would be 36 %: the print's own numbers, R = 4 V - 3 = 0.712."""
    found = principal_components(factorial(stops, (-0.0961, 0.3656, 0.5976), 0.70))
    loading, share = found.loadings[2, 0], found.correlation[2] ** 2
    assert loading == pytest.approx(0.598, abs=0.03)
    assert share == pytest.approx(0.36, abs=0.06)


def test_levels_explain_what_a_line_does_not(stops: Stops) -> None:
    made = factorial(stops, (0.0, 0.0, 0.0), 0.1)
    scaled = (made.start_temperature - 125.0) / 50.0
    found = principal_components(replace(made, mean=made.mean - 0.05 * scaled**2))
    assert found.correlation[2] ** 2 < 0.01
    assert found.any_form[2] > 0.95


@pytest.mark.parametrize("hotter", [0.0, 25.0], ids=["full factorial", "hotter at higher pressure"])
def test_what_inputs_that_go_together_explain_counts_once(stops: Stops, hotter: float) -> None:
    made = factorial(stops, (-0.1, 0.4, 0.6), 0.7)
    heated = made.start_temperature + hotter * (made.held_pressure / 1e6 - 1.0)
    found = principal_components(replace(made, start_temperature=heated))
    table = component_table(found)
    overlap = found.any_form.sum() - found.together
    assert overlap == pytest.approx(0.0, abs=1e-9) if hotter == 0.0 else overlap > 0.1
    assert found.any_form.max() < found.together < 1.0
    assert table.rows[-1][-1] == f"{100 * found.together:.1f}"
    assert ("their shares overlap" in table.below) == (hotter > 0.0)


def test_levels_are_separated_wherever_they_lie() -> None:
    """Speeds about 13.5 m/s, where rounding would make two of them."""
    random = np.random.default_rng(0)
    speed, bar, temperature = np.array(list(product((6.7, 13.5, 14.6), (10.0, 20.0), (50.0, 75.0)))).T
    noise = 0.02 * random.standard_normal(len(speed))
    found = levels(np.stack([speed + noise, 1e5 * (bar + noise), temperature + 50.0 * noise], axis=1))
    assert found.tolist() == [list(place) for place in product(range(3), range(2), range(2))]


@pytest.mark.parametrize("effect", [0.0, 0.03])
def test_the_stop_before_is_found(stops: Stops, effect: float) -> None:
    found = history_effect(factorial(stops, (0.1, 0.4, 0.6), 0.2, effect))
    assert abs(found.slope - effect) < found.half < 0.005


def test_twelve_stops_are_too_few_for_what_the_one_before_does(stops: Stops) -> None:
    found = history_effect(some(stops, np.arange(12)))
    assert np.isnan(found.slope)
    assert history_line(found) == "Too few stops to tell what the stop before does to friction."
