"""Interface of a friction law to the files that describe it."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Annotated, Any, Final, Self

from numpy.random import Generator
from pydantic import BaseModel, ConfigDict, Field

from brakelab.plant.jit import kernel

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Bounds = tuple[float, float]
"""Bounds of an even distribution."""

ROW: Final = 1024  # numbers of a law at most
START: Final = 0  # index in every row: the memory at the start of an application
KELVIN: Final = 273.15  # K at 0 degC


def as_bounds(given: Any) -> Any:
    """Return a number as a pair of equal bounds."""
    return given if isinstance(given, list | tuple) else (given, given)


def in_order(bounds: Bounds) -> Bounds:
    """Return `bounds` if they ascend. Raises `ValueError`."""
    if bounds[0] > bounds[1]:
        raise ValueError("give the lower bound first")
    return bounds


class Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class RigBrake(Section):
    """Brake with which a lining was measured (Table 3.1)."""

    piston_area: Positive  # m^2, all pistons of one side
    pad_area: Positive  # m^2
    effective_radius: Positive  # m
    tyre_radius: Positive  # m, relates disc and road

    def inertia(self, mass: float) -> float:
        """Return the rig's inertia [kg m^2] for a quarter car of `mass` [kg]."""
        return mass * self.tyre_radius**2

    def gain(self, mass: float) -> float:
        """Return 2 A_k r_eff / I [rad/s^2 per Pa]: slowing of the rig's disc over mu_b p."""
        return 2.0 * self.piston_area * self.effective_radius / self.inertia(mass)


class Law(Section, ABC):
    """Entry of a friction law in a lining file."""

    rig_mass: Positive  # kg, of the quarter car with which the law was identified

    @abstractmethod
    def row(self, brake: RigBrake) -> Sequence[float]:
        """Return the law's numbers for its kernel, at most `ROW`, the first being the starting memory."""

    def drawn(self, random: Generator) -> Self:
        """Return the law of one drawn lining of the series."""
        return self


@kernel
def linear_step(value: float, rate: float, drive: float, dt: float) -> float:
    """Return x a step `dt` later of x' = rate x + drive: trapezoidal, stable for every rate < 0."""
    half = 0.5 * dt * rate
    return (value * (1.0 + half) + dt * drive) / (1.0 - half)
