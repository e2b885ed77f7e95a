"""Records of the simulated vehicle: parameters, state and commands. SI units, Pa, degC.

Wheels stand in the order front left, front right, rear left, rear right; axes and signs after ISO 8855.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from brakelab.plant.emission import EMISSION_ROW
from brakelab.plant.friction.law import ROW
from brakelab.plant.wear import WEAR_ROW

RecordArray = NDArray[np.void]

GRAVITY: Final = 9.81  # m/s^2
HISTORY: Final = 800  # demand samples in the history: 0.4 s at steps of 0.5 ms
LOOK_BACK: Final = 64  # cycles in a sensor's history: 0.64 s
DAMPER_KNOTS: Final = 7  # of a damper's force over speed
GEARS: Final = 10  # of a gearbox, at most

# Parameters of one car: nominal or drawn.
PARAMS: Final = np.dtype(
    [
        ("mass", "f8"),  # kg
        ("yaw_inertia", "f8"),  # kg m^2
        ("cog_height", "f8"),  # m
        ("front_length", "f8"),  # m, centre of gravity to front axle
        ("rear_length", "f8"),  # m, centre of gravity to rear axle
        ("track", "f8"),  # m
        ("drag_factor", "f8"),  # N s^2/m^2, air density / 2 * drag coefficient * frontal area
        ("rolling_resistance", "f8"),  # -
        ("body_frequency", "f8"),  # rad/s, pitch and roll of the body on its springs
        ("body_damping", "f8"),  # -
        ("pitch_gradient", "f8"),  # rad per m/s^2
        ("roll_gradient", "f8"),  # rad per m/s^2
        ("roll_share_front", "f8"),  # -, front share of the lateral load transfer
        ("wheel_inertia", "f8", (4,)),  # kg m^2
        ("free_radius", "f8", (4,)),  # m, undeformed
        ("vertical_stiffness", "f8", (4,)),  # N/m
        ("nominal_load", "f8", (4,)),  # N
        ("slip_stiffness", "f8", (4,)),  # per N of load: longitudinal, at nominal load
        ("cornering_stiffness", "f8", (4,)),  # 1/rad per N of load, at nominal load
        ("stiffness_degression", "f8"),  # -
        ("friction_degression", "f8"),  # -
        ("magic_c", "f8"),
        ("magic_e", "f8"),
        ("burckhardt_fall", "f8"),  # -, c_3 / c_1 of Burckhardt's law; 0: the Magic Formula
        ("longitudinal_stiffness", "f8"),  # N/m, carcass (K_L)
        ("lateral_stiffness", "f8"),  # N/m, carcass (K_S)
        ("piston_area", "f8", (4,)),  # m^2
        ("effective_radius", "f8", (4,)),  # m
        ("push_out_pressure", "f8", (4,)),  # Pa
        ("pressure_limit", "f8", (4,)),  # Pa
        ("offset_start", "f8"),  # Pa, above which the brake unit settles below its command
        ("offset_slope", "f8"),  # -, share lost of the excess
        ("offset_known", "f8"),  # -, slope that the unit's inverse map corrects
        ("build_up", "f8", (3,)),  # s^2, s, dead time s (A.17)
        ("release", "f8", (3,)),  # likewise (A.18)
        ("rise_limit", "f8"),  # Pa/s, of the pressure
        ("fall_limit", "f8"),
        ("fallback_gain", "f8"),  # Pa per m/s^2, of the hydraulics without the ECU
        ("friction_law", "i8", (4,)),  # number in friction/laws.py
        ("friction_row", "f8", (4, ROW)),  # the law's numbers
        ("friction_scale", "f8", (4,)),  # -
        (
            "rig_gain",
            "f8",
            (4,),
        ),  # rad/s^2 per Pa, 2 A_k r_eff / I of the law's rig
        ("heating", "f8", (4,)),  # K/J (xi)
        ("cooling", "f8", (4,)),  # 1/s (delta_0)
        ("cooling_by_speed", "f8", (4,)),  # 1/m (delta_1)
        ("wear_row", "f8", (4, WEAR_ROW)),  # numbers of wear.py
        ("wear_scale", "f8", (4,)),  # -, lot of the lining and climate of the day
        ("emission_row", "f8", (4, EMISSION_ROW)),  # numbers of emission.py
        ("emission_scale", "f8", (4,)),  # -, lot of the lining and the day
        ("motor_share", "f8", (4,)),  # -, of a total torque
        ("motor_torque_limit", "f8"),  # N m at the wheel
        ("motor_power_limit", "f8"),  # W
        ("motor_peak_torque", "f8"),  # N m at the wheel, for a time
        ("motor_peak_power", "f8"),  # W
        ("motor_peak_time", "f8"),  # s
        ("charge_limit", "f8"),  # W, of the battery
        ("discharge_limit", "f8"),  # W
        ("motor_fade_speed", "f8"),  # rad/s of the wheel: below it regeneration fades out
        ("motor_copper_loss", "f8"),  # W/(N m)^2, torque at the wheel
        ("motor_turning_loss", "f8"),  # W s/rad of the wheel
        # of the car with a combustion engine, see engine.py
        ("engine_drag_torque", "f8"),  # N m at the crankshaft
        ("engine_drag_growth", "f8"),  # N m per rad/s
        ("engine_lowest_speed", "f8"),  # rad/s of the crankshaft
        ("engine_ratio", "f8", (GEARS,)),  # -, crankshaft over wheels, falling; 0: no such gear
        ("engine_share", "f8", (4,)),  # -, of the engine's torque
        ("sensor_position", "f8", (3,)),  # m, from the centre of gravity
        # of the car with a suspension: fourteen degrees of freedom instead of seven
        ("suspended", "u1"),
        ("unsprung_mass", "f8", (4,)),  # kg
        ("pitch_inertia", "f8"),  # kg m^2, of the sprung mass
        ("roll_inertia", "f8"),  # kg m^2
        ("spring_stiffness", "f8", (4,)),  # N/m at the wheel
        ("spring_preload", "f8", (4,)),  # N at the design height
        ("stop_clearance", "f8"),  # m of travel from the design height to the bump and the rebound stop
        ("stop_stiffness", "f8"),  # N/m, of a stop, beside the spring
        ("anti_roll_stiffness", "f8", (2,)),  # N/m at the wheel, front and rear
        ("damper_speed", "f8", (DAMPER_KNOTS,)),  # m/s, compression positive
        ("damper_force", "f8", (4, DAMPER_KNOTS)),  # N at the wheel
    ],
    align=True,
)

# Commands from outside: actuators and road, held over a step.
COMMANDS: Final = np.dtype(
    [
        ("pressure_demand", "f8", (4,)),  # Pa
        ("motor_demand", "f8", (4,)),  # N m at the wheel, positive brakes
        ("steering_angle", "f8"),  # rad at the road wheel
        ("road_friction", "f8", (4,)),  # -, peak at nominal load
        ("road_height", "f8", (4,)),  # m under each wheel
        ("grade", "f8"),  # rad, uphill positive
        ("bank", "f8"),  # rad, left side high positive
        ("ambient_temperature", "f8"),  # degC
        ("wetness", "f8"),  # 0 dry to 1 rain, for the cooling of the discs
    ],
    align=True,
)

STATE: Final = np.dtype(
    [
        # integrated
        ("t", "f8"),
        ("distance", "f8"),  # m, along the car's axis
        ("position_x", "f8"),  # m, of the centre of gravity over the ground; at the start 0
        ("position_y", "f8"),
        ("heading", "f8"),  # rad, of the car's axis over the ground, to the left
        ("speed_x", "f8"),  # m/s, of the centre of gravity
        ("speed_y", "f8"),
        ("yaw_rate", "f8"),  # rad/s
        ("wheel_speed", "f8", (4,)),  # rad/s
        ("force_x", "f8", (4,)),  # N, tyre on car, wheel axes
        ("force_y", "f8", (4,)),
        ("felt_accel", "f8", (2,)),  # m/s^2, absorbed by springs and tyres so far, x and y
        ("felt_rate", "f8", (2,)),
        ("pressure", "f8", (4,)),  # Pa
        ("pressure_rate", "f8", (4,)),  # Pa/s
        ("releasing", "u1", (4,)),
        ("turning_point", "f8", (4,)),  # Pa, extreme of the demand in the present direction
        ("demand_history", "f8", (HISTORY, 4)),
        ("motor_history", "f8", (HISTORY, 4)),
        ("place", "i8"),  # of the newest sample in the histories
        ("motor_torque", "f8", (4,)),  # N m at the wheel, positive brakes
        ("peak_reserve", "f8", (4,)),  # s left of a motor's peak
        ("engine_torque", "f8", (4,)),  # N m at the wheel that an engine in overrun takes
        ("applied", "u1", (4,)),  # pads touch the disc
        ("lining_memory", "f8", (4,)),  # of the friction law, e.g. normalised contact area
        ("disc_temperature", "f8", (4,)),  # degC
        ("pad_wear_mass", "f8", (4,)),  # g, of both pads
        ("particles", "f8", (4,)),  # emitted, 23 nm to 2.5 um
        ("treatment", "f8", (4,)),  # -, of the surface by heat
        # integrated with a suspension only; heights from the design position, up
        ("heave", "f8"),  # m, of the body's centre of gravity
        ("heave_rate", "f8"),
        ("pitch_rate", "f8"),  # rad/s
        ("roll_rate", "f8"),
        ("unsprung_height", "f8", (4,)),  # m
        ("unsprung_rate", "f8", (4,)),
        ("road_height", "f8", (4,)),  # m under each wheel
        # J since the start, see energy.py
        ("brake_heat", "f8", (4,)),
        ("tyre_work", "f8"),  # into the tyres: slip and energy stored in the carcasses
        ("drag_loss", "f8"),
        ("rolling_loss", "f8"),
        ("damper_heat", "f8"),
        ("regenerated", "f8"),  # into the motors
        ("driven", "f8"),  # out of the motors
        ("charged", "f8"),  # into the battery, by motors that gave more than they lost
        ("discharged", "f8"),  # out of the battery
        ("engine_loss", "f8"),  # into an engine in overrun
        ("lifted", "f8"),  # against gravity
        ("road_work", "f8"),  # of the road's heights on the tyres
        # follows from these
        ("accel_x", "f8"),  # m/s^2, specific force at the centre of gravity, road axes
        ("accel_y", "f8"),
        ("yaw_accel", "f8"),  # rad/s^2
        ("pitch", "f8"),  # rad, positive nose down; with a suspension integrated, as roll is
        ("pitch_accel", "f8"),
        ("roll", "f8"),  # rad, positive right side down
        ("roll_accel", "f8"),
        ("heave_accel", "f8"),  # m/s^2
        ("unsprung_accel", "f8", (4,)),
        ("vertical_accel", "f8"),  # m/s^2, of the accelerometer's place on the body
        ("bank", "f8"),  # rad, of the road under the car
        ("wheel_load", "f8", (4,)),  # N
        ("rolling_radius", "f8", (4,)),  # m
        ("slip", "f8", (4,)),  # -
        ("slip_angle", "f8", (4,)),  # -, tangent
        ("mu_b", "f8", (4,)),  # -
        ("brake_torque", "f8", (4,)),  # N m, magnitude
        ("brake_work", "f8", (4,)),  # J, of friction in the last step
        ("motor_limit", "f8", (4,)),  # N m that can be regenerated now
    ],
    align=True,
)

# One sensor of one car, in the unit of its signal; see sensor_errors.py.
SENSOR: Final = np.dtype(
    [
        ("noise", "f8"),  # standard deviation
        ("resolution", "f8"),
        ("delay", "f8"),  # cycles
        ("scale", "f8"),
        ("floor", "f8"),
        ("bias", "f8"),
        ("drift_step", "f8"),  # standard deviation of the increment per cycle
        ("drift_decay", "f8"),  # of the present value, per cycle
        ("dropout_begin", "f8"),  # probability per sample
        ("dropout_end", "f8"),
        ("period", "f8"),  # s
        ("stuck_from", "f8"),  # s
        ("lost_from", "f8"),  # s
    ],
    align=True,
)

# State of that sensor.
SENSING: Final = np.dtype(
    [
        ("history", "f8", (LOOK_BACK,)),  # true values by cycle
        ("cycle", "i8"),  # of the newest
        ("drift", "f8"),
        ("sample", "i8"),  # number of the last one, where there is a period
        ("dropped", "u1"),
        ("held", "f8"),  # value of the last sample
    ],
    align=True,
)

# Actions of the driver in one phase of a script.
PHASE: Final = np.dtype(
    [
        ("kind", "i8"),  # CRUISE, COAST, BRAKE or FOLLOW
        ("speed", "f8"),  # m/s, to be held on the motors
        ("accel", "f8"),  # m/s^2, largest acceleration up to that speed
        ("decel", "f8"),  # m/s^2, as a deceleration demand, or NaN
        ("pedal", "f8"),  # %, or NaN
        ("kept_decel", "f8"),  # m/s^2, to be reached and kept by the pedal, or NaN
        ("ramp", "f8"),  # m/s^3, of the deceleration demand
        ("pedal_rate", "f8"),  # %/s
        ("until_speed", "f8"),  # m/s; the phase ends when the speed passes it; NaN: never
        ("seconds", "f8"),  # s; the phase ends after this time; inf: never
    ],
    align=True,
)
CRUISE, COAST, BRAKE, FOLLOW = range(4)

# State of the driver.
DRIVER: Final = np.dtype(
    [
        ("phase", "i8"),  # index in the script; beyond its end: finished
        ("started", "u1"),
        ("above", "u1"),  # the phase began above its `until_speed`
        ("braking", "u1"),
        ("elapsed", "f8"),  # s, in this phase
        ("correction", "f8"),  # m/s^2, error of the expectation as learned by the driver
        ("asked_decel", "f8"),  # m/s^2, of brakes and motors together
        ("decel_demand", "f8"),  # m/s^2, of the brakes
        ("decel_demand_valid", "f8"),
        ("pedal_position", "f8"),  # %
        ("accelerator_position", "f8"),  # %
        ("steering_angle", "f8"),  # rad at the road wheel, left positive
        ("motor_demand", "f8", (4,)),  # N m at the wheel, positive brakes
    ],
    align=True,
)

# Demands of the ECU as decoded by the vehicle.
DEMAND: Final = np.dtype(
    [
        ("pressure", "f8", (4,)),  # bar
        ("pressure_valid", "u1"),
        ("pressure_age", "f8"),  # s, since the last accepted demand
        ("motor", "f8", (4,)),  # N m at the wheel, positive brakes
        ("motor_valid", "u1"),
        ("motor_age", "f8"),  # s
    ],
    align=True,
)


def new_record(dtype: np.dtype[Any]) -> RecordArray:
    """Return one zeroed record of `dtype`, shape (1,)."""
    return np.zeros(1, dtype)
