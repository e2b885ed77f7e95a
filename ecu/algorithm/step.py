"""The whole algorithm as one function of its arguments alone.

`step(params, state, inputs, outputs)` overwrites preallocated records and depends on nothing else, so the
daemon, replay and closed-loop simulation get the same bits from the same inputs. Order of one cycle:

    brake application -> accelerations -> wheel loads, radii -> brake torques, expected slip -> speed -> slip
    -> tyre forces -> friction -> disc temperature -> wear -> dust -> demand -> distribution -> blending
    -> pressure law -> slip guard -> limiter -> mode
"""

import math

import numpy as np

from ecu.algorithm.control.blending import (
    BLENDING_STATE,
    blends,
    motor_torque_demand,
    share_torque,
    update_motors,
)
from ecu.algorithm.control.demand import DEMAND_STATE, hold_pedal, update_demand
from ecu.algorithm.control.distribution import DISTRIBUTION_STATE, cap_trailing, distribute, watch_trailing
from ecu.algorithm.control.failed_brakes import FAILED_BRAKES_STATE, replace_failed
from ecu.algorithm.control.friction_torque import FRICTION_TORQUE_STATE, follow_pressure, lagging_torque
from ecu.algorithm.control.limiter import LIMITER_STATE, available_pressure, limit_axle, reads_empty
from ecu.algorithm.control.mode import MODE_STATE, decide_mode, input_faults
from ecu.algorithm.control.pressure_law import (
    PRESSURE_LAW_STATE,
    compensated_pressure,
    follow_friction,
    learn_start,
    pressure_for_torque,
    set_base,
    watch_limit,
)
from ecu.algorithm.control.slip_guard import SLIP_GUARD_STATE, guard_slip
from ecu.algorithm.estimation.force import FORCE_STATE, reset_force, take_measured_force, update_force
from ecu.algorithm.estimation.friction import (
    FRICTION_STATE,
    hand_over,
    restore_friction,
    update_friction,
    update_pressure,
)
from ecu.algorithm.estimation.joint.layout import JOINT_STATE, MASS, STIFFNESS, V
from ecu.algorithm.estimation.joint.learned import (
    hand_over_level,
    keep_joint,
    publish_friction,
    restore_joint,
)
from ecu.algorithm.estimation.joint.observer import update_joint
from ecu.algorithm.estimation.joint.prior import begin_application, end_application, forget_levels
from ecu.algorithm.estimation.joint.sliding import mistrust_wheels
from ecu.algorithm.estimation.motion import MOTION_STATE, update_motion
from ecu.algorithm.estimation.observer2 import OBSERVER_STATE
from ecu.algorithm.estimation.slip import (
    RADIUS_START,
    WHEELS_STATE,
    expect_slip,
    learn_radius,
    update_radius,
    update_slip,
)
from ecu.algorithm.estimation.speed import SPEED_STATE, update_speed
from ecu.algorithm.estimation.wheel_load import WHEEL_LOAD_STATE, update_wheel_load
from ecu.algorithm.inputs import usable
from ecu.algorithm.monitoring.acceleration import ACCELERATION_STATE
from ecu.algorithm.monitoring.application import APPLICATION_STATE, update_application
from ecu.algorithm.monitoring.disc_temperature import (
    DISC_STATE,
    UNKNOWN_EXCESS,
    heat_widening,
    start_discs,
    update_discs,
)
from ecu.algorithm.monitoring.dust import DUST_STATE, restore_dust, update_dust
from ecu.algorithm.monitoring.plausibility import PLAUSIBILITY_STATE
from ecu.algorithm.monitoring.prediction import (
    PREDICTION_STATE,
    add_window,
    begin_prediction,
    close_book,
    end_prediction,
)
from ecu.algorithm.monitoring.sensors import leave_out, watch_sensors
from ecu.algorithm.monitoring.wear import WEAR_STATE, restore_wear, update_wear
from ecu.algorithm.publish import publish
from ecu.algorithm.vehicle import total_tyre_force
from ecu.contract.faults import (
    ACCUMULATOR_LOW,
    BRAKE_FADE,
    DEMAND_LIMITED,
    FILTER_RESET,
    LEARNED_AT_BOUND,
    LEARNING_GIVEN_UP,
    MOTOR_SHORT,
    WHEEL_SLIPS,
)
from ecu.contract.params import BAR, JOINT, OBSERVER1
from ecu.contract.records import INPUTS, LEARNED, RecordArray
from ecu.contract.signals import ACCEL_X
from ecu.jit import Record, kernel

KEEP_S = 1.0  # between two copies of what the joint observer knows, while no application ends

STATE = np.dtype(
    [
        ("motion", MOTION_STATE),
        ("wheel_load", WHEEL_LOAD_STATE),
        ("speed", SPEED_STATE),
        ("joint", JOINT_STATE),
        ("wheels", WHEELS_STATE),
        ("force", FORCE_STATE),
        ("observer", OBSERVER_STATE),
        ("friction", FRICTION_STATE),
        ("application", APPLICATION_STATE),
        ("discs", DISC_STATE),
        ("wear", WEAR_STATE),
        ("dust", DUST_STATE),
        ("demand", DEMAND_STATE),
        ("distribution", DISTRIBUTION_STATE),
        ("failed_brakes", FAILED_BRAKES_STATE),
        ("friction_torque", FRICTION_TORQUE_STATE),
        ("blending", BLENDING_STATE),
        ("control", PRESSURE_LAW_STATE),
        ("guard", SLIP_GUARD_STATE),
        ("limiter", LIMITER_STATE),
        ("plausibility", PLAUSIBILITY_STATE),
        ("acceleration", ACCELERATION_STATE),
        ("prediction", PREDICTION_STATE),
        ("trusted", INPUTS),  # the inputs without what is implausible
        ("mode", MODE_STATE),
        ("learned", LEARNED),
    ],
    align=True,
)


def new_state(params: RecordArray, learned: RecordArray | None = None) -> RecordArray:
    """Return the state before the first cycle, shape (1,).

    Args:
        params: `PARAMS`, shape (1,).
        learned: `LEARNED`, shape (1,), as the state store keeps it; None: nothing is known.
    """
    state = np.zeros(1, STATE)
    row = state[0]
    if learned is None:
        row["learned"]["radius_sigma"] = RADIUS_START
        row["learned"]["disc_excess"] = UNKNOWN_EXCESS
    else:
        row["learned"] = learned[0]
    row["control"]["mu_override"], row["control"]["start"] = math.nan, 1.0
    row["failed_brakes"]["scale"] = 1.0
    row["force"]["k_f"] = row["force"]["stiffness"] = 1.0
    row["distribution"]["trailing"] = 1.0
    _begin(params, state)
    return state


@kernel
def _begin(params: Record, state: Record) -> None:
    p, s = params[0], state[0]
    restore_friction(p, s.friction, s.learned)
    restore_joint(p, s.joint, s.learned)
    set_base(p, s.control, s.learned)
    start_discs(p, s.discs, s.learned)
    restore_wear(p, s.wear, s.learned)
    restore_dust(p, s.dust, s.learned, s.wear)
    update_wheel_load(p, s.wheel_load, 0.0, 0.0, 0.0, 1.0)
    update_radius(p, s.wheels, s.learned, s.wheel_load.load)


@kernel
def step(params: Record, state: Record, inputs: Record, outputs: Record) -> None:
    """Run one cycle.

    Args:
        params: `PARAMS`, shape (1,), read only.
        state: `STATE`, shape (1,), overwritten.
        inputs: `INPUTS`, shape (1,), read only.
        outputs: `OUTPUTS`, shape (1,), overwritten; NaN where nothing is known.
    """
    p, s, u, y = params[0], state[0], inputs[0], outputs[0]
    dt = 1e-9 * u.dt_ns
    faults = u.bus_faults | u.e2e_faults | input_faults(p, u) | watch_sensors(p, s, u, dt)
    leave_out(p, s, u)
    u = s.trusted
    hold_pedal(p, s.demand, u)
    _estimate(p, s, u, dt)
    update_discs(
        p, s.discs, s.learned, u, s.friction, s.application, s.wheel_load.load,
        total_tyre_force(p, s.motion, s.speed.speed), s.speed.speed, dt,
    )  # fmt: skip
    update_wear(p, s.wear, s.learned, u, s.friction, s.discs, s.application, s.speed.speed, dt)
    update_dust(p, s.dust, s.learned, u, s.friction, s.discs, s.wear, s.application, s.speed.speed, dt)
    decel = _control(p, s, u, y, dt)
    if s.friction.reset:
        faults |= FILTER_RESET
    if s.limiter.limited:
        faults |= DEMAND_LIMITED
    if s.limiter.starved or reads_empty(u):
        faults |= ACCUMULATOR_LOW
    if s.guard.acting:
        faults |= WHEEL_SLIPS
    if s.control.at_limit:
        faults |= BRAKE_FADE
    if s.joint.at_bound:
        faults |= LEARNED_AT_BOUND
    if s.prediction.told_s > 0.0:
        faults |= LEARNING_GIVEN_UP
    for i in range(4):
        if s.blending.lost[i] and s.plausibility.sent:
            faults |= MOTOR_SHORT
    asked = math.isfinite(decel) and decel > 0.05
    mode = decide_mode(s.mode, faults, asked or s.application.braking != 0, dt)
    publish(p, s, u, y, decel, faults, mode)


@kernel
def _estimate(p: Record, s: Record, u: Record, dt: float) -> None:
    update_application(p, s.application, u, dt)
    if s.application.ended:
        if p.observer == JOINT:
            end_application(s.joint)
            if end_prediction(s.prediction):
                forget_levels(s.joint)
                close_book(s.prediction)
            keep_joint(p, s.joint, s.learned)
            learn_start(s.control, s.friction, s.learned)
            hand_over_level(s.friction, s.learned)
        else:
            learn_start(s.control, s.friction, s.learned)
            hand_over(s.friction, s.learned)
    if s.application.started:
        reset_force(s.force)
    braking = s.application.braking != 0
    if not braking:
        set_base(p, s.control, s.learned)
    update_motion(p, s.motion, u, s.speed.speed, s.friction.torque)
    update_wheel_load(p, s.wheel_load, s.motion.accel_x, s.motion.accel_y, s.speed.speed, dt)
    update_pressure(p, s.friction, u, dt)
    if p.observer == JOINT:
        _observe_jointly(p, s, u, braking, dt)
    else:
        _observe_by_wheel(p, s, u, braking, dt)


@kernel
def _observe_jointly(p: Record, s: Record, u: Record, braking: bool, dt: float) -> None:
    joint = s.joint
    if s.application.started:
        for i in range(4):
            joint.heat[i] = heat_widening(s.discs, i)
        begin_prediction(p, s.prediction, joint)
        begin_application(joint, joint.heat)
    if s.guard.acting or s.friction.held:
        mistrust_wheels(joint)
    for i in range(4):
        s.failed_brakes.sent[i] = 0.0 if s.failed_brakes.failed[i] else s.limiter.pressure[i]
    update_joint(p, joint, u, s.motion, s.wheel_load.load, s.failed_brakes.sent, braking, dt)
    if braking and joint.closed:
        add_window(p, s.prediction, joint, u)
    s.prediction.told_s = max(s.prediction.told_s - dt, 0.0)
    publish_friction(p, joint, s.friction, s.learned, u, braking, dt)
    joint.unkept_s += dt
    if joint.unkept_s > KEEP_S:
        keep_joint(p, joint, s.learned)
    s.speed.started, s.speed.speed = joint.started, joint.x[V]
    s.force.k_f = math.exp(joint.x[STIFFNESS])
    for i in range(4):
        s.wheels.slip[i], s.force.virtual[i] = joint.slip[i], joint.force[i]


@kernel
def _observe_by_wheel(p: Record, s: Record, u: Record, braking: bool, dt: float) -> None:
    update_radius(p, s.wheels, s.learned, s.wheel_load.load)
    s.force.total = total_tyre_force(p, s.motion, s.speed.speed)
    expect_slip(p, s.wheels, u, s.wheel_load.load, s.force.total, s.friction.torque)
    update_speed(p, s.speed, s.motion, s.wheels, s.learned, u, braking, dt)
    accel = s.motion.accel_x - s.speed.bias
    update_slip(p, s.wheels, s.motion, u, s.speed.speed, accel, dt)
    if s.speed.started:
        learn_radius(p, s.wheels, s.learned, s.motion, u, s.speed, braking, dt)
    regress = braking and s.speed.speed > p.min_speed and usable(u, ACCEL_X)
    update_force(p, s.force, s.motion, s.wheels, s.wheel_load.load, regress, dt)
    if p.observer == OBSERVER1:
        take_measured_force(s.force, u)
    update_friction(
        p, s.friction, s.observer, s.learned, u, s.motion, s.wheels, s.wheel_load.load, s.force, s.speed,
        s.application, dt,
    )  # fmt: skip


@kernel
def _control(p: Record, s: Record, u: Record, y: Record, dt: float) -> float:
    speed = s.speed.speed if s.speed.started else math.nan
    decel = update_demand(p, s.demand, u, speed, dt)
    backwards = s.motion.backwards != 0
    failed = s.failed_brakes.failed
    watch_trailing(p, s.distribution, u, s.motion, s.wheel_load.load, failed, decel, speed, dt)
    mass = p.mass * math.exp(s.joint.x[MASS]) if p.observer == JOINT else p.mass
    distribute(p, s.distribution, mass, decel, backwards)
    follow_friction(p, s.control, s.friction, dt)
    follow_pressure(p, s.friction_torque, u, s.limiter.pressure, s.joint.zero.value, dt)
    update_motors(p, s.blending, u, s.guard.capped, s.speed.speed, decel, dt)
    replace_failed(p, s.failed_brakes, s.distribution, s.blending.allowed, decel, backwards, dt)
    share_torque(p, s.blending, s.distribution.torque, dt)
    for i in range(4):
        torque = s.blending.lining[i]
        y.pressure_uncompensated[i] = pressure_for_torque(p, torque, s.control.base[i], i)
        y.pressure_demand[i] = compensated_pressure(p, s.control, y.pressure_uncompensated[i], i)
    cap_trailing(
        p, s.distribution, decel, s.blending.lining, s.friction, y.pressure_demand, failed, backwards
    )  # fmt: skip
    if p.slip_guard:
        guard_slip(
            p, s.guard, u, s.motion, speed, s.limiter.pressure, y.pressure_demand, s.distribution.torque, dt
        )
    _limit(p, s, y, available_pressure(p, u), decel, dt)
    return decel


@kernel
def _limit(p: Record, s: Record, y: Record, available: float, decel: float, dt: float) -> None:
    limiter = s.limiter
    limiter.limited = limiter.starved = 0
    for i in range(4):
        limiter.ceiling[i] = min(available, s.guard.cap[i]) if s.guard.capped[i] else available
        if available < min(y.pressure_demand[i], p.max_pressure):
            limiter.starved = 1
    for left in (0, 2):
        limit_axle(p, limiter, left, y.pressure_demand, y.pressure_uncompensated, s.blending.lining, dt)
    for i in range(4):
        asked, pressure = limiter.asked[i], limiter.pressure[i]
        s.control.cut[i] = 1 if pressure < asked - 1.0 else 0
        y.pressure_demand[i], y.pressure_uncompensated[i] = pressure / BAR, y.pressure_uncompensated[i] / BAR
        motor = motor_torque_demand(
            p, s.blending, lagging_torque(p, s.friction_torque, s.control, asked, i), i
        )
        y.motor_demand[i] = motor if blends(p) else math.nan
    watch_limit(p, s.control, s.friction.mu, s.guard.capped, decel > 0.0, dt)
