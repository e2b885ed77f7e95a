"""A brake that gives nothing: which evidence makes it one."""

from typing import Any

import numpy as np
import pytest

from ecu.algorithm.control.pressure_law import PRESSURE_LAW_STATE
from ecu.algorithm.estimate import ESTIMATE
from ecu.algorithm.monitoring.failed_brakes import FAILED_BRAKES_STATE, watch_brakes

G, DT = 9.81, 0.01
FL, FR, RL, RR = range(4)
MU = 0.4


class Watched:
    """A car at 20 m/s whose linings have the friction that the law counts on, or `rough` times that."""

    def __init__(self, params, feed, rough: float = 1.0) -> None:
        self.params, self.feed, self.rough = params[0], feed, rough
        self.state = np.zeros(1, FAILED_BRAKES_STATE)[0]
        self.state["scale"] = 1.0
        self.law = np.zeros(1, PRESSURE_LAW_STATE)[0]
        self.law["base"] = MU

    def force(self, pressure: Any) -> float:
        """Return the braking force [N] of pressures [bar] by (A.19), written out."""
        p, total = self.params, 0.0
        for i in range(4):
            acts = max(pressure[i] * 1e5 - p["push_out_pressure"][i], 0.0)
            torque = 2 * acts * p["piston_area"][i] * self.rough * MU * p["effective_radius"][i]
            total += torque / p["wheel_radius"][i]
        return total

    def run(self, seconds, demand, true, read, sent=True, **other) -> list[int]:
        """Brake: pressures demanded, true and read [bar]; return which brakes are held for failed."""
        p = self.params
        estimate = np.zeros(1, ESTIMATE)[0]
        estimate["measured"] = other.pop("measured", 1)
        motor = np.array(other.get("motor_torque", np.zeros(4)))
        braked = self.force(true) + (motor / p["wheel_radius"]).sum()
        estimate["tyre_force"] = -(braked + p["rolling_resistance"] * p["mass"] * G)
        inputs = self.feed(calliper_pressure=np.array(read, float), **other)[0]
        for _ in range(round(seconds / DT)):
            watch_brakes(
                p, self.state, inputs, estimate, self.law, np.array(demand, float), np.zeros(4), sent, DT
            )
        return np.flatnonzero(self.state["failed"]).tolist()


ALL = (40.0, 40.0, 45.0, 45.0)


def without(*dead: int, left: float = 0.0) -> tuple[float, ...]:
    return tuple(left if i in dead else ALL[i] for i in range(4))


VERDICTS = [
    # case, friction over the law's, true, read, other, failed
    ("all follow", 1.0, ALL, ALL, {}, []),
    ("front left dead", 1.0, without(FL), without(FL), {}, [FL]),
    ("rear right dead", 1.0, without(RR), without(RR), {}, [RR]),
    ("a fifth of the pressure is left", 1.0, without(FL, left=8.0), without(FL, left=8.0), {}, [FL]),
    ("front circuit", 1.0, without(FL, FR), without(FL, FR), {}, [FL, FR]),
    ("diagonal circuit", 1.0, without(FL, RR), without(FL, RR), {}, [FL, RR]),
    ("nothing brakes", 1.0, without(FL, FR, RL, RR), without(FL, FR, RL, RR), {}, [FL, FR, RL, RR]),
    ("dead, linings 15 % rougher than known", 1.15, without(FL), without(FL), {}, [FL]),
    ("rear dead, linings 15 % rougher", 1.15, without(RL), without(RL), {}, [RL]),
    ("the sensor reads nothing, the brake is there", 1.0, ALL, without(FL), {}, []),
    ("the same, linings 10 % smoother", 0.9, ALL, without(FL), {}, []),
    ("a pressure 40 % short", 1.0, without(FL, left=24.0), without(FL, left=24.0), {}, []),
    ("motors brake beside", 1.0, without(FL), without(FL), {"motor_torque": np.full(4, 300.0)}, [FL]),
    ("demands not valid: a shadow", 1.0, without(FL), without(FL), {"sent": False}, []),
    ("an ABS works", 1.0, without(FL), without(FL), {"abs_active": 1.0}, []),
    ("no accelerometer", 1.0, without(FL), without(FL), {"measured": 0}, []),
    ("hardly any pressure asked for", 1.0, (0, 0, 0, 0), (0, 0, 0, 0), {"demand": (7, 7, 7, 7)}, []),
]


@pytest.mark.parametrize(
    ("case", "rough", "true", "read", "other", "failed"), VERDICTS, ids=[row[0] for row in VERDICTS]
)
def test_a_brake_has_failed_where_pressure_and_force_are_missing(
    params, feed, case, rough, true, read, other, failed
) -> None:
    car = Watched(params, feed, rough)
    asked = other.get("demand", ALL)
    other = {name: value for name, value in other.items() if name != "demand"}
    motors = {name: other[name] for name in other if name == "motor_torque"}
    assert car.run(1.0, asked, asked, asked, **motors) == [], "sound before"
    assert car.run(0.2, asked, true, read, **other) == failed, case


def test_a_brake_that_comes_back_is_used_again(params, feed) -> None:
    car = Watched(params, feed)
    car.run(1.0, ALL, ALL, ALL)
    assert car.run(0.2, ALL, without(FL), without(FL)) == [FL]
    assert car.run(0.05, ALL, ALL, ALL) == []


def test_a_dead_brake_stays_one_into_the_next_braking_and_a_sensor_does_not(params, feed) -> None:
    rest = (0.0,) * 4
    car = Watched(params, feed)
    car.run(1.0, ALL, ALL, ALL)
    car.run(0.2, ALL, without(FL), without(FL))
    assert car.run(2.0, rest, rest, rest) == [FL]
    assert car.run(0.5, ALL, without(FL), without(FL)) == [FL]
    car.run(2.0, rest, rest, rest)
    assert car.run(0.3, ALL, ALL, without(FL)) == [], "early in another braking its force is there"


def test_friction_that_rises_later_in_a_braking_does_not_acquit(params, feed) -> None:
    car = Watched(params, feed)
    car.run(1.0, ALL, ALL, ALL)
    car.run(0.6, ALL, without(RL), without(RL))
    car.rough = 1.3
    assert car.run(1.0, ALL, without(RL), without(RL)) == [RL]
