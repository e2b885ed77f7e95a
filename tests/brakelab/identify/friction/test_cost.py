"""The cost over two numbers: searches end in its valley, known surfaces are judged rightly."""

from collections.abc import Callable

import numpy as np
import pytest

from brakelab.identify.friction.candidates import candidates
from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.cost import convex_share, cost_over, distinct
from brakelab.identify.friction.fit import fit
from brakelab.identify.friction.profile import profile_interval, profile_over
from brakelab.identify.friction.recording import Recording
from brakelab.identify.friction.stops import find_stops
from brakelab.plant.linings import Lining

pytestmark = pytest.mark.study

GRID = np.meshgrid(np.linspace(-1.0, 1.0, 21), np.linspace(-1.0, 1.0, 21))


@pytest.mark.parametrize(
    ("surface", "convex"),
    [
        (lambda x, y: x**2 + 3.0 * y**2 + x * y, 1.0),
        (lambda x, y: (x**2 - 0.25) ** 2 + y**2, 0.68),
        (lambda x, y: 1.0 - np.exp(-4.0 * (x**2 + y**2)), 0.12),
    ],
    ids=["a bowl", "two valleys", "one valley in a plain"],
)
def test_known_surfaces(surface: Callable[..., np.ndarray], convex: float) -> None:
    """Two valleys: 12 x^2 > 1, so |x| > 0.29; the plain: r < 1 / sqrt 8 of [-0.9, 0.9]^2."""
    assert convex_share(surface(*GRID)) == pytest.approx(convex, abs=0.06)


def test_ends_that_lie_apart_are_counted() -> None:
    assert distinct(np.array([[0.5, 0.5], [0.505, 0.495], [0.5, 0.52], [0.9, 0.5], [0.9, 0.501]])) == 3


def test_both_searches_of_ilvo_end_in_one_valley(
    lining: Lining, columns: Columns, ilvo_recording: Callable[[float, int], Recording]
) -> None:
    """Figure C.1; least squares needs fewer evaluations (C.1), and the profile agrees with the interval."""
    stops = find_stops(ilvo_recording(0.01, 0), columns, "R1")
    candidate = next(c for c in candidates(stops, lining.brake) if c.name == "ilvo")
    fitted = fit(candidate, lining.brake, stops, 0)
    found = cost_over(fitted, lining.brake, stops, (3, 4), (0.05, 0.02))
    for path in (found.least_squares, found.simplex):
        assert path.points[-1] == pytest.approx(np.array(found.best), abs=2e-3)
        assert path.cost < found.nrmse.min() + 0.01
    assert found.valleys == 1
    assert found.least_squares.evaluations < found.simplex.evaluations
    profile = profile_over(fitted, lining.brake, stops, 3, 5)
    assert profile.rise[2] == pytest.approx(0.0, abs=1e-3)
    interval = profile_interval(fitted, lining.brake, stops, 3)
    assert profile.values[1] == pytest.approx(interval.low, rel=2e-3)
    assert np.all(np.diff(profile.rise[2:]) > 0.0)
