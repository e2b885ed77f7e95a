"""States of the joint observer, one filter for the whole vehicle.

Friction of a lining is its level, which outlives the brake application, times its axle's change within the
application. Friction, stiffness, mass, motor scale and drag are logarithms of the ratio to the configuration:
scaling mass and all frictions together is invisible to friction braking, and in logarithms that direction is
constant, so relinearising cannot invent knowledge of it."""

from typing import Final

import numpy as np

from ecu.algorithm.estimation.joint.motors import MOTORS_STATE
from ecu.algorithm.estimation.joint.sampling import SAMPLING_STATE
from ecu.algorithm.estimation.zero import ZERO_STATE
from ecu.contract.records import N_JOINT

V: Final = 0  # vehicle speed [m/s]
LEVEL: Final = 1  # four: ln of lining friction over nominal, as it outlives a brake application
STIFFNESS: Final = 5  # ln of the tyres' slip stiffness over configured
RATIO: Final = 6  # ln of rear over front stiffness, beyond configured
RADIUS: Final = 7  # four: ln of a rolling radius over (A.4), beyond the common one
BIAS: Final = 11  # accelerometer bias [m/s^2]
SLOPE: Final = 12  # gravity along the road [m/s^2], uphill positive
MASS: Final = 13  # ln of mass over configured
PEAK: Final = 14  # of the tyres' peak adhesion, see `peak_adhesion`
LOAD: Final = 15  # exponent of stiffness over load, beyond configured
DEFLECTION_GAIN: Final = 16  # ln of the radius's change per load over (A.4)
MOTOR: Final = 17  # ln of motor torque over reported
DRAG: Final = 18  # ln of air drag per mass over configured
OFFSET: Final = 19  # two: pressure [bar] lost beyond push-out and sensor, per axle
DELAY: Final = 21  # of the speed reference beyond configured [s]
DRIVE: Final = 22  # two: unknown drive of an axle over mass [m/s^2]; only considered
ROLLING: Final = 24  # ln of all rolling radii: observable by a speed reference alone
RATE: Final = 25  # change of CHANGE, of both axles [1/s]
CHANGE: Final = 26  # two: ln of an axle's friction over its level, within an application
SLIP_ERROR: Final = 28  # two: of an axle's slip, by unreported drive; only considered
SIDE: Final = 30  # ln of the left tyres' stiffness over the right ones'; considered, or of the road
PEAK_LOAD: Final = 31  # exponent of peak adhesion over load, beyond the usual; only considered
OVERRUN: Final = 34  # unreported engine drag while braking, over mass [m/s^2]
MEAN: Final = 32  # two: mean of CHANGE over this application, weighted by pressure
N: Final = N_JOINT

# Places among the test ratios.
WHEEL_RATIO: Final = 0  # four
BALANCE_RATIO: Final = 4
REFERENCE_RATIO: Final = 5
RATIOS: Final = 6

PASSING: Final = (
    *(V, SLOPE, RATE, CHANGE, CHANGE + 1, MEAN, MEAN + 1),
    *(DRIVE, DRIVE + 1, SLIP_ERROR, SLIP_ERROR + 1),
)
"""States of one brake application or drive, which are not stored."""

WINDOW_STATE: Final = np.dtype(
    [
        ("time", "f8"),  # s
        ("cycles", "i8"),
        ("accel", "f8"),  # sums over the cycles: specific force in road axes [m/s^2]
        ("lateral", "f8"),  # part of front lateral force along the car [N]
        ("across", "f8"),  # lateral force over load
        ("change", "f8"),  # dv/dt [m/s^2]
        ("load", "f8", (4,)),  # N
        ("motor", "f8", (4,)),  # N m
        ("omega", "f8", (4,)),  # sums over samples [rad/s]
        ("ground", "f8", (4,)),  # m/s, at the samples' own time
        ("omega_samples", "i8", (4,)),
        ("pressure", "f8", (4,)),  # above push-out, in the window [bar]
        ("common_pressure", "f8", (4,)),  # likewise, at the common time of all signals
        ("common_accel", "f8"),  # at that time [m/s^2]
        ("balanced", "u1"),  # that time differs from that of the last balance
        ("pressure_samples", "i8", (4,)),
        ("tracked", "f8", (4,)),  # by the model, sum then mean [bar]
        ("tracked_cycles", "i8", (4,)),
        ("pressure_variance", "f8", (4,)),  # bar^2, of this window alone
        ("reference", "f8"),  # speed reference less prediction [m/s]
        ("reference_change", "f8"),  # dv/dt at its samples [m/s^2]
        ("reference_samples", "i8"),
        ("motor_known", "u1"),
        ("motor_reported", "u1"),
    ],
    align=True,
)

JOINT_STATE: Final = np.dtype(
    [
        ("x", "f8", (N,)),
        ("p", "f8", (N, N)),
        ("free", "u1", (N,)),  # states that this window may correct; the others are consider states
        ("h", "f8", (N,)),  # derivatives of one measurement
        ("ph", "f8", (N,)),
        ("order", "u1", (N,)),  # of the states in one correction: those that take part come first
        ("drive_known", "f8"),  # share of the drive torque that is reported
        ("weight", "f8"),  # of MEAN so far [bar]
        ("per_torque", "f8"),  # derivative of that measurement by a torque on the wheel
        ("kept_x", "f8", (2, N)),  # snapshots: the newer in row 0
        ("kept_p", "f8", (2, N, N)),
        ("kept_s", "f8"),  # age of the newer one [s]
        ("calm_x", "f8", (N,)),  # the last that was saved while all inputs agreed
        ("calm_p", "f8", (N, N)),
        ("calm_s", "f8"),  # time since then [s]
        ("unkept_s", "f8"),  # since it was last stored into the learned values [s]
        ("window", WINDOW_STATE),
        ("motors", MOTORS_STATE),
        ("sampling", SAMPLING_STATE),
        ("copies", "i8", (2,)),  # samples in which both pressures of an axle were equal
        ("differs", "u1", (2,)),  # 1: they have ever differed
        ("wheel_ratio", "f8", (3,)),  # of the other wheels' speeds over the first, as first seen
        ("speed_copies", "i8"),  # windows in which these stayed the same; -1: they differ
        ("held", "u1"),  # windows of this application do not teach
        ("zero", ZERO_STATE),
        ("pressed", "f8"),  # relative change of a pressure in the last window, greater of both axles
        ("closed", "u1"),  # a window ended in this cycle
        ("started", "u1"),
        ("slides", "u1", (4,)),  # 1: the wheel is too far from the car's speed to indicate it
        ("sliding", "i8"),  # number of such wheels
        (
            "beyond_linear",
            "u1",
            (4,),
        ),  # 1: beyond the linear range of its tyre, its torque does not indicate its force
        ("ceiling", "f8"),  # peak adhesion of the road by wheels that slip
        ("ceiling_variance", "f8"),  # of its logarithm; 0: unknown
        ("measured_slip", "f8", (4,)),  # by speed and wheel speed, positive while braking, less the next one
        ("rolling_slip", "f8", (4,)),  # while it rolls freely: error of the radius
        ("slipping", "u1", (4,)),  # past the linear range of the tyre, by that
        ("releasing", "u1"),
        ("released", "u1"),  # no friction brake is applied
        ("unmeasured_s", "f8"),  # time without an accelerometer: the acceleration is that of the torques [s]
        ("unseen_s", "f8"),  # time in which neither accelerometer nor wheels showed how the car moved [s]
        ("before", "f8", (4,)),  # LEVEL before this brake application
        ("sigma_axles", "f8"),  # of the front levels less the rear ones, as this application began
        ("left_s", "f8"),  # time for which the balance is beyond its gate while braking, signed as it is [s]
        ("untrusted_s", "f8"),  # time since a wheel was last trusted [s]
        ("contradicted_s", "f8"),  # time for which the wheels have shown since that the speed is wrong [s]
        ("distance_least", "f8"),  # distance of the wheels from the speed meanwhile [m/s]
        ("distance_most", "f8"),
        ("hold_s", "f8"),  # time for which learning stays suspended after a wheel left its tyre's range
        ("reference_s", "f8"),  # time since the last speed reference [s]
        ("smooth_pressure", "f8", (4,)),  # bar above push-out
        ("last_accel", "f8"),  # of the last window [m/s^2]
        ("smooth_accel", "f8"),  # low-passed [m/s^2]
        ("mean_accel", "f8"),  # of the last seconds [m/s^2]
        ("last_smooth_accel", "f8"),  # of the last window [m/s^2]
        ("last_smooth", "f8", (4,)),  # of the last window [bar]
        ("last_pressure", "f8", (4,)),  # of the last window [bar]
        ("last_slip", "f8", (4,)),
        ("slip", "f8", (4,)),
        ("unsettled", "f8"),  # its slip less that at its torque shortly before
        ("curved", "f8"),  # part of the last wheel's slip beyond that of a linear tyre
        ("force", "f8", (4,)),  # N
        ("follows", "u1", (4,)),  # the pressure followed the demand throughout the last window
        ("observed", "u1", (4,)),  # friction was corrected in the last window
        ("sigma_force", "f8"),  # of the force of all linings at equal pressures, relative
        ("ratio", "f8", (RATIOS,)),  # squared innovations over their variances
        ("signed_ratio", "f8", (4,)),  # test ratio up to the gate, with the sign of the innovation
        ("uneven", "f8", (2,)),  # per axle: of the left wheel less of the right one, in gates, summed
        ("at_bound", "u1"),  # a learned state is at its bound
        ("reversing", "u1"),
        ("reset", "u1"),
    ],
    align=True,
)
