"""Every kernel of the ECU that Python calls, called once: `ecu/build.py` sees from it what a library holds.

A test finds kernels that Python calls and that are missing here.
"""

import numpy as np

from ecu.algorithm.brake import brake_gain, brake_gain_per_bar
from ecu.algorithm.hydraulics import HYDRAULICS_STATE, advance_pressures, learn_lateness
from ecu.algorithm.monitoring.emission_factor import (
    emission_factor,
    emission_factors,
    inside,
    law_term,
    network_input,
    node_below,
)
from ecu.algorithm.monitoring.wear import WEAR_STATE, restore_wear
from ecu.algorithm.monitoring.wear_belief import mass_by_law
from ecu.algorithm.step import initial_part, resume
from ecu.bus.foreign import place_of_ours
from ecu.bus.freshness import accept, begin_cycle, end_cycle
from ecu.bus.receive import new_reception, receive
from ecu.bus.signal_map import receive_plan
from ecu.bus.socketcan import prepare_kernels
from ecu.bus.transmit import contract_transmit_plan
from ecu.contract.records import FRAME, INPUTS, LEARNED, new_record
from ecu.contract.signals import CYCLE_NS
from ecu.runtime.memory import new_ecu
from ecu.settings.config import load_config, new_params
from ecu.settings.resources import resource
from ecu.warm import warm


def call_every_entry() -> None:
    """Call what the daemon calls, and commands besides."""
    warm()
    params = new_params(load_config(resource("config/suv.toml")))
    _call_about_the_brakes(params[0])
    plan = receive_plan(None)
    ecu = new_ecu(params, None, plan, contract_transmit_plan(resource("dbc/brake_ecu.dbc"), "BrakeEcu"))
    resume(ecu.state, initial_part(ecu.state))
    inputs, frames, reception = new_record(INPUTS), new_record(FRAME), new_reception(plan)
    begin_cycle(inputs[0], CYCLE_NS, CYCLE_NS)
    receive(plan, reception, frames, 0, 1, inputs[0])
    accept(inputs[0], reception.freshness, 0, 0.0, CYCLE_NS, True)
    end_cycle(inputs[0], reception.freshness)
    place_of_ours(ecu.transmit_plan, frames[0])
    prepare_kernels()


def _call_about_the_brakes(params: np.void) -> None:
    learned = new_record(LEARNED)[0]
    hydraulics = np.zeros(1, HYDRAULICS_STATE)[0]
    learn_lateness(params, hydraulics, new_record(INPUTS)[0], np.zeros(4), np.zeros(4, np.int64), 0.0)
    advance_pressures(params, hydraulics, np.zeros(4))
    restore_wear(params, np.zeros(1, WEAR_STATE)[0], learned)
    mass_by_law(params, learned["wear"]["regressors"], 0)
    for gain in (brake_gain, brake_gain_per_bar):
        gain(params, 0)
    model, numbers = params["dust_model"][0], params["dust_numbers"][0]
    features = np.ones((1, len(params["dust_low"][0])))
    for kind in (model, int(model)):
        emission_factor(kind, numbers, features[0])
        emission_factors(kind, numbers, features, np.zeros(1))
    inside(params["dust_low"][0], params["dust_high"][0], features[0])
    law_term(features[0], 0)
    network_input(features[0], 0)
    node_below(numbers, 0, 1.0)
