"""One cycle of estimation: inertial signals, loads and brake torques, then the configured observer.

It changes its own records of `STATE`, the learned values, and `estimate`, which the rest of the ECU reads.
"""

import math

from ecu.algorithm.estimate import STANDING
from ecu.algorithm.estimation.friction import update_pressure
from ecu.algorithm.estimation.joint.ceiling import follow_ceiling
from ecu.algorithm.estimation.joint.drive import compare_drive
from ecu.algorithm.estimation.joint.estimates import tell_joint
from ecu.algorithm.estimation.joint.layout import V
from ecu.algorithm.estimation.joint.learned import hand_over_level, keep_joint, restore_joint
from ecu.algorithm.estimation.joint.observer import update_joint
from ecu.algorithm.estimation.joint.prediction import (
    add_window,
    begin_prediction,
    close_book,
    end_prediction,
)
from ecu.algorithm.estimation.joint.prior import begin_application, end_application, forget_levels
from ecu.algorithm.estimation.joint.sliding import suspend_learning
from ecu.algorithm.estimation.joint.snapshot import keep_calm_snapshot, take_calm_snapshot
from ecu.algorithm.estimation.joint.speed import doubt_speed, retake_speed
from ecu.algorithm.estimation.joint.whole_application import (
    add_coasting,
    add_to_whole,
    apply_scale,
    begin_whole,
    end_whole,
    restore_whole,
    tell_whole,
    torques_measured,
)
from ecu.algorithm.estimation.joint.whole_filter import forget_filter, keep_filter
from ecu.algorithm.estimation.joint.window import open_window
from ecu.algorithm.estimation.motion import tell_motion, update_motion
from ecu.algorithm.estimation.thesis.estimates import tell_friction, tell_wheels
from ecu.algorithm.estimation.thesis.force import reset_force, take_measured_force, update_force
from ecu.algorithm.estimation.thesis.friction import hand_over, restore_friction, update_friction
from ecu.algorithm.estimation.thesis.slip import expect_slip, learn_radius, update_radius, update_slip
from ecu.algorithm.estimation.thesis.speed import update_speed
from ecu.algorithm.estimation.wheel_load import update_wheel_load
from ecu.algorithm.estimation.zero import FREE, note_rest, settle_zero, tell_zeros
from ecu.algorithm.inputs import LEAST_REQUEST, fresh, requested_decel, usable
from ecu.algorithm.vehicle import total_tyre_force
from ecu.contract.params import BAR, JOINT, OBSERVER1
from ecu.contract.signals import ACCEL_X, CALLIPER_PRESSURE, OBSERVING
from ecu.jit import Record, kernel

Corners = tuple[float, float, float, float]

KEEP_S = 1.0  # between stores of the joint observer's states, while no application ends


@kernel
def start_estimation(p: Record, s: Record) -> None:
    """Start with the learned values, at standstill."""
    s.force.k_f = s.force.stiffness = 1.0
    restore_friction(p, s.friction, s.learned)
    restore_joint(p, s.joint, s.learned)
    restore_whole(s.whole, s.learned)
    update_wheel_load(p, s.wheel_load, 0.0, 0.0, 0.0, 1.0)
    update_radius(p, s.wheels, s.learned, s.wheel_load.load)
    start_estimate(s)


@kernel
def start_estimate(s: Record) -> None:
    """Initialise the estimate before the first cycle: friction is the learned one."""
    tell_friction(s.friction, s.estimate)
    tell_zeros(s.joint.zero, s.estimate)


@kernel
def keep_application(p: Record, s: Record) -> None:
    """At the end of a brake application: store the joint observer's learned states."""
    if p.observer != JOINT or p.fixed:
        return
    if not p.transmit:
        end_whole(s.whole)
    if not s.whole.alone:
        end_application(s.joint)
        if end_prediction(s.prediction):
            forget_levels(s.joint)
            close_book(s.prediction)
            forget_filter(s.whole.filter)
    _keep(p, s)


@kernel
def _keep(p: Record, s: Record) -> None:
    keep_joint(p, s.joint, s.learned)
    if not p.transmit:
        keep_filter(s.whole.filter, s.learned)
        apply_scale(p, s.whole, s.learned)


@kernel
def hand_over_application(p: Record, s: Record) -> None:
    """After `keep_application`: prepare the observed values for the next application."""
    if p.observer == JOINT:
        hand_over_level(s.estimate, s.learned)
    elif not p.fixed:
        hand_over(s.friction, s.learned)
        tell_friction(s.friction, s.estimate)


@kernel
def observe(
    p: Record, s: Record, u: Record, heat: Corners, guarded: bool, contradicted: bool, dt: float
) -> None:
    """Overwrite the estimate of the last cycle.

    Args:
        p: `PARAMS`.
        s: `STATE` of `ecu.algorithm.step`.
        u: `INPUTS` with implausible ones masked out.
        heat: relative standard deviation that each friction has gained by its disc's temperature.
        guarded: the slip guard holds a wheel: the last snapshot is restored.
        contradicted: a sensor or a stream has just become implausible: that of before it disagreed is.
        dt: time since the last cycle [s].
    """
    braking, e = s.application.braking != 0, s.estimate
    update_motion(p, s.motion, u, e.speed, e.brake_torque)
    update_wheel_load(p, s.wheel_load, s.motion.accel_x, s.motion.accel_y, e.speed, dt)
    update_pressure(p, s.friction, e.mu, s.joint.zero.value, u, dt)
    tell_motion(s.motion, e)
    for i in range(4):
        e.load[i], e.brake_torque[i] = s.wheel_load.load[i], s.friction.torque[i]
    e.grip_limit = e.sigma_grip_limit = e.grip_knee = e.grip_fall = math.nan
    e.sigma_overrun = e.overrun_power = math.nan
    e.torque_share, e.torques_known = 1.0, 1
    if p.observer == JOINT:
        _observe_jointly(p, s, u, heat, guarded, contradicted, braking, dt)
    else:
        s.friction.held = 1 if contradicted or p.fixed else 0
        if _at_rest(p, s, u):
            _learn_zeros(s.joint.zero, u)
        _observe_by_wheel(p, s, u, braking, dt)
    e.tyre_force = total_tyre_force(p, e, e.speed)


@kernel
def _observe_jointly(
    p: Record,
    s: Record,
    u: Record,
    heat: Corners,
    guarded: bool,
    contradicted: bool,
    braking: bool,
    dt: float,
) -> None:
    joint = s.joint
    if not p.transmit and (s.application.started or contradicted):
        begin_whole(p, s.whole, joint)
    if s.application.started and not s.whole.alone:
        begin_prediction(p, s.prediction, joint)
        begin_application(joint, heat)
    joint.held = 1 if s.whole.alone or s.whole.bent else 0
    joint.calm_s += dt
    if contradicted and joint.hold_s <= 0.0:
        take_calm_snapshot(joint)
    if guarded or contradicted:
        suspend_learning(joint)
    if contradicted:
        open_window(joint)  # what it has is also of the input that is wrong
        if s.motion.measured == 0:
            doubt_speed(p, joint, u)
        elif s.speeds.started:
            retake_speed(joint, s.speeds.reckoned)
    update_joint(p, joint, u, s.motion, s.wheel_load.load, s.hydraulics, braking, dt)
    if joint.closed and joint.kept_s == 0.0 and s.witness.calm:
        keep_calm_snapshot(joint)
    if joint.closed and p.transmit:
        follow_ceiling(p, joint, s.guard.capped, braking)
    if joint.closed and joint.released and not p.transmit:
        compare_drive(p, s.whole, joint)
        if add_coasting(p, s.whole, joint, u) and not p.fixed:
            _keep(p, s)
    if braking and joint.closed:
        if not p.transmit:
            add_to_whole(p, s.whole, joint)
            if joint.x[V] < STANDING:  # held brakes, and the end of a log, teach no more
                end_whole(s.whole)
        if not s.whole.alone:
            add_window(p, s.prediction, joint, u)
    s.prediction.reported_s = max(s.prediction.reported_s - dt, 0.0)
    learns = braking and not p.fixed
    tell_joint(p, joint, s.hydraulics, s.estimate, s.learned, u, learns, dt)
    s.estimate.given_up = 1 if s.prediction.reported_s > 0.0 else 0
    s.estimate.torques_known = 1 if p.transmit or torques_measured(p, joint) else 0
    if not p.transmit:
        tell_whole(p, s.whole, joint, s.estimate)
        if learns and s.whole.alone and s.whole.time > 0.0:
            for i in range(4):
                s.estimate.mode[i] = OBSERVING
                s.estimate.observed_s[i] += dt
    joint.unkept_s += dt
    if joint.unkept_s > KEEP_S and not p.fixed:
        _keep(p, s)


@kernel
def _at_rest(p: Record, s: Record, u: Record) -> bool:
    """Return whether no friction brake is applied, not even slightly."""
    if s.application.braking != 0 or requested_decel(p, u) > LEAST_REQUEST:
        return False
    recent, total = s.application.recent, 0.0
    for i in range(4):
        total -= s.joint.zero.value[i]
        for k in range(recent.shape[1]):
            total += recent[i, k] / (recent.shape[1] * BAR)
    return total < 4.0 * FREE


@kernel
def _learn_zeros(zero: Record, u: Record) -> None:
    """Learn the pressure zeros from released brakes; recordings keep `zero` in the joint observer's part."""
    for i in range(4):
        if fresh(u, CALLIPER_PRESSURE + i):
            note_rest(zero, i, u.value[CALLIPER_PRESSURE + i])
            settle_zero(zero, i)


@kernel
def _observe_by_wheel(p: Record, s: Record, u: Record, braking: bool, dt: float) -> None:
    if s.application.started:
        reset_force(s.force)
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
    tell_wheels(p, s.friction, s.estimate, s.speed, s.wheels, s.force)
    tell_zeros(s.joint.zero, s.estimate)
