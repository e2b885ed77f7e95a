"""An accelerometer that is late, or stands still: when it is left out, and what is no lateness."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from ecu.algorithm.monitoring.accel_blocks import ROLLED, A, F
from ecu.algorithm.monitoring.accel_timing import ACCEL_TIMING_STATE, watch_timing
from ecu.algorithm.monitoring.acceleration import ACCELERATION_STATE
from ecu.algorithm.monitoring.witness import WITNESS_STATE
from ecu.contract.signals import ACCEL_X, MOTOR_TORQUE

DT = 0.01
Series = Callable[[float], float]


def brakings(size: float = 4.0, rise: float = 0.3) -> Series:
    """Force over mass [m/s^2]: braked for 4 s of 8 s, from the second one on."""

    def force(t: float) -> float:
        inside = t % 8.0
        return -size * min(max((inside - 2.0) / rise, 0.0), 1.0) * min(max((6.0 - inside) / rise, 0.0), 1.0)

    return force


def modulated(t: float) -> float:
    return -3.0 + 2.0 * math.sin(2.0 * t)


def let_go(t: float) -> float:
    """Driven for 2 s of 8 s, rolling for 0.7 s, then braked."""
    inside = t % 8.0
    return 2.9 if inside < 2.0 else -min(max(6.0 * (inside - 2.7), 0.0), 4.0) if inside < 6.0 else 0.0


def counted(t: float) -> float:
    """The same, as the linings' torque counts: 0.2 s later."""
    return let_go(t) if let_go(t) > 0.0 or t % 8.0 > 2.9 else 0.0


class Sensor:
    """Accelerometer beside the torques of a car."""

    def __init__(self, feed) -> None:
        self.blocks, self.state = np.zeros(1, ACCELERATION_STATE)[0], np.zeros(1, ACCEL_TIMING_STATE)[0]
        self.witness, self.feed, self.inputs = np.zeros(1, WITNESS_STATE)[0], feed, feed()
        self.random, self.t, self.speed = np.random.default_rng(7), 0.0, 30.0

    def drive(
        self, seconds: float, force: Series, reading: Series, known: bool = True, frozen: bool = False
    ) -> float | None:
        """Drive on; return when the reading was rejected first."""
        found, sums, mean = None, np.zeros(4), self.blocks["mean"]
        for k in range(round(seconds / DT)):
            self.t += DT
            read = -2.0 if frozen else reading(self.t) + self.random.normal(0.0, 0.05)
            self.feed(self.inputs, accel_x=read)
            self.speed += DT * force(self.t)
            sums[A], sums[F], sums[ROLLED] = (
                sums[A] + read,
                sums[F] + force(self.t),
                sums[ROLLED] + self.speed,
            )
            self.blocks["time"] = (k + 1) % 10
            if self.blocks["time"] == 0.0:
                mean[1:] = mean[:-1].copy()
                mean[0], sums = 0.1 * sums, np.zeros(4)
                self.blocks["compared_blocks"] = self.blocks["compared_blocks"] + 1 if known else 0
            watch_timing(self.state, self.blocks, self.witness, self.inputs[0], DT)
            if self.witness["rejected"][ACCEL_X] and found is None:
                found = self.t
        return found


def late(force: Series, lag: float, scale: float = 1.0, zero: float = 0.0) -> Series:
    return lambda t: scale * force(t - lag) + zero


HARD, SOFT, WEAK = brakings(), brakings(rise=0.1), brakings(size=1.0)
CASES = [
    # what, force, reading; left out so long after the brakes came [s], None: never
    ("in time", HARD, late(HARD, 0.0), None),
    ("tyres and pitch take their time", HARD, late(HARD, 0.035), None),
    ("by 0.05", HARD, late(HARD, 0.05), None),
    ("by 0.1", HARD, late(HARD, 0.1), 1.2),
    ("by 0.2", HARD, late(HARD, 0.2), 1.2),
    ("by 0.2, at once", SOFT, late(SOFT, 0.2), 1.2),
    ("by 0.2, whose scale is wrong", HARD, late(HARD, 0.2, scale=0.6), 1.2),
    ("early, as it seems by pressures that are late", HARD, late(HARD, -0.2), None),
    ("linings rub less by a third", HARD, late(HARD, 0.0, scale=0.67), None),
    ("more", HARD, late(HARD, 0.0, scale=1.3), None),
    ("its zero is off", HARD, late(HARD, 0.0, zero=1.0), None),
    ("turned round", HARD, late(HARD, 0.2, scale=-1.0), None),
    ("little force", WEAK, late(WEAK, 0.2), None),
    ("in time, with brakes that do not count at once", counted, let_go, None),
    ("in time, with a foot that never rests", modulated, late(modulated, 0.0), None),
]


@pytest.mark.parametrize(("case", "force", "reading", "after"), CASES, ids=[case[0] for case in CASES])
def test_a_reading_is_late_where_it_follows_the_torques(feed, case, force, reading, after) -> None:
    sensor = Sensor(feed)
    found = sensor.drive(24.0, force, reading)
    greatest = sensor.witness["published"]["ratio"][ACCEL_X]
    print(found, greatest)
    assert (found is None) == (after is None) == (greatest < 1.0)
    assert found is None or 0.5 < found - 2.0 < after


def test_nothing_is_said_where_the_torques_are_not_known(feed) -> None:
    assert Sensor(feed).drive(24.0, HARD, late(HARD, 0.2), known=False) is None


@pytest.mark.parametrize("lag", [0.0, 0.2])
def test_motors_that_a_late_reading_has_accused_are_believed_again(feed, lag: float) -> None:
    sensor = Sensor(feed)
    sensor.witness["rejected"][MOTOR_TORQUE : MOTOR_TORQUE + 4] = 1
    sensor.drive(8.0, HARD, late(HARD, lag))
    assert sensor.witness["rejected"][MOTOR_TORQUE : MOTOR_TORQUE + 4].tolist() == [lag == 0.0] * 4


def test_it_is_used_again_when_it_is_in_time(feed) -> None:
    sensor = Sensor(feed)
    sensor.drive(16.0, HARD, late(HARD, 0.2))
    assert sensor.witness["rejected"][ACCEL_X]
    sensor.drive(8.0, HARD, late(HARD, 0.06))
    assert sensor.witness["rejected"][ACCEL_X]
    sensor.drive(8.0, HARD, late(HARD, 0.0))
    assert not sensor.witness["rejected"][ACCEL_X]


@pytest.mark.parametrize(("force", "found"), [(HARD, True), (lambda t: -1.0, False)])
def test_a_reading_that_stands_still_is_left_out_where_the_wheels_do_not(feed, force, found: bool) -> None:
    sensor = Sensor(feed)
    assert sensor.drive(1.9, force, force) is None
    after = sensor.drive(4.0, force, force, frozen=True)
    assert (after is not None) == found
    sensor.drive(0.1, force, force)
    assert not sensor.witness["rejected"][ACCEL_X]
