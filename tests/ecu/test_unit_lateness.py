"""The line that tells of hydraulics which are not CONFIG's, and when doctor is sure of it."""

import math
from pathlib import Path

import numpy as np
import pytest

from brakelab.rig.vehicle_node import live_through, new_node
from brakelab.simulation.closed_loop import START_NS, new_loop, plans
from brakelab.simulation.configured import shipped
from brakelab.simulation.scenario_car import with_draw
from brakelab.simulation.vehicle_bus import N_TRUTH
from ecu.algorithm.step import step
from ecu.bus.freshness import begin_cycle, end_cycle
from ecu.bus.receive import receive
from ecu.bus.transmit import transmit
from ecu.contract.records import INPUTS, OUTPUTS
from ecu.contract.signals import CALLIPER_PRESSURE, CYCLE_NS
from ecu.doctor import hydraulics
from ecu.recording.ring import RingReader
from ecu.settings.config import load_config, new_params
from ecu.unit_lateness import lateness_line, sure_lateness

from .watch.conftest import loop, rings

__all__ = ["loop", "rings"]

REMEDY = "correct dead times and lags of [hydraulics]"
SUV = Path(__file__).parents[2] / "config" / "suv.toml"
SEEDS = (0, 1, 2)


@pytest.mark.parametrize(
    ("rise", "fall", "line"),
    [
        (math.nan, math.nan, ""),
        (0.070, 0.050, ""),
        (0.126, math.nan, "pressures rise 126 ms after their demands (CONFIG: 63 ms): "),
        (
            *(0.030, 0.120),
            "pressures rise 30 ms after their demands (CONFIG: 63 ms) and fall 120 ms after their demands "
            "(CONFIG: 60 ms): ",
        ),
    ],
)
def test_what_is_said_of_the_hydraulics(rise: float, fall: float, line: str) -> None:
    outputs = np.zeros(1, OUTPUTS)[0]
    outputs["pressure_lateness_rise"], outputs["pressure_lateness_fall"] = rise, fall
    assert lateness_line(new_params(load_config(SUV))[0], outputs) == line + (line and REMEDY)


def brake_again_and_again(ring, times: float, stalls: float, longest: int, seed: int) -> None:
    """Publish three brakings of a car that is `times` as late as CONFIG says and is held up by the machine.

    As `brake-ecu vehicle`, that makes up for missed periods at once. `stalls` of the cycles are followed by 1
    to `longest` in which it stands still.
    """
    scenario, random = with_draw(shipped("repeated"), "nominal"), np.random.default_rng(1000 + seed)
    node, plan, truth = new_node(scenario, seed), plans(), np.empty(N_TRUTH)
    car, ecu = node.side, new_loop(scenario, load_config(SUV), seed).sides
    for answer in (car.vehicle.params[0]["build_up"], car.vehicle.params[0]["release"]):
        answer *= (times**2, times, times)
    waiting, lived, awake = 0, -1, 0
    for k in range(4000):
        now_ns, sent = START_NS + k * CYCLE_NS, 0
        if k >= awake:
            periods, lived = k - lived, k
            sent = live_through(plan, car, node.noise, now_ns, waiting, periods, k, truth, False)
            if sent < 0:
                return
            car.to_ecu.arrived["stamp_ns"][:sent] = now_ns
            awake = k + 1 + (int(random.integers(1, longest + 1)) if random.random() < stalls else 0)
            waiting = 0
        begin_cycle(ecu.inputs[0], now_ns, CYCLE_NS)
        receive(plan.ecu_hears, ecu.ecu_reception, car.to_ecu.arrived, 0, sent, ecu.inputs[0])
        end_cycle(ecu.inputs[0], ecu.ecu_reception.freshness)
        step(ecu.params, ecu.state, ecu.inputs, ecu.outputs)
        ring.outputs[:], ring.inputs[:], ring.estimate[:] = ecu.outputs, ecu.inputs, ecu.state["estimate"]
        ring.publish(1)
        due = transmit(plan.ecu_sends, ecu.ecu_sent, ecu.output_vector, k, ecu.ecu_frames)
        ecu.ecu_frames["stamp_ns"][:due] = now_ns + CYCLE_NS // 2
        car.frames_in[waiting : waiting + due] = ecu.ecu_frames[:due]
        waiting += due


# times of dead time and lag; share of cycles with a stall, its length at most
# -> what is learned is off, in how many drives; doctor fails, in how many
MACHINES = {
    "sound": (1.0, 0.0, 1, 0, 0),
    "sound, busy": (1.0, 0.03, 6, 1, 0),
    "sound, very busy": (1.0, 0.2, 4, 2, 0),
    "late": (2.0, 0.0, 1, 3, 3),
    "soon": (0.5, 0.0, 1, 3, 3),
    "late, busy": (2.0, 0.03, 6, 3, 3),
    "late, very busy": (2.0, 0.1, 6, 3, 0),
}


@pytest.mark.compiled
@pytest.mark.parametrize(("times", "stalls", "longest", "off", "fails"), MACHINES.values(), ids=MACHINES)
def test_a_sound_car_on_a_busy_machine_is_not_accused(loop, times, stalls, longest, off, fails) -> None:
    checks = []
    for seed in SEEDS:
        ring = loop(100 + seed, configuration=load_config(SUV).model_dump())
        brake_again_and_again(ring, times, stalls, longest, seed)
        checks.append(hydraulics(RingReader(ring.ring.path)))
    print([check.found for check in checks])
    assert sum("after their demands" in check.found for check in checks) == off
    assert sum(not check.good for check in checks) == fails
    assert all(REMEDY.endswith(check.remedy) and check.remedy for check in checks if not check.good)
    assert sum("not certain" in check.found for check in checks) == off - fails


@pytest.mark.parametrize("every", [1, 2, 5])
def test_pressures_that_come_at_a_slower_rate_are_judged_too(every, params) -> None:
    """Of a unit that is late by 0.12 s, without noise."""
    outputs, inputs = np.zeros(1500, OUTPUTS), np.zeros(1500, INPUTS)
    demand = np.where(np.arange(1500) % 500 < 200, 20.0, 0.0)
    outputs["pressure_demand"] = np.minimum(demand, np.arange(1500) % 500 * 0.8)[:, None]
    inputs["dt_ns"] = CYCLE_NS
    pressures = slice(CALLIPER_PRESSURE, CALLIPER_PRESSURE + 4)
    inputs["value"][12:, pressures] = outputs["pressure_demand"][:-12]
    inputs["new"][::every, pressures] = 1
    shown = sure_lateness(params[0], outputs, inputs, np.zeros((1500, 4)))
    assert shown["pressure_lateness_rise"] == pytest.approx(0.12, abs=0.02)
