"""Verdicts on goals: by how much one is missed, on which side."""

import pytest

from brakelab.results.verdict import Goal, met, verdict


@pytest.mark.parametrize(
    ("goals", "said"),
    [
        ([Goal("", 3.9, 4.0)], "met"),
        ([Goal("", 4.0, 4.0)], "met"),
        ([Goal("", 4.25, 4.0)], "missed: by 0.25"),
        ([Goal("p99.9", 689.0, 500.0)], "missed: p99.9 by 189"),
        ([Goal("R²", 0.985, least=0.993)], "missed: R² by 0.008"),
        ([Goal("inside", 91.0, 99.0, 93.0), Goal("error", 5.0, 5.0)], "missed: inside by 2"),
        ([Goal("inside", 100.0, 99.0, 93.0), Goal("error", 6.5, 5.0)], "missed: inside by 1, error by 1.5"),
        ([Goal("", float("nan"), 4.0)], "missed: by nan"),
    ],
)
def test_a_goal_is_met_or_missed_by_how_much(goals: list[Goal], said: str) -> None:
    assert verdict(*goals) == said


def test_goals_are_counted() -> None:
    assert met(["met", "missed: by 1", "met"]) == "2 of 3"
