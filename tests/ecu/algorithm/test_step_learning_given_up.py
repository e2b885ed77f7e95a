"""The whole ECU: what was learned and misleads is forgotten, and a fault bit says so."""

import numpy as np
import pytest

from ecu.algorithm.estimation.joint.layout import LEVEL
from ecu.contract.faults import LEARNING_GIVEN_UP

from .test_step import Car, column

NOMINAL = 0.45
ROLLS, BRAKES = (0.0, 2.0), (60.0, 2.5)


class Brakings:
    """One car that brakes from 90 km/h again and again, with the friction that is given."""

    def __init__(self, params, feed) -> None:
        self.car = Car(params, feed, mu=NOMINAL)

    def brake(self, mu: float, believed: float | None = None) -> tuple[np.ndarray, np.ndarray, bool]:
        """Return friction before a braking, friction after it, and whether learning was given up.

        `believed`: what was learned, whatever the brake applications before have shown.
        """
        car = self.car
        car.mu, car.speed = mu, 25.0
        if believed is not None:
            car.state["joint"]["x"][0, LEVEL : LEVEL + 4] = np.log(believed / NOMINAL)
        before = [column(car.drive(ROLLS), f"mu_b_{c}")[-1] for c in ("fl", "rl")]
        car.drive(BRAKES)
        rows = car.drive((0.0, 1.0))
        reported = column(rows, "active_faults").astype(np.int64)[-1] & LEARNING_GIVEN_UP
        return (
            np.array(before),
            np.array([column(rows, f"mu_b_{c}")[-1] for c in ("fl", "rl")]),
            bool(reported),
        )


@pytest.mark.parametrize("mu", [0.36, 0.45, 0.54], ids=["smooth", "as configured", "rough"])
def test_linings_that_stay_what_they_are_are_learned_and_kept(params, feed, mu: float) -> None:
    brakings = Brakings(params, feed)
    for _ in range(10):
        before, _, reported = brakings.brake(mu)
        assert not reported
    assert before == pytest.approx([mu, mu], rel=0.05)
    book = brakings.car.state["prediction"][0]
    assert book["applications"] >= 6
    assert abs(book["error"][0]) < 0.05


@pytest.mark.parametrize("believed", [0.36, 0.54], ids=["too smooth", "too rough"])
def test_what_misleads_four_times_is_forgotten(params, feed, believed: float) -> None:
    brakings = Brakings(params, feed)
    for reported in (False, False, False, True):
        _, after, given_up = brakings.brake(NOMINAL, believed)
        assert given_up == reported
    assert after == pytest.approx([NOMINAL, NOMINAL], rel=0.01)
    assert np.all(brakings.car.state["learned"][0]["sigma_mu_b"] > 0.2 * NOMINAL)
    # It is learned anew, and predicts well.
    for _ in range(3):
        before, _, _ = brakings.brake(0.40)
    assert before == pytest.approx([0.40, 0.40], rel=0.05)
    assert abs(brakings.car.state["prediction"][0]["error"][0]) < 0.05


def test_the_bit_is_set_for_a_minute(params, feed) -> None:
    brakings = Brakings(params, feed)
    for _ in range(4):
        brakings.brake(NOMINAL, 0.36)
    faults = column(brakings.car.drive((0.0, 61.0)), "active_faults").astype(np.int64) & LEARNING_GIVEN_UP
    shown_before = 1.0  # s, at the end of the last braking
    assert np.flatnonzero(faults == 0)[0] * 0.01 == pytest.approx(60.0 - shown_before, abs=0.3)
