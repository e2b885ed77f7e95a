"""Simulation of many cars at once: seeds or parameters side by side, over all cores, in place.

Each car has its row in arrays of parameters, states and commands; rows are processed in place and no car
depends on another, so a car's result is to the bit that of a run alone. `numba.set_num_threads` chooses how
many cores take part.
"""

from typing import Any

import numba

from brakelab.plant.jit import parallel_kernel
from brakelab.plant.vehicle import advance


@parallel_kernel
def advance_fleet(params: Any, states: Any, commands: Any, steps: int, dt: float) -> None:
    """Advance every car by `steps` of `dt` [s] with its commands held.

    Arrays of PARAMS, STATE and COMMANDS, shape (n,) each, a row a car.
    """
    for car in numba.prange(len(states)):
        for _ in range(steps):
            advance(params[car], states[car], commands[car], dt)
