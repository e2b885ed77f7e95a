"""A law to identify: its free numbers, their bounds, and the law that given numbers make."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from brakelab.arrays import Vector
from brakelab.identify.friction.stops import Stops
from brakelab.plant.friction.law import Law
from brakelab.plant.friction.network import WEIGHTS


class Free(NamedTuple):
    """A number that is searched."""

    name: str
    unit: str
    low: float
    high: float
    log: bool = False
    friction: bool = False
    """Is a friction: starts of a search have it near the measured mean."""

    def value(self, share: float) -> float:
        """Return the number at `share` 0 to 1 between its bounds."""
        if self.log:
            return float(self.low * (self.high / self.low) ** share)
        return self.low + share * (self.high - self.low)

    def share(self, value: float) -> float:
        """Return where `value` lies between the bounds, 0 to 1."""
        if self.log:
            return float(np.log(value / self.low) / np.log(self.high / self.low))
        return (value - self.low) / (self.high - self.low)

    def slope(self, share: float) -> float:
        """Return the derivative of `value`."""
        if self.log:
            return self.value(share) * float(np.log(self.high / self.low))
        return self.high - self.low


class Trained(NamedTuple):
    """Numbers that a training ended with."""

    values: Sequence[float]
    agreed: int  # starts that ended as well
    tried: int


class Candidate(NamedTuple):
    """A law to identify. `starts_at_measured`: its memory starts at the friction first measured (3.6)."""

    name: str
    free: tuple[Free, ...]
    law: Callable[[Sequence[float]], Law]
    starts_at_measured: bool = False
    extrapolates: str = ""
    """Where the law must not be used beyond the data, and why."""
    bounded: bool = False
    """Beyond the data it keeps its value at their edge."""
    train: Callable[[Stops, int], Trained] | None = None
    """Instead of a search of `free`, which is empty then; the second argument is a seed."""

    @property
    def size(self) -> int:
        """Return how many numbers are identified."""
        return WEIGHTS if self.train else len(self.free)

    def values(self, shares: Sequence[float] | Vector) -> list[float]:
        """Return the numbers at these shares."""
        return [free.value(share) for free, share in zip(self.free, shares, strict=True)]
