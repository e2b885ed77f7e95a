"""What is not proposed: worse sources of the same, candidates of what was not found, and their reasons."""

import re

import numpy as np
import pytest

from brakelab.logs.physics.samples import ANY_CAR
from brakelab.mapping.candidates import best_of
from brakelab.mapping.motion import wheel_speeds
from brakelab.mapping.names import score
from brakelab.mapping.physics import propose
from brakelab.mapping.series import coarseness, step
from brakelab.mapping.sources import alternatives, undecided

from .test_physics import MOTION, ROAD, named, series

DECEL = np.maximum(-ROAD.change, 0.0)
NOISE = np.random.default_rng(7).normal(0.0, 1.0, len(ROAD.t))


def stepped(signal, quantum, every=1, message="Esp"):
    """An accelerometer that reads dv/dt in steps, every so many samples."""
    one = series(signal, np.round(ROAD.change / quantum) * quantum, "m/s^2", message)
    return one._replace(t=one.t[::every], value=one.value[::every], period=0.02 * every)


@pytest.mark.parametrize(
    ("better", "worse"),
    [
        ((0.01, 1), (0.5, 1)),  # finer steps
        ((0.01, 1), (0.01, 4)),  # more samples
        ((0.035, 1), (0.01, 5)),  # steps that noise hides, and five times as many
        ((0.05, 5), (2.0, 1)),  # steps that hide the signal
    ],
)
def test_the_source_of_less_noise_per_bandwidth_is_taken_and_the_other_named(better, worse):
    best, other = stepped("LongAccel", *better, message="A"), stepped("LongAccel", *worse, message="B")
    assert coarseness(best) < 0.8 * coarseness(other)
    for both in ([best, other], [other, best]):
        taken = best_of(both, "accel_x", MOTION, MOTION.change, MOTION.faster(3.0))
        assert taken is not None
        assert taken[0].message == "A"
        here = [*ROAD.wheels.values(), *both]
        found, _ = propose(here)
        beside = [one for one in alternatives(found, here, MOTION) if one.target == "accel_x"]
        assert [one.series.message for one in beside] in (["B"], [])  # too coarse to say the same
        if beside:
            assert "worse: " in beside[0].evidence
            rates = f"steps of {step(other):.3g} m/s^2, not {1 / best.mean_interval:.0f} Hz"
            assert rates in beside[0].evidence


def test_two_sources_that_read_alike_are_as_good_as_each_other():
    here = [*ROAD.wheels.values(), *(stepped("LongAccel", 0.01, message=name) for name in "AB")]
    (beside,) = [one for one in alternatives(propose(here)[0], here, MOTION) if one.target == "accel_x"]
    assert "as good: " in beside.evidence


def test_a_speed_over_ground_beside_wheels_is_named():
    here = [*ROAD.wheels.values(), *(series(name, ROAD.speed, "m/s") for name in ("GPS_Speed", "DashSpeed"))]
    found, _ = propose(here)
    listed = [one for one in undecided(found, here, MOTION, ANY_CAR) if one.target == "vehicle_speed"]
    assert [one.series.signal for one in listed] == ["GPS_Speed"]
    assert "correlation +1.00 with the wheels" in listed[0].evidence


def test_of_two_sets_of_wheels_the_rate_decides_where_steps_do_not_matter():
    names = [f"WHEEL_SPEED_{corner}" for corner in ("FL", "FR", "RL", "RR")]
    fine = [
        one._replace(t=one.t[::10], value=one.value[::10], period=0.2) for one in named(names, "SLOW", 0.01)
    ]
    fast = named(names, "FAST", 0.05)
    here = [*fine, *fast]
    assert {one.message for one in wheel_speeds(here).values()} == {"FAST"}
    found, _ = propose(here)
    beside = alternatives(found, here, MOTION)
    assert [(one.target, one.name) for one in beside] == [("wheel_speed_fl", "SLOW.WHEEL_SPEED_FL")]


@pytest.mark.parametrize(
    ("one", "target", "says"),
    [
        (series("LongAccel", NOISE, "m/s^2"), "accel_x", "correlation [+-]0.0. with dv/dt"),
        (series("LongAccel", -ROAD.change, "V"), "accel_x", "V does not turn into m/s"),
        (series("BrkPedal", np.round(DECEL), "%"), "pedal_position", "only . values in this drive"),
        (series("BrkPedal", -DECEL, "%"), "pedal_position", "correlation -.* with deceleration"),
        (series("AbsActive", (NOISE > 0.0).astype(float)), "abs_active", "on for [45]. % of the drive"),
    ],
)
def test_a_candidate_is_listed_with_what_it_lacks(one, target, says):
    found, _ = propose([*ROAD.wheels.values(), one])
    assert target not in {each.target for each in found}
    listed = undecided(found, [*ROAD.wheels.values(), one], MOTION, ANY_CAR)
    assert [(each.target, each.name) for each in listed if each.target == target] == [
        (target, f"Esp.{one.signal}")
    ]
    line = str(next(each for each in listed if each.target == target))
    assert line.startswith(f"not proposed for {target}: Esp.{one.signal}")
    assert re.search(says, line)


def test_the_vacuum_of_the_booster_is_no_pressure_of_a_calliper():
    scores = [score(name, "calliper_pressure_fl") for name in ("BrkBstrVac_P_Actl", "BrkPress")]
    assert scores[0] < 0.0 < scores[1]


@pytest.mark.parametrize(
    "one",
    [
        series("LongAccel_Cnt", np.arange(len(NOISE)) % 16.0, "m/s^2"),
        series("EngineTemp", NOISE, "degC"),
        series("VertAccel", NOISE, "m/s^2"),
    ],
)
def test_what_nothing_speaks_for_is_not_listed(one):
    found, _ = propose([*ROAD.wheels.values(), one])
    assert one.signal not in {
        each.series.signal
        for each in undecided(found, [*ROAD.wheels.values(), one], MOTION, ANY_CAR)
        if each.target != "accel_y"
    }
