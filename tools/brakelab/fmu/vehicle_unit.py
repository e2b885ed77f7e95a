"""The simulated vehicle of a scenario as an FMU: demands in, what its sensors measure and true values out."""

from typing import Final

import numpy as np

from brakelab.fmu.image import Memory, arrays_in, compiled_call, noise_state
from brakelab.fmu.unit import TIME, Unit, Variable, stated
from brakelab.fmu.vehicle_cycle import go_on, measure
from brakelab.plant.friction.laws import LAWS
from brakelab.plant.friction.own import Own
from brakelab.simulation.faults import DAEMON_KILLED, KINDS
from brakelab.simulation.scenario import Scenario
from brakelab.simulation.vehicle_bus import (
    N_TRUTH,
    TRUTH_COLUMNS,
    new_noise,
    new_values,
    new_vehicle,
    truth_unit,
)
from ecu.bus.freshness import target_dtype
from ecu.contract.signals import CORNERS, INPUT_SIGNALS, N_OUTPUTS, OUTPUT, OUTPUT_SIGNALS, column_names
from ecu.errors import UserError

NAME: Final = "brake_vehicle"
DEMANDED: Final = tuple(
    name
    for signal in ("pressure_demand", "motor_demand")
    for name in (*(f"{signal}_{corner}" for corner in CORNERS), f"{signal}_valid")
)
"""Outputs of the ECU that the vehicle hears."""


def vehicle_unit(scenario: Scenario, seed: int, where: str) -> Unit:
    """Return the vehicle of a scenario with its driver, car and noise drawn from `seed`.

    `where` names the scenario in messages.

    Raises:
        UserError: a fault of the scenario is one of frames; a lining has a friction law of the user's own;
            the plant's file is wrong; the compiled library is missing or of another text.
    """
    for fault in scenario.fault:
        if KINDS.index(fault.kind) <= DAEMON_KILLED:
            raise UserError(
                where, "fault", f'"{fault.kind}" acts on frames, which an FMU has none of; leave it out'
            )
    vehicle, values, row = new_vehicle(scenario, seed), new_values(), np.full(N_TRUTH, np.nan)
    if np.any(vehicle.params["friction_law"] == LAWS.index(Own)):
        raise UserError(
            where, "plant", 'a friction law of one\'s own is not in the library; take a law = "table"'
        )
    source, given = new_noise(seed), np.full(len(DEMANDED), np.nan)
    noise, heard = noise_state(source), np.zeros(1, target_dtype(N_OUTPUTS))
    memory = Memory((*arrays_in(vehicle), values, row, noise, heard, given))
    at, demanded = noise.ctypes.data, [(name, stated(name)) for name in DEMANDED]
    units = {name: one.unit for one in OUTPUT_SIGNALS for name in column_names(one)}

    return Unit(
        NAME,
        f"Simulated vehicle with its driver: scenario {where}",
        "vehicle.c",
        (
            TIME,
            *(
                Variable(
                    name,
                    "INPUT",
                    units[name],
                    memory.offset(given[place:].ctypes.data),
                    f"{of.description} ({of.low:g} to {of.high:g}; NaN: none arrived)",
                    OUTPUT[name],
                    of.low,
                    of.high,
                )
                for place, (name, of) in enumerate(demanded)
            ),
            *(
                Variable(
                    one.name,
                    "OUTPUT",
                    one.unit,
                    memory.offset(values[place:].ctypes.data),
                    stated(one.name).description,
                )
                for place, one in enumerate(INPUT_SIGNALS)
                if one.message
            ),
            *(
                Variable(f"truth.{name}", "OUTPUT", truth_unit(name), memory.offset(row[place:].ctypes.data))
                for place, name in enumerate(TRUTH_COLUMNS)
            ),
        ),
        memory,
        (
            compiled_call("MEASURE", measure, (vehicle, source, values, row), memory, at),
            compiled_call("GO_ON", go_on, (vehicle, heard[0], source, values, row), memory, at),
        ),
        scenario.model_dump_json(indent=1),
        memory.offset(heard["value"].ctypes.data),
    )
