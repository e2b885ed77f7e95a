"""Road and meant speed against closed forms."""

import numpy as np
import pytest

from .roads import count_brakings
from .route import G, Straight, drive_route, lay, meant_speed

N = 400


def meant(**changes: object) -> np.ndarray:
    """Meant speed on a level straight of 400 m at grip 1 whose last 50 m have a radius of 50 m."""
    given = {
        "curvature": np.where(np.arange(N) < N - 50, 0.0, 0.02),
        "grip": np.ones(N),
        "limit": np.full(N, 90.0),
        "stop": np.zeros(N),
        "decel": np.full(N, 4.0),
        "lateral": 30.0,
        "lift": 0.0,
        "daring": np.ones(N),
    }
    return meant_speed(**(given | changes))


def test_a_corner_is_taken_with_what_grip_holds_and_approached_with_what_is_dared() -> None:
    speed = meant()
    assert speed[-1] ** 2 == pytest.approx(G * 50.0)
    assert speed[N - 51] == pytest.approx(speed[-1], rel=0.1)
    assert np.diff(speed[:300] ** 2) == pytest.approx(np.full(299, -8.0))


def test_downforce_makes_corners_faster() -> None:
    """v^2 / R = mu (g + lift v^2)."""
    speed = meant(lift=0.001)
    assert speed[-1] ** 2 == pytest.approx(G / (0.02 - 0.001))


def test_braking_and_turning_share_the_grip() -> None:
    """At 20 m/s half of the grip for turning leaves sqrt(3)/2 of it for braking."""
    limit = np.full(N, 90.0)
    limit[-1] = 20.0
    speed = meant(curvature=np.full(N, 0.5 * G / 400.0), limit=limit, decel=np.full(N, 99.0))
    assert speed[-1] == pytest.approx(20.0)
    assert speed[-2] ** 2 - speed[-1] ** 2 == pytest.approx(2.0 * G * np.sqrt(0.75))


def test_a_driver_may_turn_less_than_the_road_holds() -> None:
    assert meant(lateral=2.0)[-1] ** 2 == pytest.approx(2.0 * 50.0)


def test_a_stop_is_approached_to_rest() -> None:
    stop = np.zeros(N)
    stop[200] = 10.0
    speed = meant(stop=stop)
    assert speed[200] == 0.0
    assert speed[150] ** 2 == pytest.approx(2.0 * 4.0 * 50.0)


def test_a_drive_repeats_its_lap_and_has_a_braking_for_each_corner() -> None:
    rng = np.random.default_rng(3)
    lap = lay(
        [Straight(300.0, 90.0, 40.0, 1.5, 0.0, True), Straight(200.0, 90.0, 30.0, -2.0, 0.0, False)],
        0.02,
        rng,
    )
    shape = (3, 2)
    taps = np.zeros(shape)
    taps[1, 0] = 8.0
    route = drive_route(lap, 3, np.ones(shape), np.full(shape, 6.0), np.ones(shape), 30.0, 0.0, 5.0, taps)
    n = len(lap.curvature)
    assert len(route.speed) == 3 * n
    np.testing.assert_array_equal(route.curvature[:n], route.curvature[n : 2 * n])
    assert count_brakings(route) == 6
    assert set(np.flatnonzero(route.tap) // n) == {1}
    assert np.max(np.abs(route.headwind)) == pytest.approx(5.0, rel=1e-3)
    # an arc of 1.5 to the left, one of 2.0 to the right
    assert np.sum(lap.curvature) == pytest.approx(1.5 - 2.0, abs=0.1)
    assert np.sqrt(np.mean(lap.grade**2)) == pytest.approx(0.02, rel=0.3)
