"""Tyre curves: slope at the origin, place and height of the peak, what sliding leaves; a braked wheel."""

import numpy as np
import pytest

from .tyre import BRUSH, DUGOFF, EXPONENTIAL, Tyre, braking_force, curve, greatest, grip_left, spin

LOAD = 3000.0


def tyre(kind: int, shape: float = 1.0, fall: float = 0.2) -> Tyre:
    return Tyre(kind, 25.0, shape, fall, greatest(kind, shape, fall), 0.1, LOAD)


@pytest.mark.parametrize("fall", [0.08, 0.3])
@pytest.mark.parametrize(
    ("kind", "shape", "peak"),
    [
        (BRUSH, 1.0, 3.0),
        (EXPONENTIAL, 0.6, np.exp(1 / 0.6)),
        (EXPONENTIAL, 1.5, np.exp(1 / 1.5)),
        (DUGOFF, 1.0, None),
    ],
)
def test_a_curve_rises_with_slope_1_to_1_and_falls(
    kind: int, shape: float, peak: float | None, fall: float
) -> None:
    one = tyre(kind, shape, fall)
    x = np.arange(0.001, 200.0, 0.001)
    g = np.array([curve(one, float(value)) for value in x])
    # within 1 % of the slope: friction of the Dugoff curve falls from the first sliding on
    assert g[0] / x[0] == pytest.approx(1.0, rel=0.01)
    assert g.max() == pytest.approx(1.0, abs=1e-4)
    if peak is not None:
        assert x[g.argmax()] == pytest.approx(peak, rel=0.02)
    assert g[-1] == pytest.approx((1.0 - fall) / one.top, abs=0.01)
    assert np.all(np.diff(g[: g.argmax()]) > -1e-12)
    assert np.max(np.abs(np.diff(g))) < 0.0011
    beyond = g[g.argmax() :]
    assert np.all(beyond - np.minimum.accumulate(beyond) < 0.005)


def test_grip_falls_with_load_and_is_shared_with_cornering() -> None:
    one = tyre(BRUSH)
    assert grip_left(one, LOAD, 1.2, 0.0) == pytest.approx(1.2)
    assert grip_left(one, 2 * LOAD, 1.2, 0.0) == pytest.approx(1.2 * 2**-0.1)
    assert grip_left(one, LOAD, 1.0, 0.6) == pytest.approx(0.8)
    assert braking_force(one, -0.02, LOAD, 1.2) == -braking_force(one, 0.02, LOAD, 1.2)


@pytest.mark.parametrize(("torque", "locks"), [(600.0, False), (1000.0, False), (1200.0, True)])
def test_a_braked_wheel_settles_below_the_peak_and_locks_beyond_it(torque: float, locks: bool) -> None:
    """Peak 1.2 x 3000 N at 0.3 m: 1080 N m; locked, what sliding leaves of it."""
    one, omega, speed = tyre(BRUSH), 100.0, 30.0
    for _ in range(2000):
        omega, force = spin(one, omega, speed, torque, 1.2, 0.3, LOAD, 1.2, 0.0025)
    assert (omega == 0.0) == locks
    expected = braking_force(one, 1.0, LOAD, 1.2) if locks else torque / 0.3
    assert force == pytest.approx(expected, rel=1e-6)
