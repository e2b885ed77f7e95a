"""A line by a Kalman filter: known at the decelerations at which it was seen, and nowhere else."""

import numpy as np
import pytest

from ecu.algorithm.monitoring.error_line import LINE_STATE, correct_line, lesser, sigma_line

NOISE = 0.2


@pytest.mark.parametrize(
    ("seen", "known", "unknown"),
    [((4.0,), 4.0, 0.0), ((0.0,), 0.0, 4.0), ((0.0, 4.0), 2.0, 12.0), ((-4.0, 4.0), 0.0, -12.0)],
)
def test_a_line_is_known_where_it_was_seen(seen, known: float, unknown: float) -> None:
    line, random = np.zeros(1, LINE_STATE)[0]["now"], np.random.default_rng(3)
    line["p"][:2] = 0.5**2, 0.05**2
    for k in range(200):
        h = seen[k % len(seen)]
        y = 0.3 - 0.02 * h + random.normal(0.0, NOISE)
        correct_line(line, h, y - line["offset"] - line["scale"] * h, NOISE)
    for h, least, most in ((known, 0.0, 0.02), (unknown, 0.03, 0.5)):
        sigma = sigma_line(line, h)
        print(h, sigma)
        assert least < sigma < most
        assert abs(line["offset"] + line["scale"] * h - (0.3 - 0.02 * h)) < 3.0 * sigma


@pytest.mark.parametrize(
    ("one", "other", "shown"),
    [(0.1, 0.3, 0.1), (0.3, 0.1, 0.1), (-0.3, -0.1, -0.1), (0.1, -0.3, 0.0), (0.0, 0.3, 0.0)],
)
def test_what_two_show_is_the_lesser_of_both(one: float, other: float, shown: float) -> None:
    assert lesser(one, other) == shown
