"""Estimate of car, tyres and brakes: the one record between estimation and its users.

The observer in use overwrites it once per cycle; control, monitoring and publishing read nothing else of
estimation. Checks that run before estimation read that of the last cycle. It follows from the observers'
states, so neither store nor recording keeps it.
"""

import math

import numpy as np

from ecu.jit import Record, kernel

REMEMBERED = 10

ESTIMATE = np.dtype(
    [
        # The car. Before `started` its speed is meaningless, and slip and force are unknown.
        ("speed", "f8"),  # m/s, negative backwards
        ("accel_x", "f8"),  # specific force in road axes [m/s^2]; modelled where not `measured`
        ("accel_x_model", "f8"),  # the same by the torques of brakes and motors and by drag [m/s^2]
        ("accel_y", "f8"),  # m/s^2
        ("yaw_rate", "f8"),  # rad/s
        ("steering", "f8"),  # rad at the road wheel, and its cosine and sine
        ("cos_steering", "f8"),
        ("sin_steering", "f8"),
        ("lateral_speed", "f8"),  # m/s
        ("tyre_force", "f8"),  # of all tyres along the car (4.16) [N]
        ("mass", "f8"),  # kg
        ("accel_bias", "f8"),  # of the accelerometer [m/s^2]
        ("overrun", "f8"),  # unreported engine drag while braking, over mass [m/s^2]
        ("overrun_power", "f8"),  # of that drag, over mass [W/kg], see `whole_filter.py`; NaN: likewise
        ("sigma_overrun", "f8"),  # m/s^2, of it and of a mean's noise; NaN: only learned where others brake
        ("grip_limit", "f8"),  # ceiling of the brakes' deceleration [m/s^2]; NaN: unknown
        ("sigma_grip_limit", "f8"),  # m/s^2
        ("grip_knee", "f8"),  # exponent of the bend towards it; NaN: the ECU brakes
        ("grip_fall", "f8"),  # share of the grip that is lost beyond it; NaN: likewise
        ("torque_share", "f8"),  # of reported motor torques that counts, by how the car is driven
        ("torques_known", "u1"),  # those of drive and of each brake are known
        # The wheels.
        ("load", "f8", (4,)),  # N
        ("slip", "f8", (4,)),  # (A.6)
        ("force", "f8", (4,)),  # along the wheel [N], ISO 8855: negative while braking
        ("k_f", "f8"),  # tyre model scale (4.18)
        # The brakes.
        ("mu", "f8", (4,)),  # lining friction
        ("sigma", "f8", (4,)),  # its standard deviation
        ("sigma_force", "f8"),  # of the force of all linings at equal pressures, relative; NaN: unknown
        ("observed_s", "f8", (4,)),  # time for which friction was observed in this application [s]
        ("mode", "i8", (4,)),  # of friction: nominal, observing, holding, fault
        ("brake_torque", "f8", (4,)),  # of the linings [N m], >= 0
        ("pressure_zero", "f8", (4,)),  # pressure zero [bar]
        ("pressure_at_rest", "f8", (4,)),  # mean of the readings of a released brake [bar]
        ("floored", "u1", (4,)),  # the sensor reads no pressure below zero
        # Fit of the measurements: test ratios, NaN where nothing was fused in the last window.
        ("test_ratio", "f8", (4,)),  # of the wheels
        ("test_ratio_balance", "f8"),  # of the forces along the car
        ("test_ratio_speed", "f8"),  # of the speed reference
        ("started", "u1"),
        ("measured", "u1"),  # `accel_x` is
        ("backwards", "u1"),  # in reverse
        ("reset", "u1"),  # a filter met a non-finite value
        ("at_bound", "u1"),  # a learned state is at its bound
        ("given_up", "u1"),  # learned values recently predicted worse than the configuration
        # Exponentials of what changes less than once a cycle: see `remembered_exp`.
        ("exponent", "f8", (REMEMBERED,)),
        ("power", "f8", (REMEMBERED,)),
    ],
    align=True,
)

UNITS = {
    **dict.fromkeys(("speed", "lateral_speed"), "m/s"),
    **dict.fromkeys(("accel_x", "accel_x_model", "accel_y", "accel_bias", "overrun"), "m/s^2"),
    **dict.fromkeys(("sigma_overrun", "grip_limit", "sigma_grip_limit"), "m/s^2"),
    "overrun_power": "W/kg",
    "yaw_rate": "rad/s",
    "steering": "rad",
    "mass": "kg",
    **dict.fromkeys(("tyre_force", "load", "force"), "N"),
    "observed_s": "s",
    "brake_torque": "N m",
    **dict.fromkeys(("pressure_zero", "pressure_at_rest"), "bar"),
}
"""Of the fields of `ESTIMATE` that are no pure number."""

STANDING = 0.3  # m/s, below: the brakes hold the car at standstill
LEAST_RATIO, GREATEST_RATIO = 0.5, 1.5  # of friction over nominal
SIGMA_FOR_LEARNING = 0.10
SECONDS_FOR_LEARNING = 1.0


@kernel
def remembered_exp(estimate: Record, place: int, exponent: float) -> float:
    """Return e to the `exponent`, computed anew only where that is not the last one of this `place`."""
    if exponent != estimate.exponent[place] or estimate.power[place] == 0.0:
        estimate.exponent[place], estimate.power[place] = exponent, math.exp(exponent)
    power: float = estimate.power[place]
    return power


@kernel
def well_observed(estimate: Record, i: int) -> bool:
    """Return whether a corner's friction in this application may be learned."""
    sure: bool = estimate.sigma[i] < SIGMA_FOR_LEARNING * estimate.mu[i]
    return sure and estimate.observed_s[i] >= SECONDS_FOR_LEARNING
