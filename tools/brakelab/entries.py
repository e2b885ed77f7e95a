"""Kernels of the laboratory that its commands call, called once: `ecu/build.py` sees from it what to compile.

Those of studies and benchmarks alone are not among them: numba compiles them when they run.
"""

import numpy as np

from brakelab.fmu.vehicle_cycle import go_on, measure
from brakelab.identify.friction.columns import Columns
from brakelab.identify.friction.discovery import library, shoot
from brakelab.identify.friction.dynamometer import new_bench
from brakelab.identify.friction.fit import replayed
from brakelab.identify.friction.trips import drive
from brakelab.identify.tuning.recording import Recording
from brakelab.identify.tuning.replay import replay_errors
from brakelab.mapping.series import FEWEST_FRAMES, read_series
from brakelab.plant.description import read_file
from brakelab.plant.disc import cooling_rate
from brakelab.plant.dynamometer import PRESSURE, new_stop
from brakelab.plant.emission_rig import EMITTED, TRIP, run_trip
from brakelab.plant.friction.constant import Constant
from brakelab.plant.friction.law import START
from brakelab.plant.friction.laws import friction, law_row
from brakelab.plant.linings import Linings
from brakelab.plant.wear import pad_wear
from brakelab.simulation.campaigns.wear_blocks import drawn_car, run_block
from brakelab.simulation.configured import configured, shipped
from brakelab.simulation.ecu_inputs import ecu_inputs
from brakelab.simulation.vehicle_bus import N_TRUTH, new_noise, new_values, new_vehicle
from brakelab.warm import compile_all
from ecu.bus.database import load_database
from ecu.bus.freshness import target_dtype
from ecu.contract.records import FRAME, INPUTS, new_record
from ecu.contract.signals import N_OUTPUTS
from ecu.settings.resources import resource


def call_every_entry() -> None:
    """Call what `simulate`, `rig`, `demo`, `replay`, `map`, `tune`, `lab`, `identify` and FMUs call."""
    compile_all()
    _run_laboratory()
    recording = Recording(new_record(INPUTS, 2), np.ones((2, 4)), np.zeros(2, np.int64))
    replay_errors([recording], [configured()])
    ecu_inputs(new_record(FRAME), 1)
    database = load_database(resource("dbc/brake_ecu.dbc"))
    message = database.messages[0]
    frames = new_record(FRAME, FEWEST_FRAMES)
    frames["can_id"], frames["length"] = message.frame_id, message.length
    frames["stamp_ns"] = np.arange(FEWEST_FRAMES)
    read_series([frames], database)
    cooling_rate(1e-3, 1e-4, 10.0, 0.0)
    vehicle = new_vehicle(shipped("stop-1"), 0)
    noise, values, row = new_noise(0), new_values(), np.zeros(N_TRUTH)
    measure(vehicle, noise, values, row)
    go_on(vehicle, np.zeros(1, target_dtype(N_OUTPUTS))[0], noise, values, row)


def _run_laboratory() -> None:
    """Measure, fit and discover on the dynamometer; run a block of wear and a trip of dust."""
    lining = read_file(resource("config/plant/linings.toml"), Linings).lining["A"]
    bench = new_bench(lining, "A", 0)
    rig = bench.rig[0]
    columns = Columns.own(lining, float(rig["mass"] * rig["tyre_radius"] ** 2))
    stops = drive(bench, columns, 0, 1).stops
    new_bench(lining, "A", 0, law="SIM").measure(new_stop(PRESSURE, 10.0, 5.0, 100.0, pressure=20e5))
    law = Constant(law="constant", rig_mass=1000.0, mu=0.4)
    replayed(law, columns.brake, stops, True)
    number, row = law_row(law, columns.brake)
    friction(number, row, row[START], 20e5, 5.0, 0.0, 100.0, 0.0)
    terms = library(stops)
    weights = np.zeros(terms.levels.shape[1] + len(terms.kinds))
    shoot(
        terms.levels, terms.rates, terms.kinds, weights, stops.first, stops.dt, np.zeros_like(stops.pressure)
    )
    stop = np.array([[10.0, 5.0, 3.0, 1.0]])  # from and to m/s, m/s^2, s before
    car = drawn_car(0)
    run_block(car, 0, "", stop, 0.0, np.random.default_rng(0))
    pad_wear(car[0]["wear_row"][0], 1.0)
    trip, out = np.zeros(1, TRIP), np.zeros((1, EMITTED + 1))
    run_trip(car[0], 0, trip[0], np.zeros((1, 3)), np.ones(1), np.ones(1), out)
