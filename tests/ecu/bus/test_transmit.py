"""What is sent when, and that it comes back as it was."""

from collections import Counter
from pathlib import Path

import e2e.p01
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ecu.bus.database import attribute, load_database
from ecu.bus.freshness import begin_cycle, target_dtype
from ecu.bus.receive import new_reception, receive
from ecu.bus.receive_plan import contract_listen_plan, contract_receive_plan
from ecu.bus.transmit import contract_transmit_plan, frame_buffer, new_transmission, transmit
from ecu.contract.records import INPUTS, new_record
from ecu.contract.signals import INPUT, INPUT_SIGNALS, N_INPUTS, N_OUTPUTS, OUTPUT, OUTPUT_COLUMNS

ROOT = Path(__file__).parents[3]
CONTRACT = ROOT / "dbc" / "brake_ecu.dbc"
DATABASE = load_database(CONTRACT)
BY_ID = {message.frame_id: message for message in DATABASE.messages}
ECU = contract_transmit_plan(CONTRACT, "BrakeEcu")
VEHICLE = contract_transmit_plan(CONTRACT, "Vehicle")
RECEIVE = contract_receive_plan(CONTRACT)
LISTEN = contract_listen_plan(CONTRACT)
CYCLE_NS = 10_000_000


def sent_in(cycles: int, values: np.ndarray, plan=ECU) -> Counter[str]:  # type: ignore[no-untyped-def, type-arg]
    transmission, frames = new_transmission(plan), frame_buffer(plan)
    names: Counter[str] = Counter()
    for cycle in range(cycles):
        count = transmit(plan, transmission, values, cycle, frames)
        names.update(BY_ID[int(frame["can_id"])].name for frame in frames[:count])
    return names


def test_a_second_of_the_ecu() -> None:
    assert sent_in(100, np.zeros(N_OUTPUTS)) == {
        "PressureDemandFront": 100,
        "PressureDemandRear": 100,
        "MotorDemandFront": 100,
        "MotorDemandRear": 100,
        "BlcfFront": 50,
        "BlcfRear": 50,
        "EcuStatus": 10,
        "EcuFaults": 10,
        "DiscTemperature": 10,
        "PadWear": 1,
        "ParticleEmissions": 1,
    }


def test_optional_messages_are_left_out_without_values() -> None:
    nothing = np.full(N_INPUTS, np.nan)
    optional = {"VehicleSpeed", "WheelForceFront", "WheelForceRear"}
    assert not optional & set(sent_in(100, nothing, VEHICLE))
    nothing[INPUT["vehicle_speed"]] = 10.0
    nothing[INPUT["wheel_torque_y_rr"]] = 1.0
    counts = sent_in(100, nothing, VEHICLE)
    assert (counts["VehicleSpeed"], counts["WheelForceFront"], counts["WheelForceRear"]) == (100, 0, 100)


def test_every_frame_passes_the_e2e_package_and_counts() -> None:
    transmission, frames = new_transmission(ECU), frame_buffer(ECU)
    counters: dict[str, list[int]] = {}
    for cycle in range(60):
        count = transmit(ECU, transmission, np.zeros(N_OUTPUTS), cycle, frames)
        for frame in frames[:count]:
            message = BY_ID[int(frame["can_id"])]
            data_id = attribute(message, "E2EDataId")
            if data_id:
                payload = frame["data"][:8].tobytes()
                assert e2e.p01.e2e_p01_check(bytearray(payload), data_id, length=8)
                counters.setdefault(message.name, []).append(payload[1] & 0xF)
    assert counters["PressureDemandFront"] == [k % 15 for k in range(60)]
    assert counters["BlcfRear"] == [k % 15 for k in range(30)]


@given(value=st.floats(-1e6, 1e6) | st.sampled_from([np.inf, -np.inf]))
def test_cantools_reads_what_is_sent_limited_to_its_range(value: float) -> None:
    frames = frame_buffer(VEHICLE)
    count = transmit(VEHICLE, new_transmission(VEHICLE), np.full(N_INPUTS, value), 85, frames)
    for frame in frames[:count]:
        message = BY_ID[int(frame["can_id"])]
        decoded = message.decode(frame["data"][: message.length].tobytes(), decode_choices=False)
        for signal in message.signals:
            if signal.name in INPUT:
                nearest = min(max(value, float(signal.minimum or 0.0)), float(signal.maximum or 0.0))
                assert decoded[signal.name] == pytest.approx(nearest, abs=0.5001 * signal.scale)  # type: ignore[index,call-overload]


@given(fractions=st.lists(st.floats(0.0, 1.0), min_size=N_INPUTS, max_size=N_INPUTS))
def test_inputs_come_back_within_half_a_step(fractions: list[float]) -> None:
    low = np.array([signal.low for signal in INPUT_SIGNALS])
    high = np.array([signal.high for signal in INPUT_SIGNALS])
    values = low + np.array(fractions) * (high - low)
    frames, transmission = frame_buffer(VEHICLE), new_transmission(VEHICLE)
    inputs, reception = new_record(INPUTS), new_reception(RECEIVE)
    for cycle in (84, 85):  # both phases of 20 ms, and the one of Ambient
        begin_cycle(inputs[0], cycle * CYCLE_NS, CYCLE_NS)
        count = transmit(VEHICLE, transmission, values, cycle, frames)
        frames["stamp_ns"] = cycle * CYCLE_NS
        assert receive(RECEIVE, reception, frames, 0, count, inputs[0]) == count
    step = {signal.name: signal.scale for message in DATABASE.messages for signal in message.signals}
    for place, signal in enumerate(INPUT_SIGNALS):
        if signal.message:
            assert inputs["value"][0, place] == pytest.approx(values[place], abs=0.5001 * step[signal.name])


def test_outputs_come_back_and_nan_is_not_available() -> None:
    values = np.full(N_OUTPUTS, np.nan)
    values[OUTPUT["pressure_demand_fl"]] = 43.21
    values[OUTPUT["pressure_demand_valid"]] = 1.0
    values[OUTPUT["motor_demand_rr"]] = -812.25
    values[OUTPUT["mu_b_rl"]] = 0.4321
    values[OUTPUT["active_faults"]] = float(1 << 31)
    values[OUTPUT["particles_per_km"]] = 1.5e10
    frames, transmission = frame_buffer(ECU), new_transmission(ECU)
    heard, reception = np.zeros(1, target_dtype(N_OUTPUTS)), new_reception(LISTEN)
    new = np.zeros(N_OUTPUTS)
    for cycle in range(100):
        begin_cycle(heard[0], cycle * CYCLE_NS, CYCLE_NS)
        count = transmit(ECU, transmission, values, cycle, frames)
        frames["stamp_ns"] = cycle * CYCLE_NS
        assert receive(LISTEN, reception, frames, 0, count, heard[0]) == count
        new += heard["new"][0]
    came = {name: float(heard["value"][0, k]) for k, name in enumerate(OUTPUT_COLUMNS) if new[k]}
    assert came == pytest.approx(
        {name: value for name, value in zip(OUTPUT_COLUMNS, values, strict=True) if value == value},
        rel=1e-7,
        abs=1e-9,
    )
