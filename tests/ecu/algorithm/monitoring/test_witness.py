"""The test that every watched input passes: doubt, rejection, acceptance."""

import math

import numpy as np
import pytest

from ecu.algorithm.monitoring.witness import (
    WITNESS_STATE,
    begin_watch,
    believe,
    compare,
    compare_both,
    end_watch,
    judge,
    leave_out,
    note_named,
    rejected_faults,
)
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


@pytest.mark.parametrize("nothing", [math.nan, math.inf])
def test_what_is_no_number_changes_neither_doubt_nor_agreement(state, nothing) -> None:
    judged(state, 1.01, 0.25)
    state["agreed_s"][PLACE], doubted = 0.5, float(state["doubted_s"][PLACE])
    judged(state, nothing, 0.2)
    assert (state["agreed_s"][PLACE], state["doubted_s"][PLACE]) == (0.5, doubted)


def test_who_is_believed_again_is_not_doubted(state) -> None:
    judged(state, 3.0, 0.5)
    believe(state, PLACE)
    assert (state["rejected"][PLACE], state["doubted_s"][PLACE]) == (0, 0.0)


@pytest.mark.parametrize(
    ("agrees", "seconds", "accepted"), [(0.4, 0.9, False), (0.4, 1.1, True), (0.6, 9.0, False)]
)
def test_a_rejected_input_agrees_for_a_second_within_half_of_its_tolerance(
    state, agrees, seconds, accepted
) -> None:
    assert judged(state, 3.0, 0.5)
    assert judged(state, agrees, seconds) == (not accepted)


def published(state, *names: str) -> list[float]:
    return [float(state["published"][name][PLACE]) for name in names]


def test_what_a_verdict_was_made_of_is_published(state) -> None:
    """A tolerance is three standard deviations."""
    begin_watch(state, DT)
    judged(state, 3.0, DT)
    found = published(state, "innovation", "sigma", "ratio", "judged_s")
    assert found == pytest.approx([0.6, 0.2 / 3.0, 9.0, 0.0])
    begin_watch(state, DT)
    judged(state, math.nan, DT)
    assert published(state, "ratio", "judged_s") == pytest.approx([9.0, DT])


COMPARED = [
    # innovation over tolerance of two comparisons; published, one by one and where both count together
    ((0.5, 0.2), 0.5, 0.2),
    ((0.2, -0.5), -0.5, 0.0),
    ((-2.0, -3.0), -3.0, -2.0),
    ((2.0, 0.0), 2.0, 0.0),
]


@pytest.mark.parametrize(("apart", "greatest", "together"), COMPARED)
def test_of_several_comparisons_in_a_cycle_one_is_published(state, apart, greatest, together) -> None:
    begin_watch(state, DT)
    for one in apart:
        compare(state, PLACE, 0.2 * one, 0.2)
    assert published(state, "innovation", "ratio") == pytest.approx([0.2 * greatest, greatest**2])
    begin_watch(state, DT)
    compare_both(state, PLACE, 0.2 * apart[0], 0.2, 4.0 * apart[1], 4.0)
    assert published(state, "ratio")[0] == pytest.approx(together**2)


def test_who_is_left_out_is_not_used(state, feed) -> None:
    received, trusted = feed(yaw_rate=0.3), feed(yaw_rate=0.3)
    for k in range(5):
        begin_watch(state, DT)
        if k >= 3:
            leave_out(state, PLACE)
        end_watch(state, received[0], trusted[0], DT)
    assert published(state, "value", "rejected", "unused_s") == pytest.approx([0.3, 1, 2 * DT])
    received["verdict"] = trusted["verdict"] = 0
    begin_watch(state, DT)
    end_watch(state, received[0], trusted[0], DT)
    assert published(state, "value", "rejected", "unused_s") == pytest.approx(
        [math.nan, 0, 3 * DT], nan_ok=True
    )


@pytest.mark.parametrize(
    ("before", "now", "new"), [(0, 0, False), (0, 4, True), (4, 4, False), (4, 6, True), (4, 0, False)]
)
def test_a_name_is_new_once(state, before: int, now: int, new: bool) -> None:
    note_named(state, before)
    assert note_named(state, now) == new
    assert not note_named(state, now)


@pytest.mark.parametrize(("innovation", "calm"), [(math.nan, True), (0.4, True), (0.6, False), (-0.6, False)])
def test_inputs_are_calm_within_half_of_their_tolerances(state, innovation: float, calm: bool) -> None:
    state["published"]["ratio"] = math.nan
    begin_watch(state, DT)
    compare(state, PLACE, innovation, 1.0)
    note_named(state, 0)
    assert bool(state["calm"]) == calm
