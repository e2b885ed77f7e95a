"""The ECU as an FMU gives what `replay` gives, to the bit; absent and invalid signals are what they say."""

from pathlib import Path

import numpy as np
import pytest

from brakelab.replay.engine import new_ecu
from brakelab.replay.log import replay_log
from brakelab.replay.quality import Findings
from brakelab.replay.source import load_source
from brakelab.simulation.closed_loop import new_loop, run
from brakelab.simulation.scenario import load_scenario
from brakelab.simulation.simulate import write_columns
from ecu.contract.faults import IMU_LOST, PRESSURE_LOST, WHEEL_SPEED_LOST
from ecu.contract.signals import (
    ACTIVE,
    CORNERS,
    FAILED,
    INPUT_SIGNALS,
    N_OUTPUTS,
    OUTPUT_COLUMNS,
    READY,
    STARTING,
)
from ecu.settings.config import load_config, new_params
from ecu.settings.resources import resource

from .conftest import Make
from .master import OK, Fmu, Instance

pytestmark = pytest.mark.study

DRIVING = {
    **{f"wheel_speed_{corner}": 60.0 for corner in ("fl", "fr", "rl", "rr")},
    **{f"calliper_pressure_{corner}": 0.3 for corner in ("fl", "fr", "rl", "rr")},
    **{f"motor_torque_{corner}": 0.0 for corner in ("fl", "fr", "rl", "rr")},
    **{f"motor_limit_{corner}": 0.0 for corner in ("fl", "fr", "rl", "rr")},
    **dict.fromkeys(("accel_x", "accel_y", "yaw_rate", "steering_angle", "pedal_position"), 0.0),
    **dict.fromkeys(("pedal_pressed", "decel_demand", "decel_demand_valid", "accelerator_position"), 0.0),
    **dict.fromkeys(("reverse", "abs_active", "esp_active", "rain"), 0.0),
    "accumulator_pressure": 180.0,
    "hydraulic_ready": 1.0,
    "ambient_temperature": 20.0,
}
"""80 km/h, straight on; nobody brakes."""
FAULTS = ("mode", "active_faults")


def stepped(ecu: Instance, cycles: int) -> dict[str, float]:
    for _ in range(cycles):
        assert ecu.step() == OK
    names = [*FAULTS, "pressure_demand_fl", "pressure_demand_valid"]
    return dict(zip(names, ecu.get(names).tolist(), strict=True))


@pytest.mark.parametrize(
    ("scenario", "config"), [("stop-1", "suv"), ("blending-40", "suv-blended"), ("rain", "suv")]
)
def test_outputs_are_those_of_replay_to_the_bit(
    make_ecu: Make, tmp_path: Path, scenario: str, config: str
) -> None:
    """Both get the inputs of `simulate`, as it writes them: a finite value is a sample, NaN is none."""
    settings = load_config(resource(f"config/{config}.toml"))
    drive = run(new_loop(load_scenario(resource(f"config/scenarios/{scenario}.toml")), settings, 0))
    path = tmp_path / "drive.parquet"
    write_columns(path, drive.t, drive.inputs, {})
    params = new_params(settings)
    params["transmit"] = 1
    replayed = replay_log(
        path, new_ecu(params, None), load_source(None), None, Findings(path), lambda size: None
    )
    expected = np.concatenate([rows.values[:, :N_OUTPUTS].copy() for rows in replayed])
    fmu = make_ecu(config)
    assert [name.removeprefix("estimate.") for name in fmu.outputs] == list(OUTPUT_COLUMNS)
    with fmu.instantiate() as ecu:
        assert ecu.initialise() == OK
        rows = []
        for k in range(len(drive.t)):
            assert ecu.put({name: float(drive.inputs[name][k]) for name in fmu.inputs}) == OK
            assert ecu.step() == OK
            rows.append(ecu.get(fmu.outputs))
    found = np.array(rows)
    assert np.nanmax(found[:, OUTPUT_COLUMNS.index("pressure_demand_fl")]) > 20.0
    assert found.tobytes() == np.ascontiguousarray(expected).tobytes()


def test_before_the_first_step_nothing_is_demanded(suv: Fmu) -> None:
    with suv.instantiate() as ecu:
        assert ecu.initialise() == OK
        found = dict(zip(suv.outputs, ecu.get(suv.outputs).tolist(), strict=True))
    assert found["mode"] == STARTING
    assert [found[f"pressure_demand_{corner}"] for corner in ("fl", "fr", "rl", "rr")] == [0.0] * 4
    assert found["pressure_demand_valid"] == found["motor_demand_valid"] == 0.0
    assert np.isnan(found["mu_b_fl"])


def test_it_brakes_when_it_is_asked_to(suv: Fmu) -> None:
    with suv.instantiate() as ecu:
        ecu.put(DRIVING)
        ecu.initialise()
        assert stepped(ecu, 150) == {
            "mode": READY,
            "active_faults": 0.0,
            "pressure_demand_fl": 0.0,
            "pressure_demand_valid": 1.0,
        }
        ecu.put({"decel_demand": 4.0, "decel_demand_valid": 1.0})
        asked = stepped(ecu, 20)
    assert asked["mode"] == ACTIVE
    assert 10.0 < asked["pressure_demand_fl"] < 60.0


def test_a_shadow_flags_its_demands_invalid(suv: Fmu) -> None:
    with suv.instantiate() as ecu:
        assert ecu.put_truth("armed", False) == OK
        ecu.put({**DRIVING, "decel_demand": 4.0, "decel_demand_valid": 1.0})
        ecu.initialise()
        asked = stepped(ecu, 150)
    assert asked["pressure_demand_fl"] > 15.0
    assert asked["pressure_demand_valid"] == 0.0


ABSENT = [
    # signal, what it becomes, fault, cycles until then: its time-out, or at once
    ("wheel_speed_fl", np.nan, WHEEL_SPEED_LOST, 11),
    ("accel_x", np.nan, IMU_LOST, 11),
    ("calliper_pressure_rr", np.nan, PRESSURE_LOST, 11),
    ("wheel_speed_fl", np.inf, WHEEL_SPEED_LOST, 1),
    ("accel_x", 41.0, IMU_LOST, 1),
    ("calliper_pressure_rr", -np.inf, PRESSURE_LOST, 1),
]


@pytest.mark.parametrize(("name", "value", "fault", "cycles"), ABSENT)
def test_nan_ages_until_the_time_out_and_what_is_out_of_range_is_invalid_at_once(
    suv: Fmu, name: str, value: float, fault: int, cycles: int
) -> None:
    with suv.instantiate() as ecu:
        ecu.put(DRIVING)
        ecu.initialise()
        assert stepped(ecu, 150)["active_faults"] == 0.0
        ecu.put({name: value})
        before = int(stepped(ecu, cycles - 1)["active_faults"]) if cycles > 1 else 0
        after = int(stepped(ecu, 1)["active_faults"])
        assert (before & fault, after & fault) == (0, fault)
        ecu.put({name: DRIVING[name]})
        assert int(stepped(ecu, 20)["active_faults"]) & fault == 0


@pytest.mark.parametrize("seed", range(3))
def test_no_input_makes_the_ecu_demand_what_no_brake_gives(suv: Fmu, seed: int) -> None:
    random = np.random.default_rng(seed)
    odd = [1e300, -1e300, 1e6, 30.0, 1.0, 0.0, -1.0, 5e-324, np.nan, np.inf, -np.inf]
    names = [f"{demand}_demand_{corner}" for demand in ("pressure", "motor") for corner in CORNERS]
    with suv.instantiate() as ecu:
        ecu.initialise()
        for cycle in range(300):
            values = {name: DRIVING.get(name, 0.0) for name in suv.inputs}
            if cycle >= 100:
                values |= {name: float(random.choice(odd)) for name in suv.inputs if random.random() < 0.3}
            ecu.put(values)
            assert ecu.step() == OK
            pressures, motors = np.split(ecu.get(names), 2)
            assert ((pressures >= 0.0) & (pressures <= 200.0)).all(), pressures
            assert np.isnan(motors).all() or np.isfinite(motors).all()
            assert ecu.get(["mode"])[0] in (0.0, 1.0, 2.0, 3.0, 4.0)


def test_inputs_that_were_never_set_are_absent(suv: Fmu) -> None:
    with suv.instantiate() as ecu:
        assert np.isnan(ecu.get(suv.inputs)).all()
        ecu.initialise()
        found = stepped(ecu, 150)
    assert found["mode"] == FAILED
    assert found["pressure_demand_valid"] == 0.0
    assert int(found["active_faults"]) & WHEEL_SPEED_LOST


def test_every_signal_of_a_frame_is_an_input(suv: Fmu) -> None:
    assert suv.inputs == [signal.name for signal in INPUT_SIGNALS if signal.message]


@pytest.mark.parametrize(("cycles", "faults"), [(2, 0), (10, 0), (50, WHEEL_SPEED_LOST)])
def test_between_communication_points_no_sample_arrives(suv: Fmu, cycles: int, faults: int) -> None:
    """A longer step is several cycles, in the first of which inputs are new; time-outs follow up to 0.3 s."""
    with suv.instantiate() as ecu:
        ecu.put(DRIVING)
        ecu.initialise()
        for _ in range(300 // cycles):
            assert ecu.step(0.01 * cycles) == OK
        assert ecu.time == pytest.approx(0.01 * cycles * (300 // cycles))
        assert int(ecu.get(["active_faults"])[0]) & WHEEL_SPEED_LOST == faults
