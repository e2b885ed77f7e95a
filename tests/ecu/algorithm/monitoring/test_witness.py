"""The test that every watched input passes: doubt, rejection, acceptance."""

import math

import numpy as np
import pytest

from ecu.algorithm.monitoring.witness import WITNESS_STATE, judge, rejected_faults
from ecu.contract.faults import IMPLAUSIBLE
from ecu.contract.signals import INPUT

DT, PLACE = 0.01, INPUT["yaw_rate"]

REJECTED = [
    # innovation over its tolerance, for [s], rejected; the limit of the doubt is 0.3 s
    (0.9, 60.0, False),
    (1.01, 0.28, False),
    (1.01, 0.32, True),
    (3.0, 0.09, False),
    (3.0, 0.12, True),
    (100.0, 0.05, False),
    (100.0, 0.08, True),
    (-3.0, 0.12, True),
    (math.nan, 60.0, False),
]


def judged(state, innovation: float, seconds: float) -> bool:
    for _ in range(round(seconds / DT)):
        judge(state, PLACE, 0.2 * innovation, 0.2, 0.3, DT)
    return bool(state["rejected"][PLACE])


@pytest.fixture
def state() -> np.void:
    return np.zeros(1, WITNESS_STATE)[0]


@pytest.mark.parametrize(("innovation", "seconds", "rejected"), REJECTED)
def test_the_further_off_the_sooner_rejected(state, innovation, seconds, rejected) -> None:
    assert judged(state, innovation, seconds) == rejected
    assert rejected_faults(state) == (IMPLAUSIBLE["yaw_rate"] if rejected else 0)


def test_doubt_fades_as_fast_as_it_grew(state) -> None:
    judged(state, 1.01, 0.25)
    judged(state, 0.5, 0.2)
    assert not judged(state, 1.01, 0.2)
    assert judged(state, 1.01, 0.1)


@pytest.mark.parametrize(
    ("agrees", "seconds", "accepted"), [(0.4, 0.9, False), (0.4, 1.1, True), (0.6, 9.0, False)]
)
def test_a_rejected_input_agrees_for_a_second_within_half_of_its_tolerance(
    state, agrees, seconds, accepted
) -> None:
    assert judged(state, 3.0, 0.5)
    assert judged(state, agrees, seconds) == (not accepted)


def test_what_a_verdict_was_made_of_is_kept(state) -> None:
    judged(state, 3.0, DT)
    assert state["innovation"][PLACE] == pytest.approx(0.6)
    assert state["tolerance"][PLACE] == pytest.approx(0.2)
    assert state["ratio"][PLACE] == pytest.approx(9.0)
