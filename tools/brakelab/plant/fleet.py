"""Many cars at once: seeds or parameters side by side, over all cores, in place.

Each car has its row in arrays of parameters, states and commands; rows are worked on where they are, nothing
is copied and no car depends on another, so a car's bits are those it would have alone.
`numba.set_num_threads` chooses how many cores take part.
"""

from typing import Any

import numba

from brakelab.plant.jit import parallel_kernel
from brakelab.plant.vehicle import advance


@parallel_kernel
def advance_fleet(params: Any, states: Any, commands: Any, steps: int, dt: float) -> None:
    """Move every car on by `steps` of `dt` [s] with its commands held.

    Arrays of PARAMS, STATE and COMMANDS, shape (n,) each, a row a car.
    """
    for car in numba.prange(len(states)):
        for _ in range(steps):
            advance(params[car], states[car], commands[car], dt)
