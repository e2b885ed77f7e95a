"""Fault bits of `active_faults` and `active_faults_2`, each with its meaning and remedy.

The table is the single source: events, reports and docs/faults.md repeat it. A mask here holds both words: bits
0 to 31 are those of `active_faults`, bits 32 to 62 those of `active_faults_2` from its bit 0 on.
"""

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.contract.signals import CORNERS

WORDS: Final = ("active_faults", "active_faults_2")
WORD: Final = 32
"""Bits of a word."""


class Fault(NamedTuple):
    """One bit of the mask."""

    bit: int
    name: str
    meaning: str
    remedy: str


WHEEL_SPEED_LOST: Final = 1 << 0
IMU_LOST: Final = 1 << 1
PRESSURE_LOST: Final = 1 << 2
REQUEST_LOST: Final = 1 << 3
STEERING_LOST: Final = 1 << 4
PEDAL_IMPLAUSIBLE: Final = 1 << 5
HYDRAULICS_NOT_READY: Final = 1 << 6
DEMAND_LIMITED: Final = 1 << 7
FILTER_RESET: Final = 1 << 8
PEDAL_LOST: Final = 1 << 9
MOTOR_TORQUE_LOST: Final = 1 << 10
BRAKE_FADE: Final = 1 << 11
WHEEL_SLIPS: Final = 1 << 12
ACCUMULATOR_LOW: Final = 1 << 13
WHEEL_SPEED_IMPLAUSIBLE: Final = 1 << 14
ACCEL_IMPLAUSIBLE: Final = 1 << 15
BUS_OFF: Final = 1 << 16
ERROR_PASSIVE: Final = 1 << 17
FOREIGN_SENDER: Final = 1 << 18
SEND_FAILED: Final = 1 << 19
FRAMES_DROPPED: Final = 1 << 20
LATE: Final = 1 << 21
COMPILED: Final = 1 << 22
MOTOR_SHORT: Final = 1 << 23
PRESSURE_NOT_FOLLOWING: Final = 1 << 24
LEARNED_AT_BOUND: Final = 1 << 25
LEARNING_GIVEN_UP: Final = 1 << 26
NOT_KEPT: Final = 1 << 27
E2E_REJECTIONS: Final = 1 << 28
BRAKE_FAILED: Final = 1 << 29
DEMAND_LOST: Final = 1 << 30


def _corners(stem: str, meaning: str, remedy: str) -> list[tuple[str, str, str]]:
    return [(f"{stem}_{corner}", meaning, remedy) for corner in CORNERS]


# An input that the others contradict is left out, or corrected where the text says so: in the order of the bits.
_CONTRADICTED: Final = (
    *_corners("wheel_speed", "turns as the other wheels and the car's motion do not allow, or is far noisier than configured: it is left out; all four: used where they are scaled alike, else left out", "check that wheel's sensor, its wires and the tyre's size"),
    ("accel_x", "zero or scale have drifted from what wheels and torques show: it is corrected by what is known of them, or left out", "check mounting, supply and calibration of the IMU"),
    ("accel_y", "contradicts yaw rate, steering and wheels: it is left out", "check mounting, supply and calibration of the IMU"),
    ("yaw_rate", "contradicts lateral acceleration, steering and wheels: it is left out", "check mounting, supply and calibration of the IMU"),
    ("steering_angle", "contradicts yaw rate, lateral acceleration and wheels: it is left out", "check the zero and the ratio of the steering sensor"),
    *_corners("calliper_pressure", "differs from the pressure demanded while the car brakes as demanded: the pressure that follows from the demand stands for it", "check that wheel's pressure sensor and valve, and the receiver of PressureDemand*"),
    *_corners("motor_torque", "differs from what was demanded of that motor, or from what the car usually does at that torque, or drives while the brakes are applied: it is left out", "check the inverter and the sender of Motor*"),
    ("vehicle_speed", "contradicts the wheels and the acceleration: it is left out", "check the receiver or the sensor of the speed over ground"),
    ("accumulator_pressure", "less than a calliper's pressure: it limits nothing", "check the sender of HydraulicStatus"),
    ("reverse", "the car drives forwards: too fast for a reverse gear, engaged while moving, or decelerating as only forwards; it is taken for 0", "check the sender of reverse"),
    ("abs_active", "stands for longer than an ABS acts, or without a brake application: it is taken for 0", "check the sender of abs_active"),
    ("esp_active", "stands for longer than an ESP acts: it is taken for 0", "check the sender of esp_active"),
    ("accelerator_position", "does not return through several brake applications: what it returned to last counts as its rest", "check the pedal sensor and the factor and offset of the map"),
)  # fmt: skip
IMPLAUSIBLE: Final = {row[0]: 1 << (WORD + place) for place, row in enumerate(_CONTRADICTED)}
"""Bit of each input that is watched, by its name."""
GRIP_EXCEEDED: Final = 1 << (WORD + 29)
REAR_HELD: Final = 1 << (WORD + 30)

FAULTS: Final = (
    Fault(WHEEL_SPEED_LOST, "wheel speed lost", "a wheel speed is stale or invalid", "check the sender of WheelSpeed*"),
    Fault(IMU_LOST, "IMU lost", "longitudinal acceleration is stale or invalid", "check the sender of Imu"),
    Fault(PRESSURE_LOST, "pressure lost", "a calliper pressure is stale or invalid", "check CalliperPressure*"),
    Fault(REQUEST_LOST, "request lost", "neither the pedal, nor its switch, nor a valid deceleration demand arrives", "check BrakeRequest"),
    Fault(STEERING_LOST, "steering lost", "steering angle, yaw rate or lateral acceleration is stale: straight driving is assumed", "check Steering, Imu"),
    Fault(PEDAL_IMPLAUSIBLE, "pedal implausible", "position above 5 % while the pedal is reported free", "check the pedal sensor"),
    Fault(HYDRAULICS_NOT_READY, "hydraulics not ready", "HydraulicStatus reports not ready", "check the hydraulic unit"),
    Fault(DEMAND_LIMITED, "demand limited", "the output limiter replaced or cut a demand", "compare friction and demand in the report"),
    Fault(FILTER_RESET, "filter reset", "an estimator met a value that is not finite and began anew", "look at the inputs at that time"),
    Fault(PEDAL_LOST, "pedal lost", "the pedal position is stale or invalid: it is taken to stay as it was while the switch of the pedal is closed", "check the sender of BrakeRequest"),
    Fault(MOTOR_TORQUE_LOST, "motor torque lost", "a motor torque that was reported before is stale: nothing is learned from its wheel", "check the sender of Motor*"),
    Fault(BRAKE_FADE, "compensation at its limit", "friction more than 30 % below its base, or a pressure that cannot be had: the car brakes less than the pedal asks for", "brake earlier and let the brakes cool; look at the linings and at friction in the report"),
    Fault(WHEEL_SLIPS, "wheel slips", "a wheel ran past its tyre's range: its pressure demand is held back", "look at slip in the report; an ABS is not part of this ECU"),
    Fault(ACCUMULATOR_LOW, "accumulator low", "the accumulator holds less than is demanded: the demand is cut to it; one that reads below 10 bar cuts nothing", "check the hydraulic unit and the sender of HydraulicStatus"),
    Fault(WHEEL_SPEED_IMPLAUSIBLE, "wheel speed implausible", "a wheel that brakes turns faster than the car, or its speed fell faster than a wheel's can: then it is left out", "check that wheel's sensor and its wires"),
    Fault(ACCEL_IMPLAUSIBLE, "acceleration implausible", "the accelerometer moved against the wheels and the torques of the brakes: its reading is not used", "check the mounting and the supply of the IMU"),
    Fault(BUS_OFF, "bus off", "the CAN controller went off the bus", "check wiring; ip link set DEV type can restart-ms 100"),
    Fault(ERROR_PASSIVE, "error passive", "the CAN controller counts many errors", "check termination and bit rate"),
    Fault(FOREIGN_SENDER, "foreign sender", "someone else sends one of our identifiers", "stop the other sender"),
    Fault(SEND_FAILED, "send failed", "the kernel refused a frame", "raise txqueuelen; check the bus load"),
    Fault(FRAMES_DROPPED, "frames dropped", "the kernel dropped received frames", "check the load of the machine"),
    Fault(LATE, "late", "a cycle missed its deadline", "a `slow` line of the log names the stage that took too long; without one the loop woke late: see `brake-ecu doctor` for real-time rights"),
    Fault(COMPILED, "compiled in operation", "a kernel was compiled after the start", "warm the cache: python -m ecu.warm"),
    Fault(MOTOR_SHORT, "motor gives less than demanded", "a motor gave less than demanded within the limit that it reports: the linings brake in its place until the brakes are released", "compare motor_demand, motor_torque and motor_limit of that wheel; check the inverter"),
    Fault(PRESSURE_NOT_FOLLOWING, "pressure does not follow demand", "a calliper pressure is not what was demanded while the three others are: it is not used, that of the other side stands for it", "check that wheel's pressure sensor and valve, and the receiver of PressureDemand*"),
    Fault(LEARNED_AT_BOUND, "learned value at its bound", "a friction, mass, stiffness, motor scale, radius, zero or unreported drag would be learned beyond what a car can be: it stays at its bound", "compare the configuration with the car: mass, tyres, brakes; check the sensors; map the torque of what brakes beside the linings"),
    Fault(LEARNING_GIVEN_UP, "learning given up", "what was learned predicted the last brake applications worse than the configured friction: it was forgotten and is learned anew", "look at the prediction in the report; check pressures, accelerometer and motor torques against each other"),
    Fault(NOT_KEPT, "nothing is kept", "the side process is away or hangs, or the state folder cannot be written: what is learned now ends with this run", "it is started again by itself; look at the disk and at the log lines before"),
    Fault(E2E_REJECTIONS, "E2E rejections", "of a protected message more frames come than its sender makes, or many are rejected: nothing is learned, and a request in doubt is not lowered", "look for a second sender of that message and for disturbances of the bus: `brake-ecu doctor -i -c` counts them"),
    Fault(BRAKE_FAILED, "brake gives nothing", "a calliper has far less pressure than demanded, and the car brakes less by its share: the other wheels and the motors brake in its place", "stop; look for a leak, a valve that does not open, or a line that is shut"),
    Fault(DEMAND_LOST, "automated demand lost", "an automated demand that was followed is stale or invalid without having been withdrawn: it is kept for 0.1 s while its frames come, then the pedal alone brakes", "check the sender of decel_demand: range, decel_demand_valid, cycle"),
    *(Fault(IMPLAUSIBLE[name], f"{name} implausible", meaning, remedy) for name, meaning, remedy in _CONTRADICTED),
    Fault(GRIP_EXCEEDED, "demand beyond grip", "more deceleration is demanded than road and tyres give, as wheels that slip show: pressure is not raised for what is missing", "brake earlier; compare decel_demand_total and grip_limit in the report"),
    Fault(REAR_HELD, "trailing axle held back", "its wheels slip more than those of the leading axle: torque has moved to the leading axle", "compare slip and friction of both axles in the report"),
)  # fmt: skip

DEGRADING: Final = (
    WHEEL_SPEED_LOST
    | IMU_LOST
    | PRESSURE_LOST
    | PEDAL_LOST
    | ACCEL_IMPLAUSIBLE
    | BUS_OFF
    | FOREIGN_SENDER
    | PRESSURE_NOT_FOLLOWING
    | E2E_REJECTIONS
    | BRAKE_FAILED
)


def fault_mask(outputs: Mapping[str, Any] | NDArray[np.void] | np.void) -> NDArray[np.int64]:
    """Return the mask of both words, of any shape, from `active_faults` and, where there, `active_faults_2`.

    Args:
        outputs: columns by name, or a record or records with these fields; NaN counts as no fault.
    """
    names = outputs.dtype.names if isinstance(outputs, np.ndarray | np.void) else outputs
    mask = np.nan_to_num(np.asarray(outputs["active_faults"])).astype(np.int64)
    if names is not None and "active_faults_2" in names:
        mask = mask | np.nan_to_num(np.asarray(outputs["active_faults_2"])).astype(np.int64) << WORD
    return np.asarray(mask, np.int64)


def fault_names(mask: int) -> list[str]:
    """Return the names of the faults in a mask."""
    return [fault.name for fault in FAULTS if mask & fault.bit]
