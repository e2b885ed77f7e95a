"""Kernels that tests and benches alone call, called once: `brakelab.build --inner` sees what to compile."""

import numpy as np

from brakelab.bench.filters import FILTER_INPUT, filter_cycle, filter_cycles, new_observer
from brakelab.bench.plant import _drive, cars
from brakelab.bench.step import _noted_steps, run_steps
from brakelab.plant.description import load_plant, nominal
from brakelab.studies.accuracy.ablation import _steps
from ecu.algorithm.step import new_state
from ecu.contract.records import INPUTS, OUTPUTS, new_record, output_vector
from ecu.contract.signals import N_OUTPUTS
from ecu.settings.config import load_config, new_params
from ecu.settings.resources import resource
from tests.brakelab.plant.conftest import CONFIG, make_car
from tests.brakelab.plant.test_lining import advance_linings
from tests.ecu.algorithm.test_step_extremes import Liar


def call_every_kernel() -> None:
    """Call those that call large parts of the algorithm or of the plant; numba compiles the others."""
    Liar("suv", everything=False).drive(1)
    car = make_car(nominal(load_plant(CONFIG / "suv.toml")), 10.0)
    car.run(0.002)
    advance_linings(car.params, car.state, 1)
    params, states, commands = cars("suv", 1)
    _drive(params[0], states[0], commands[0], 1)

    params = new_params(load_config(resource("config/suv.toml")))
    state, inputs, outputs = new_state(params), new_record(INPUTS), new_record(OUTPUTS)
    table = np.ones((1, 4), FILTER_INPUT)
    run_steps(params, state, inputs, outputs)
    _noted_steps(params, state, inputs, outputs, table)
    _steps(params, state, inputs, outputs, output_vector(outputs), np.empty((1, N_OUTPUTS)))
    observer = new_observer(params, table)
    filter_cycle(params, observer, table, 0)
    filter_cycles(params, observer, table)
