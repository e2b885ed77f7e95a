"""A row of a result: the outputs as a vector, then measured inputs as received, NaN where not usable."""

from typing import Final

from ecu.contract.signals import (
    ACCEL_Y,
    ACCELERATOR_POSITION,
    MOTOR_TORQUE,
    N_OUTPUTS,
    PEDAL_POSITION,
    STEERING_ANGLE,
    WHEEL_SPEED,
    WHEEL_TORQUE_Y,
    YAW_RATE,
)

MEASURED_INPUTS: Final = (
    *range(MOTOR_TORQUE, MOTOR_TORQUE + 4),
    ACCELERATOR_POSITION,
    PEDAL_POSITION,
    *range(WHEEL_SPEED, WHEEL_SPEED + 4),
    *range(WHEEL_TORQUE_Y, WHEEL_TORQUE_Y + 4),
    ACCEL_Y,
    YAW_RATE,
    STEERING_ANGLE,
)
N_ROW: Final = N_OUTPUTS + len(MEASURED_INPUTS)
