"""What an input that is lost, or found wrong, costs: friction is learned on, and the speed is taken back."""

from functools import cache

import numpy as np
import pytest

from brakelab.simulation.closed_loop import Drive, new_loop, run
from brakelab.simulation.configured import configured
from brakelab.simulation.scenario import Scenario
from brakelab.stretches import stretches
from brakelab.studies.lies_cell import brake_force
from ecu.contract.faults import IMPLAUSIBLE, MOTOR_TORQUE_LOST, PRESSURE_LOST, fault_mask
from ecu.contract.signals import CORNERS

DECEL, LOWEST_SPEED = 4.0, 5.0  # m/s^2, m/s
FRONT, REAR = CORNERS[:2], CORNERS[2:]


@cache
def drive(lost: tuple[str, ...], friction: int, car: str = "suv", begin: float = 2.0) -> Drive:
    """Brake eight times from 25 m/s by linings of `friction` [%]; from `begin` [s] on inputs are `lost`."""
    phases = [{"kind": "coast", "seconds": 2.5}]
    for _ in range(8):
        phases += [
            {"kind": "brake", "decel": DECEL, "until_speed": 3.0},
            {"kind": "cruise", "speed": 26.0, "accel": 4.0, "until_speed": 25.0},
        ]
    content = {"plant": "suv", "initial_speed": 25.0, "phase": phases, "blending": car == "suv-blended"}
    content["fault"] = [{"kind": "invalid", "t": begin, "signal": list(lost)}] if lost else []
    content["car"] = {"friction_scale_front": f"{friction} %", "friction_scale_rear": f"{friction} %"}
    return run(new_loop(Scenario.model_validate(content), configured(car), 1))


def last_force(found: Drive) -> float:
    """Return the mean force of linings and motors in the last braking over what is demanded."""
    on = (found.truth["decel_demand"] > 0.9 * DECEL) & (found.truth["vehicle_speed"] > LOWEST_SPEED)
    begin, end = [row for row in stretches(on).tolist() if row[1] - row[0] > 100][-1]
    return float(np.mean(brake_force(found, configured("suv").vehicle.mass)[begin + 60 : end])) / DECEL


@pytest.mark.parametrize("friction", [75, 120])
@pytest.mark.parametrize("lost", [CORNERS[:1], FRONT, REAR, CORNERS], ids=["one", "front", "rear", "all"])
def test_without_pressures_friction_is_learned_by_those_that_are_demanded(lost, friction) -> None:
    found = drive(tuple(f"calliper_pressure_{corner}" for corner in lost), friction)
    assert int(fault_mask(found.outputs)[-1]) & PRESSURE_LOST
    assert last_force(found) == pytest.approx(last_force(drive((), friction)), rel=0.03)


@pytest.mark.parametrize("friction", [75, 120])
def test_without_a_motor_s_torque_the_linings_of_its_wheel_go_on_learning(friction) -> None:
    """It is lost while it brakes; no other motor is blamed."""
    found = drive(("motor_torque_fl",), friction, "suv-blended", 5.0)
    faults = int(np.bitwise_or.reduce(fault_mask(found.outputs).astype(int)))
    assert faults & MOTOR_TORQUE_LOST
    assert not any(faults & IMPLAUSIBLE[f"motor_torque_{corner}"] for corner in CORNERS)
    assert last_force(found) == pytest.approx(last_force(drive((), friction, "suv-blended")), rel=0.03)


@pytest.mark.parametrize("phase", range(5))
@pytest.mark.parametrize("reads", [0.0, 60.0])
def test_a_speed_over_ground_that_is_found_wrong_has_not_moved_the_car_s(reads: float, phase: int) -> None:
    """It jumps in a braking, at any cycle of a window of the observer."""
    fault = {"kind": "set", "t": 5.0 + 0.01 * phase, "signal": ["vehicle_speed"], "amount": reads}
    phases = [{"kind": "coast", "seconds": 3.0}, {"kind": "brake", "decel": DECEL, "until_speed": 3.0}]
    content = {"plant": "suv", "initial_speed": 28.0, "phase": phases, "fault": [fault]}
    content["vehicle_speed"] = "optical"
    found = run(new_loop(Scenario.model_validate(content), configured("suv"), 1))
    after = (found.t > 5.3) & (found.truth["vehicle_speed"] > LOWEST_SPEED)
    assert fault_mask(found.outputs)[after].astype(int)[0] & IMPLAUSIBLE["vehicle_speed"]
    assert np.abs(found.outputs["vehicle_speed"] - found.truth["vehicle_speed"])[after].max() < 0.5
