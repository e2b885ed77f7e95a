"""Snapshots by themselves: two deep, the older one comes back in all but the speed; and the last calm one."""

import numpy as np
import pytest

from ecu.algorithm.estimation.joint.layout import JOINT_STATE, N, V
from ecu.algorithm.estimation.joint.snapshot import (
    keep_calm_snapshot,
    restore_snapshot,
    save_newer_snapshot,
    save_snapshot,
    save_snapshots,
    take_calm_snapshot,
)


def marked(value: float):
    """Return a state whose every value is `value`."""
    state = np.zeros(1, JOINT_STATE)[0]
    state["x"], state["p"] = value, value
    return state


def test_a_snapshot_goes_to_its_row() -> None:
    state = marked(3.0)
    save_snapshot(state, 1)
    assert (state["kept_x"] == [[0.0] * N, [3.0] * N]).all()
    assert (state["kept_p"][1] == 3.0).all()
    assert (state["kept_p"][0] == 0.0).all()


def test_the_newer_becomes_the_older() -> None:
    state = marked(1.0)
    for value in (1.0, 2.0, 3.0):
        state["x"], state["p"], state["kept_s"] = value, value, 0.2
        save_newer_snapshot(state)
        assert state["kept_s"] == 0.0
    assert (state["kept_x"][0] == 3.0).all()
    assert (state["kept_x"][1] == 2.0).all()
    assert (state["kept_p"][0] == 3.0).all()
    assert (state["kept_p"][1] == 2.0).all()


def test_the_older_comes_back_in_all_but_the_speed() -> None:
    state = marked(1.0)
    save_snapshot(state, 1)
    state["x"], state["p"] = 7.0, 7.0
    save_snapshot(state, 0)
    restore_snapshot(state)
    others = np.arange(N) != V
    assert state["x"][V] == 7.0
    assert (state["x"][others] == 1.0).all()
    assert (state["p"][np.ix_(others, others)] == 1.0).all()
    assert (state["p"][V, others] == 0.0).all()
    assert (state["p"][others, V] == 0.0).all()
    assert state["p"][V, V] == 0.5**2


@pytest.mark.parametrize(("age", "value"), [(29.0, 3.0), (31.0, 5.0)])
def test_the_calm_one_comes_back_before_linings_may_have_changed(age: float, value: float) -> None:
    state = marked(1.0)
    save_snapshots(state)
    for each in (2.0, 3.0, 4.0, 5.0, 6.0):
        state["x"], state["p"], state["calm_s"] = each, each, age
        save_newer_snapshot(state)
        if each <= 4.0:
            keep_calm_snapshot(state)
    take_calm_snapshot(state)
    restore_snapshot(state)
    others = np.arange(N) != V
    assert (state["x"][others] == value).all()
    assert (state["kept_x"] == value).all()
    assert (state["p"][np.ix_(others, others)] == value).all()
