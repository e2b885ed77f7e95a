"""Work of a workshop: what it changes, and that all else of a running ECU stays as it is."""

import numpy as np
import pytest

from ecu.algorithm.step import STATE, new_state
from ecu.contract.work import Kind, Work
from ecu.workshop import NEVER_FORGOTTEN, OF_ALL, OF_WEAR, do

BEFORE = 0.1


@pytest.fixture
def driven(params):
    """A state of which every number that is learned differs from a new one's."""
    learned = new_state(params)["learned"].copy()
    row = learned[0]
    row["mu_b"], row["sigma_mu_b"], row["observed_s"], row["brakings"] = 0.4, 0.01, 30.0, 12
    row["wear"]["odometer"], row["wear"]["regressors"] = 5e6, 100.0
    row["dust"]["particles"], row["disc_excess"] = 1e12, 80.0
    state = new_state(params, learned)
    state["speed"]["speed"] = state["demand"]["pedal"] = state["limiter"]["pressure"] = BEFORE
    return state


def changed(state, before):
    return {name for name in STATE.names if state[name].tobytes() != before[name].tobytes()}


@pytest.mark.parametrize(
    ("work", "parts", "told"),
    [
        (Work(Kind.NEW_PADS, {"fl": 0.0, "rr": 0.0}), OF_WEAR, [1, 0, 0, 1]),
        (Work(Kind.MEASURED_PADS, {"fr": 2.5}), OF_WEAR, [0, 0, 0, 0]),
        (Work(Kind.FORGET), OF_ALL, [0, 0, 0, 0]),
    ],
)
def test_it_changes_its_own_parts_alone(work, parts, told, driven, params):
    before = driven.copy()
    do(work, params, driven)
    assert changed(driven, before) <= {*parts, "learned"}
    assert driven["learned"]["wear"]["told"][0].tolist() == told
    for name in before["learned"].dtype.names if work.kind != Kind.FORGET else NEVER_FORGOTTEN:
        same = driven["learned"][name].tobytes() == before["learned"][name].tobytes()
        assert same or (name == "wear" and work.kind != Kind.FORGET), name


def test_new_pads_are_as_thick_as_new_at_once(driven, params):
    do(Work(Kind.NEW_PADS, {"fl": 0.0}), params, driven)
    wear = driven["wear"]["wear"][0]
    assert wear[0] == 0.0
    assert wear[1] > 0.0
    assert driven["learned"]["wear"]["fitted_at"][0].tolist() == [5e6, 0.0, 0.0, 0.0]


def test_a_measured_pad_is_as_worn_as_measured_at_once(driven, params):
    do(Work(Kind.MEASURED_PADS, {"rl": 2.5}), params, driven)
    assert driven["wear"]["wear"][0, 2] == pytest.approx(2.5, abs=0.1)
    assert driven["learned"]["wear"]["measurements"][0].tolist() == [0, 0, 1, 0]


def test_what_is_forgotten_is_as_at_a_first_start_but_for_what_was_counted(driven, params):
    do(Work(Kind.FORGET), params, driven)
    new = new_state(params)
    for name in set(OF_ALL) - {"learned"}:
        assert driven[name].tobytes() == new[name].tobytes(), name
    for name in set(new["learned"].dtype.names) - {*NEVER_FORGOTTEN}:
        assert np.array_equal(driven["learned"][name], new["learned"][name]), name
    assert driven["limiter"]["pressure"].tolist() == [[BEFORE] * 4]
