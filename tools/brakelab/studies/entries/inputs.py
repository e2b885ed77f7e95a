"""Inputs of an entry in one cycle: the samples that arrived, by the names of the contract."""

from typing import Any, Final

from brakelab.arrays import Vector
from ecu.contract.signals import INPUT_SIGNALS, without_corner
from ecu.errors import closest

TRANSDUCERS: Final = ("wheel_force_x", "wheel_torque_y")
"""Of measuring wheels: heard by entries with the attribute `wheel_transducers` alone."""


def _places() -> dict[str, int | slice]:
    places: dict[str, int | slice] = {}
    for place, signal in enumerate(INPUT_SIGNALS):
        stem = without_corner(signal.name)
        if stem == signal.name:
            places[stem] = place
        elif stem not in places:
            places[stem] = slice(place, place + 4)
    return places


PLACES: Final = _places()
"""Place of an input's value among all, or of its four, in the order fl, fr, rl, rr."""


class Inputs:
    """Samples of one cycle, read-only: `inputs.accel_x` is a float, `inputs.wheel_speed` of shape (4,).

    Names and units are those of `INPUT_SIGNALS`; NaN: no new sample in this cycle.
    """

    __slots__ = ("dt", "signals", "t", "values")

    def __init__(self, values: Vector, t: float, dt: float, signals: frozenset[str]) -> None:
        self.values = values
        """All of them in the order of `INPUT_SIGNALS`, shape (N_INPUTS,)."""
        self.t = t
        """Since the drive began [s]; 0 is the first cycle of another drive of the same car."""
        self.dt = dt
        """Since the last cycle [s]."""
        self.signals = signals
        """Names of the inputs of which this drive has samples at all."""

    def __getattr__(self, name: str) -> Any:
        place = PLACES.get(name)
        if place is None:
            raise AttributeError(f"inputs.{name}: no such signal{closest(name, PLACES)}")
        return self.values[place] if isinstance(place, slice) else float(self.values[place])
