"""The simulated vehicle between two communication points, without frames: demands in, measured values out.

The order is that of `brakelab.simulation.closed_loop`: the driver acts, the vehicle measures, and once the
ECU has answered, the demands count and the car moves on by a cycle.
"""

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from brakelab.plant.driver import drive
from brakelab.simulation.vehicle_bus import Vehicle, advance, decode_demands, sense, write_truth
from ecu.contract.signals import CYCLE_NS, N_OUTPUTS
from ecu.jit import Record, kernel


@kernel
def measure(
    vehicle: Vehicle, noise: Generator, values: NDArray[np.float64], row: NDArray[np.float64]
) -> bool:
    """Move the driver on and measure.

    `values`, shape (N_INPUTS,), is overwritten by what the vehicle measures now, NaN: no sample; `row`, shape
    (N_TRUTH,), by true values. Returns whether the script goes on; at its end nothing is overwritten.
    """
    if not drive(vehicle.script, vehicle.params[0], vehicle.state[0], vehicle.driver[0], 1e-9 * CYCLE_NS):
        return False
    sense(vehicle, noise, values)
    write_truth(vehicle, row)
    return True


@kernel
def go_on(
    vehicle: Vehicle, heard: Record, noise: Generator, values: NDArray[np.float64], row: NDArray[np.float64]
) -> bool:
    """Take the demands in `heard` (a record of `OUTPUT_COLUMNS`, NaN: none), move on by a cycle and measure.

    Returns what `measure` does.
    """
    for place in range(N_OUTPUTS):
        heard.new[place] = 1 if np.isfinite(heard.value[place]) else 0
    decode_demands(heard, vehicle.demand[0])
    advance(vehicle)
    return measure(vehicle, noise, values, row)
