"""Goals of a study: whether what it measured meets them, and by how much it does not."""

import math
from collections.abc import Iterable
from typing import NamedTuple


class Goal(NamedTuple):
    """A measured value beside its limits, which are within the goal."""

    name: str
    """Of what is limited; "" where a verdict has one goal alone."""
    value: float
    most: float = math.inf
    least: float = -math.inf


def verdict(*goals: Goal) -> str:
    """Return "met", or each goal that was missed and by how much, in its own unit."""
    missed = []
    for goal in goals:
        if not goal.least <= goal.value <= goal.most:
            by = max(goal.value - goal.most, goal.least - goal.value)
            missed.append(f"{goal.name} by {by:{'.0f' if by >= 100.0 else '.2g'}}".strip())
    return f"missed: {', '.join(missed)}" if missed else "met"


def met(verdicts: Iterable[str]) -> str:
    """Return "2 of 3", those that are met."""
    every = list(verdicts)
    return f"{every.count('met')} of {len(every)}"
