"""Terms found in stops: ILVO's in ILVO's, none that is not there, and the model's own arithmetic."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.discovery import (
    ILVO,
    LEVELS,
    NAMES,
    Library,
    _blocks,
    greedy,
    library,
    shoot,
    sparse,
)
from brakelab.identify.friction.recording import Recording
from brakelab.identify.friction.stops import Stops, find_stops
from brakelab.plant.friction.law import KELVIN
from brakelab.plant.linings import Lining, rig_with

pytestmark = pytest.mark.study

R1 = {"κ: 1": 0.2687, "κ: T": 0.3075e-3, "α': p v μ": -24.1e-9, "α': |ω'|": 2.302e-2, "α': p T": -1.226e-10}
DRAWS = 3


@pytest.fixture(scope="module")
def r1_stops(lining: Lining, ilvo_recording: Callable[[float, int], Recording]) -> Callable[..., Stops]:
    rig = rig_with(lining, "R1")[0]
    columns = Columns.own(lining, float(rig["mass"] * rig["tyre_radius"] ** 2))
    return lambda draw: find_stops(ilvo_recording(0.01, draw), columns, "R1")


def expected(of: Library, lining: Lining) -> np.ndarray:
    """Return R1's numbers on the scale of the library: stress on the pad, |omega'| as gain p mu."""
    stress = lining.brake.piston_area / lining.brake.pad_area
    mass = of.stops.inertia / lining.brake.tyre_radius**2
    si = np.array(list(R1.values())) * (1.0, 1.0, stress, lining.brake.gain(mass), stress)
    return si / of.scale[list(ILVO)]


def test_ilvo_s_terms_are_found_in_ilvo_s_stops(r1_stops: Callable[[int], Stops], lining: Lining) -> None:
    """1 % noise; 20 draws of each brake: `brake-ecu bench lab`."""
    for draw in range(DRAWS):
        of = library(r1_stops(draw))
        found = sparse(of)
        assert found.terms == ILVO, found.names()
        assert found.coefficients == pytest.approx(expected(of, lining), rel=0.02)
        assert found.error == pytest.approx(1.0 / np.sqrt(10.0), abs=0.02)


def test_shooting_explains_all_but_the_noise(r1_stops: Callable[[int], Stops]) -> None:
    """In these terms or in what is the same: p mu is p kappa alpha, p alpha and p T alpha."""
    found = greedy(library(r1_stops(0)))
    print(found.names(), found.error)
    assert found.error == pytest.approx(1.0 / np.sqrt(10.0), abs=0.02)
    assert len(found.terms) <= len(ILVO) + 2


@pytest.mark.parametrize("search", [sparse, greedy])
def test_where_friction_is_constant_nothing_is_found(
    r1_stops: Callable[[int], Stops], search: Callable[[Library], object]
) -> None:
    stops = r1_stops(0)
    noise = 0.004 * np.random.default_rng(1).standard_normal(len(stops.mu))
    found = search(library(replace(stops, mu=0.4 + noise)))
    assert found.names() == ["κ: 1"]  # type: ignore[attr-defined]
    assert found.coefficients == pytest.approx([0.4], abs=1e-3)  # type: ignore[attr-defined]


def test_on_a_pad_that_is_no_law_the_terms_explain_more_than_a_constant(stops: Stops) -> None:
    found = sparse(library(stops))
    print(found.names(), found.error)
    assert found.error < 0.6 * 100.0 * np.std(stops.mu) / stops.mu.mean()


def test_shooting_is_the_closed_form(r1_stops: Callable[[int], Stops]) -> None:
    """alpha' = -w alpha with one rate term: alpha = exp(-w t); kappa straight in T."""
    of = library(r1_stops(0))
    place = NAMES.index("α': α")
    weights = np.zeros(len(NAMES))
    weights[0], weights[1] = 0.3 * of.levels[0, 0] ** -1, 1e-4 / of.scale[1]
    weights[place] = -0.2 / of.scale[place]
    mu = np.empty_like(of.stops.pressure)
    shoot(of.levels, of.rates, of.kinds, weights, of.stops.first, of.stops.dt, mu)
    begin, end = of.stops.first[:2]
    t = of.stops.dt * np.arange(end - begin)
    heat = of.stops.temperature[begin:end] + KELVIN
    assert mu[begin:end] == pytest.approx((0.3 + 1e-4 * heat) * np.exp(-0.2 * t), rel=1e-5)


def test_terms_are_normalised(r1_stops: Callable[[int], Stops]) -> None:
    of = library(r1_stops(0))
    assert np.mean(of.levels**2, axis=0) == pytest.approx(np.ones(LEVELS))
    assert np.mean(of.integrals**2, axis=0) == pytest.approx(np.ones(len(NAMES) - LEVELS))
    assert _blocks(of.levels[:, 1], of.stops) == pytest.approx(of.level_blocks[:, 1])
