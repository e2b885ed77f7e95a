"""The share that emits least: motors first, Annex 5 always, the configured distribution where grip counts."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ecu.algorithm.control.cleaner_share import (
    CLEANER_STATE,
    SHARE_RATE,
    admitted,
    lean,
    wanted_share,
)
from ecu.contract.params import HEAT_NODES, HEAT_STEP, PARAMS, RATE_STEP

G, DT, MASS = 9.81, 0.01, 2000.0
FRONT = 0.55  # configured


@pytest.fixture
def cleaner(params):
    """Return a call of `lean` for a car whose tables are simple: it wants 0.8 and may have 0.3 to 0.9."""
    p, state, torque = params[0], np.zeros(1, CLEANER_STATE), np.zeros(4)
    p["wanted_share"], p["least_share"], p["most_share"] = 0.8, 0.3, 0.9
    p["wheel_radius"] = [0.35, 0.35, 0.34, 0.34]

    def call(decel=1.0, motors=(0.0,) * 4, heat=(60.0,) * 4, calm=True, dt=DT) -> float:
        """Return the share of the front axle's force after a cycle."""
        torque[:] = 0.5 * MASS * decel * p["wheel_radius"] * [FRONT, FRONT, 1.0 - FRONT, 1.0 - FRONT]
        lean(p, state[0], torque, np.array(motors), np.array(heat), FRONT, MASS, decel, calm, dt)
        force = torque / p["wheel_radius"]
        assert force[0] == force[1]
        assert force[2] == force[3]
        if decel > 0.0:
            assert force.sum() == pytest.approx(MASS * decel)
        return float(force[:2].sum() / force.sum()) if decel > 0.0 else np.nan

    call.params, call.state = p, state[0]
    return call


def test_foot_off_the_share_is_taken_as_it_is_and_the_next_braking_begins_with_it(cleaner) -> None:
    cleaner(decel=0.0)
    assert cleaner.state["share"] == pytest.approx(0.8)
    assert cleaner() == pytest.approx(0.8)


def test_in_an_application_the_share_moves_slowly_to_both_sides(cleaner) -> None:
    cleaner(decel=0.0)
    cleaner.params["wanted_share"] = 0.5
    assert cleaner(dt=0.1) == pytest.approx(0.8 - 0.1 * SHARE_RATE)
    cleaner.params["wanted_share"] = 0.9
    assert cleaner(dt=0.1) == pytest.approx(0.8)
    assert cleaner(dt=0.001) == pytest.approx(0.8 + 0.001 * SHARE_RATE)
    assert cleaner(dt=10.0) == pytest.approx(0.9)


@pytest.mark.parametrize(("wanted", "share"), [(0.2, 0.3), (0.95, 0.9), (0.3, 0.3), (0.6, 0.6)])
def test_annex_5_goes_first(cleaner, wanted: float, share: float) -> None:
    cleaner.params["wanted_share"] = wanted
    cleaner(decel=0.0)
    assert cleaner() == pytest.approx(share)


@pytest.mark.parametrize(
    ("decel", "least"), [(0.0, 0.0), (0.5 * RATE_STEP * G, 0.05), (0.1 * G, 1.0), (0.8 * G, 1.0), (3.0, 1.0)]
)
def test_what_is_admitted_is_read_between_nodes_and_held_beyond(params, decel: float, least: float) -> None:
    p = params[0]
    p["least_share"] = np.minimum(0.1 * np.arange(81), 1.0)
    p["most_share"] = 1.0
    assert admitted(p, -1.0, decel / G) == pytest.approx(least)
    assert admitted(p, 2.0, decel / G) == 1.0


MOTORS = [
    # N m of each motor in front and at the rear, share of the front's force; all brakes: 2000 N
    ((0.0, 0.0), 0.8),
    ((175.0, 0.0), 0.5 + 0.8 * 0.5),  # 1000 N of the front's motors, 0.8 of the other 1000
    ((0.0, 170.0), 0.8 * 0.5),
    ((87.5, 85.0), 0.25 + 0.8 * 0.5),
    ((350.0, 340.0), FRONT),  # they can do all of it
    ((350.0, 0.0), 0.9),  # 1.0: at most 0.9
    ((87.5, 255.0), 0.25),  # all of it, but no more than 0.25 in front
    ((280.0, 68.0), 0.8),  # at least 0.8 in front
    ((0.0, 340.0), 0.3),  # 0.0: at least 0.3
]


@pytest.mark.parametrize(("motors", "share"), MOTORS)
def test_motors_go_first_and_the_linings_share_the_rest(cleaner, motors, share: float) -> None:
    cleaner.params["blending"] = 1.0
    cleaner.params["least_share"] = 0.3 if share >= 0.3 else 0.0
    cleaner(decel=0.0)
    assert cleaner(motors=np.repeat(motors, 2)) == pytest.approx(share)


def test_motors_that_are_not_to_brake_do_not_count(cleaner) -> None:
    cleaner(decel=0.0)
    cleaner.params["blending"] = [0.0, 0.0, 0.0, 0.0]
    assert cleaner(motors=np.full(4, 300.0)) == pytest.approx(0.8)


@pytest.mark.parametrize(
    "given",
    [
        {"calm": False},
        {"heat": (60.0, 60.0, 300.1, 300.1)},
        {"heat": (300.1, 300.1, 60.0, 60.0)},
        {"heat": (np.nan, 60.0, 60.0, 60.0)},
        {"heat": (60.0, 60.0, np.nan, 60.0)},
        {"decel": 0.81 * G},
    ],
)
def test_the_configured_distribution_until_the_braking_ends(cleaner, given) -> None:
    cleaner(decel=0.0)
    assert cleaner() == pytest.approx(0.8)
    assert cleaner(**given) == pytest.approx(FRONT)
    assert cleaner() == pytest.approx(FRONT)
    cleaner(decel=0.0)
    assert cleaner() == pytest.approx(0.8)


def test_too_hot_with_the_foot_off_is_still_too_hot_with_it_on(cleaner) -> None:
    cleaner(decel=0.0, heat=(400.0,) * 4)
    assert np.isnan(cleaner.state["share"])
    assert cleaner() == pytest.approx(FRONT)


def test_at_the_ends_of_the_tables_it_still_acts(cleaner) -> None:
    cleaner(decel=0.0)
    assert cleaner(heat=(300.0, 300.0, 300.0, 300.0)) == pytest.approx(0.8)
    assert cleaner(decel=0.799 * G) == pytest.approx(0.8)


def test_an_unknown_demand_is_left_unknown(cleaner) -> None:
    torque = np.full(4, np.nan)
    p, state = cleaner.params, cleaner.state
    lean(p, state, torque, np.zeros(4), np.full(4, 60.0), FRONT, MASS, np.nan, True, DT)
    assert np.isnan(torque).all()
    assert state["share"] == pytest.approx(0.8)


@given(st.floats(-50.0, 299.0), st.floats(-50.0, 299.0))
@settings(max_examples=60, deadline=None)
def test_the_table_is_bilinear_in_the_mean_heat_of_each_axle(front: float, rear: float) -> None:
    """A plane is read exactly; below 0 degC its edge is held."""
    nodes = HEAT_STEP * np.arange(HEAT_NODES)
    row = np.zeros(1, PARAMS)
    row["wanted_share"] = 0.1 + 1e-3 * nodes[:, None] + 2e-3 * nodes
    heat = np.array([front - 5.0, front + 5.0, rear + 3.0, rear - 3.0])
    expected = 0.1 + 1e-3 * max(front, 0.0) + 2e-3 * max(rear, 0.0)
    assert wanted_share(row[0], heat) == pytest.approx(expected)
