"""The ECU as an FMU: inputs and outputs are those of its bus, without the bus."""

import numpy as np

from brakelab.fmu.image import Memory, compiled_call
from brakelab.fmu.unit import TIME, Unit, Variable, stated
from brakelab.logs.signal_file import freshness_at_any_rate
from ecu.algorithm.step import new_state, step
from ecu.bus.freshness import accept, begin_cycle, end_cycle
from ecu.bus.receive_plan import contract_receive_plan
from ecu.contract.records import INPUTS, OUTPUTS, RecordArray, new_record, output_vector
from ecu.contract.signals import (
    CYCLE_NS,
    INPUT_SIGNALS,
    N_INPUTS,
    OUTPUT,
    OUTPUT_SIGNALS,
    STARTING,
    column_names,
)
from ecu.settings.config import Config, new_params
from ecu.settings.resources import resource

NAME = "brake_ecu"


def first_outputs() -> RecordArray:
    """Return the outputs before the first cycle, `OUTPUTS`, shape (1,): nothing is demanded or known."""
    outputs = new_record(OUTPUTS)
    output_vector(outputs)[:] = np.nan
    for name in ("pressure_demand", "pressure_demand_valid", "motor_demand_valid"):
        outputs[name] = 0.0
    outputs["mode"] = STARTING
    outputs["active_faults"] = outputs["active_faults_2"] = 0.0
    return outputs


def ecu_unit(config: Config) -> Unit:
    """Return the ECU of a configuration, armed unless the FMU's parameter `armed` says otherwise.

    Raises:
        UserError: the compiled library is missing or of another text.
    """
    params = new_params(config)
    params["transmit"] = 1
    params["mapped"] = contract_receive_plan(resource("dbc/brake_ecu.dbc")).mapped
    state, inputs, outputs = new_state(params), new_record(INPUTS), first_outputs()
    freshness, given = freshness_at_any_rate(), np.full(N_INPUTS, np.nan)
    memory = Memory((params, state, inputs, outputs, freshness, given))
    samples = (inputs[0], freshness)
    vector = output_vector(outputs)
    signals = [(place, one) for place, one in enumerate(INPUT_SIGNALS) if one.message]
    sent = [(name, one) for one in OUTPUT_SIGNALS for name in column_names(one)]
    names = {one.name for _, one in signals}
    return Unit(
        NAME,
        f"Brake ECU of {config.name}: pressure and motor demands, friction of the linings",
        "ecu.c",
        (
            TIME,
            *(
                Variable(
                    one.name,
                    "INPUT",
                    one.unit,
                    memory.offset(given[place:].ctypes.data),
                    f"{stated(one.name).description} ({one.low:g} to {one.high:g}; NaN: no sample)",
                    place,
                )
                for place, one in signals
            ),
            *(
                Variable(
                    f"estimate.{name}" if name in names else name,
                    "OUTPUT",
                    one.unit,
                    memory.offset(vector[OUTPUT[name] :].ctypes.data),
                    stated(name).description,
                )
                for name, one in sent
            ),
            Variable(
                "armed",
                "PARAMETER",
                "-",
                memory.offset(params["transmit"].ctypes.data),
                "Demands are flagged valid; false: a shadow that only estimates",
            ),
        ),
        memory,
        (
            compiled_call("BEGIN_CYCLE", begin_cycle, (inputs[0], CYCLE_NS, CYCLE_NS), memory),
            compiled_call("ACCEPT", accept, (*samples, 0, 0.0, CYCLE_NS, True), memory),
            compiled_call("END_CYCLE", end_cycle, samples, memory),
            compiled_call("STEP", step, (params, state, inputs, outputs), memory),
        ),
        config.model_dump_json(indent=1),
    )
