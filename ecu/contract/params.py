"""Parameters of one vehicle as kernels read them: SI units, one value per corner where corners differ."""

from typing import Final

import numpy as np

from ecu.contract.dust import MOST_NUMBERS
from ecu.contract.signals import N_INPUTS

# Points of the pedal map; a shorter map is padded with its last point.
PEDAL_POINTS: Final = 8

GRAVITY: Final = 9.81  # m/s^2
BAR: Final = 1e5  # Pa
MEGA: Final = 1e-6  # MW of a watt

OBSERVERS: Final = ("joint", "observer1", "observer2")
JOINT, OBSERVER1, OBSERVER2 = range(3)

DISTRIBUTIONS: Final = ("ideal", "fixed", "electronic")
MINIMISED: Final = ("off", "dust", "wear")
HEAT_NODES: Final = 13  # of the share that emits or wears least, in each direction
HEAT_STEP: Final = 25.0  # K, from 0 degC on
RATE_NODES: Final = 81  # of the shares that Annex 5 admits
RATE_STEP: Final = 0.01  # of the braking rate z, from 0 on
COMPENSATIONS: Final = ("second-order", "inverse", "off")
SECOND_ORDER, INVERSE, OFF = range(3)
RISE, FALL = range(2)

PARAMS: Final = np.dtype(
    [
        ("transmit", "u1"),  # armed: demands are flagged valid
        ("fixed", "u1"),  # friction stays as it was restored: nothing is learned
        ("mapped", "u1", (N_INPUTS,)),  # inputs fed by a frame or column
        # vehicle
        ("mass", "f8"),  # kg
        ("wheelbase", "f8"),  # m
        ("front_axle", "f8"),  # l_f, centre of gravity to front axle, m
        ("rear_axle", "f8"),  # l_r, m
        ("cog_height", "f8"),  # m
        ("track", "f8"),  # m
        ("drag_area", "f8"),  # 0.5 rho c_d A, N/(m/s)^2
        ("rolling_resistance", "f8"),  # -
        ("pitch_gradient", "f8"),  # nose-down pitch per braking deceleration, rad/(m/s^2)
        ("imu_x", "f8"),  # sensor ahead of the centre of gravity, m
        ("load_transfer_lag", "f8"),  # s
        ("cornering_stiffness", "f8"),  # per load, 1/rad
        # wheels and tyres
        ("unloaded_radius", "f8", (4,)),  # r_0, m
        ("wheel_radius", "f8", (4,)),  # rolling radius at static load, m
        ("vertical_stiffness", "f8", (4,)),  # K_Z, N/m
        ("wheel_inertia", "f8", (4,)),  # kg m^2
        ("static_load", "f8", (4,)),  # N
        ("slip_stiffness", "f8", (4,)),  # C_L / F_Z at static load, -
        ("stiffness_degression", "f8", (4,)),  # e of C_L ~ F_Z^(1-e)
        ("relaxation_length", "f8"),  # C_L / K_L, m
        # brakes
        ("piston_area", "f8", (4,)),  # A_k, all pistons of one side, m^2
        ("effective_radius", "f8", (4,)),  # m
        ("push_out_pressure", "f8", (4,)),  # Pa
        ("mu_nominal", "f8", (4,)),  # mean friction by SAE J2522
        ("disc_heating", "f8", (4,)),  # xi (3.7), K/J
        ("disc_cooling", "f8", (4,)),  # delta_0 (3.7), 1/s
        ("disc_cooling_by_speed", "f8", (4,)),  # delta_1 (3.7), 1/m
        ("disc_cooling_wet", "f8", (4,)),  # delta_0 in rain, 1/s
        ("disc_cooling_by_speed_wet", "f8", (4,)),  # delta_1 in rain, 1/m
        ("sigma_disc_heating", "f8", (4,)),  # relative, of xi
        ("sigma_disc_cooling", "f8", (4,)),  # relative, of the cooling rate
        ("sigma_disc_cooling_wet", "f8", (4,)),
        ("ambient_temperature", "f8"),  # where no sensor reports it, degC
        # linings, see monitoring/wear.py
        ("wear_law", "f8", (7, 4)),  # coefficients of (7.15) on the road, of both pads of a calliper
        ("wear_sigma", "f8", (4,)),  # relative, of the law for unmeasured linings
        ("wear_walk", "f8", (4,)),  # its change per gram worn, 1/sqrt(g)
        ("wear_scatter", "f8", (4,)),  # scatter by weather and roads per gram, sqrt(g)
        ("pad_mass", "f8", (4,)),  # of a millimetre of both pads, g/mm
        ("pad_life", "f8", (4,)),  # mm from new to worn
        ("chamfer_depth", "f8", (4,)),  # mm
        ("chamfer_share", "f8", (4,)),  # of the area, removed by chamfers on new pads
        # dust, see monitoring/dust.py
        ("dust_model", "i8", (4,)),  # MODELS of contract/dust.py, NONE without
        ("dust_numbers", "f8", (4, MOST_NUMBERS)),
        ("dust_low", "f8", (4, 6)),  # training range of a model's FEATURES
        ("dust_high", "f8", (4, 6)),
        ("dust_factor", "f8", (4,)),  # mean of the particles over ten to the emission factor
        ("dust_below", "f8", (4,)),  # ends of the 95 % interval of the emission factor
        ("dust_above", "f8", (4,)),
        ("dust_version", "i8"),  # identifies these models
        ("airborne_share", "f8", (4,)),  # share of pad wear emitted as particles up to 10 um
        ("airborne_low", "f8", (4,)),  # the least and the most that it may be
        ("airborne_high", "f8", (4,)),
        # hydraulics, see hydraulics.py: for a rise and a fall
        ("dead_time", "f8", (2,)),  # s
        ("pressure_inertia", "f8", (2,)),  # s^2
        ("pressure_lag", "f8", (2,)),  # s
        ("pressure_rate", "f8", (2,)),  # greatest, bar/s
        ("slowness", "f8"),  # lateness of a rise beside that of A.17
        # sensors
        ("sigma_wheel_speed", "f8"),  # rad/s
        ("sigma_accel", "f8"),  # m/s^2
        ("accel_range", "f8"),  # m/s^2: readings beyond are invalid
        ("sigma_pressure", "f8"),  # Pa
        ("sigma_vehicle_speed", "f8"),  # m/s
        ("vehicle_speed_delay", "f8"),  # s
        ("sigma_motor_torque", "f8"),  # of the torque reported, relative
        # observer
        ("observer", "i8"),  # OBSERVERS
        ("activation_decel", "f8", (4,)),  # m/s^2
        ("min_speed", "f8"),  # m/s
        ("rls_forgetting", "f8"),  # per 10 ms
        ("mu_drift", "f8"),  # random walk of friction, 1/sqrt(s)
        ("omega_walk", "f8"),  # random walk of wheel speed, rad/s/sqrt(s)
        ("force_walk", "f8"),  # random walk of tyre force relative to the wheel load, 1/sqrt(s)
        ("time_correlation", "f8"),  # of the virtual force: its variance counts this often
        ("sigma_mu_initial", "f8"),  # relative to nominal
        ("sigma_mass", "f8"),  # relative
        ("sigma_slip_stiffness_ratio", "f8"),  # front to rear, relative
        # control
        ("pedal_position", "f8", (PEDAL_POINTS,)),  # %
        ("pedal_decel", "f8", (PEDAL_POINTS,)),  # m/s^2
        ("hold_decel", "f8"),  # least demand that holds the car at standstill, m/s^2
        ("distribution", "i8"),  # DISTRIBUTIONS
        ("front_share", "f8"),  # of the brake force, where the distribution has one
        ("rear_slip_margin", "f8"),  # admissible slip of a rear wheel beyond the front one
        ("minimised", "i8"),  # MINIMISED
        ("wanted_share", "f8", (HEAT_NODES, HEAT_NODES)),  # front's of the linings' torque, by discs' heat
        ("least_share", "f8", (RATE_NODES,)),  # front's of the brake force that Annex 5 admits, by z
        ("most_share", "f8", (RATE_NODES,)),
        ("max_pressure", "f8"),  # Pa
        ("max_pressure_rate", "f8"),  # Pa/s
        ("compensation", "i8"),  # COMPENSATIONS
        ("slip_guard", "u1"),
        ("blending", "f8", (4,)),  # f of (5.2): 0 off, 1 series phasing
        ("fade_speed", "f8"),  # below it the motors' limit fades, m/s
    ],
    align=True,
)
