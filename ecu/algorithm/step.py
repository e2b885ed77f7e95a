"""One cycle of the whole algorithm as a function of its arguments alone.

`step(params, state, inputs, outputs)` overwrites preallocated records and depends on nothing else, so the
daemon, replay and closed-loop simulation produce identical outputs to the bit from the same inputs. Order of
one cycle:

    cross-checks of the sensors, by the last estimate -> brake application
    -> estimation: accelerations -> wheel loads -> brake torques -> observer -> ESTIMATE
    -> disc temperature -> wear -> dust
    -> demand -> distribution -> blending -> pressure law -> slip guard -> limiter -> mode -> outputs

All later stages read `ESTIMATE` (`estimate.py`) and nothing else of estimation.
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
from ecu.algorithm.control.cleaner_share import CALM_ACROSS, CLEANER_STATE, lean
from ecu.algorithm.control.confirmed_friction import confirm_friction
from ecu.algorithm.control.demand import DEMAND_STATE, hold_automated, hold_pedal, update_demand
from ecu.algorithm.control.distribution import (
    DISTRIBUTION_STATE,
    KEPT,
    cap_trailing,
    distribute,
    front_share,
    watch_trailing,
)
from ecu.algorithm.control.friction_torque import lagging_torque
from ecu.algorithm.control.limiter import (
    LIMITER_STATE,
    available_pressure,
    limit_axle,
    reads_empty,
    watch_accumulator,
)
from ecu.algorithm.control.mode import MODE_STATE, decide_mode, input_faults, request_lost, speaks
from ecu.algorithm.control.pressure_law import (
    PRESSURE_LAW_STATE,
    compensated_pressure,
    follow_friction,
    learn_start,
    pressure_for_torque,
    set_base,
    watch_limit,
)
from ecu.algorithm.control.replacement import REPLACEMENT_STATE, replace_failed
from ecu.algorithm.control.slip_guard import SLIP_GUARD_STATE, guard_slip
from ecu.algorithm.estimate import ESTIMATE
from ecu.algorithm.estimation.joint.layout import JOINT_STATE
from ecu.algorithm.estimation.joint.prediction import PREDICTION_STATE
from ecu.algorithm.estimation.joint.whole_application import WHOLE_STATE
from ecu.algorithm.estimation.motion import MOTION_STATE
from ecu.algorithm.estimation.observe import (
    hand_over_application,
    keep_application,
    observe,
    start_estimate,
    start_estimation,
)
from ecu.algorithm.estimation.thesis.force import FORCE_STATE
from ecu.algorithm.estimation.thesis.friction import FRICTION_STATE
from ecu.algorithm.estimation.thesis.observer2 import OBSERVER_STATE
from ecu.algorithm.estimation.thesis.slip import RADIUS_START, WHEELS_STATE
from ecu.algorithm.estimation.thesis.speed import SPEED_STATE
from ecu.algorithm.estimation.wheel_load import WHEEL_LOAD_STATE
from ecu.algorithm.hydraulics import HYDRAULICS_STATE, advance_pressures, correct_pressures, slowness
from ecu.algorithm.inputs import others_brake, share_pressures
from ecu.algorithm.monitoring.accel_error import ACCEL_ERROR_STATE
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
from ecu.algorithm.monitoring.failed_brakes import FAILED_BRAKES_STATE
from ecu.algorithm.monitoring.flags import FLAGS_STATE, correct_flags
from ecu.algorithm.monitoring.motors import MOTORS_WATCH_STATE
from ecu.algorithm.monitoring.plausibility import PLAUSIBILITY_STATE
from ecu.algorithm.monitoring.pressures import PRESSURES_STATE
from ecu.algorithm.monitoring.sensors import mask_implausible, watch_sensors
from ecu.algorithm.monitoring.speeds import SPEEDS_STATE
from ecu.algorithm.monitoring.turning import TURNING_STATE
from ecu.algorithm.monitoring.wear import WEAR_STATE, restore_wear, update_wear
from ecu.algorithm.monitoring.wheel_unit import WHEEL_UNIT_STATE
from ecu.algorithm.monitoring.witness import WITNESS_STATE, begin_watch, end_watch
from ecu.algorithm.publish import DEMANDS, publish
from ecu.contract.faults import (
    ACCUMULATOR_LOW,
    BRAKE_FADE,
    DEMAND_LIMITED,
    FILTER_RESET,
    GRIP_EXCEEDED,
    IMPLAUSIBLE,
    LEARNED_AT_BOUND,
    LEARNING_GIVEN_UP,
    MOTOR_SHORT,
    REAR_HELD,
    WHEEL_SLIPS,
)
from ecu.contract.records import INPUTS, LEARNED, RecordArray
from ecu.jit import Record, kernel

ACCUMULATOR_IMPLAUSIBLE = IMPLAUSIBLE["accumulator_pressure"]

INITIAL = np.dtype(
    [
        ("hydraulics", HYDRAULICS_STATE),
        ("motion", MOTION_STATE),
        ("wheel_load", WHEEL_LOAD_STATE),
        ("speed", SPEED_STATE),
        ("joint", JOINT_STATE),
        ("whole", WHOLE_STATE),
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
        ("cleaner", CLEANER_STATE),
        ("failed_brakes", FAILED_BRAKES_STATE),
        ("replacement", REPLACEMENT_STATE),
        ("blending", BLENDING_STATE),
        ("control", PRESSURE_LAW_STATE),
        ("guard", SLIP_GUARD_STATE),
        ("limiter", LIMITER_STATE),
        ("plausibility", PLAUSIBILITY_STATE),
        ("pressures", PRESSURES_STATE),
        ("flags", FLAGS_STATE),
        ("accel_error", ACCEL_ERROR_STATE),
        ("witness", WITNESS_STATE),
        ("motors", MOTORS_WATCH_STATE),
        ("turning", TURNING_STATE),
        ("speeds", SPEEDS_STATE),
        ("wheel_unit", WHEEL_UNIT_STATE),
        ("acceleration", ACCELERATION_STATE),
        ("prediction", PREDICTION_STATE),
        ("trusted", INPUTS),  # inputs with implausible ones masked out
        ("mode", MODE_STATE),
        ("learned", LEARNED),
    ],
    align=True,
)
"""State before the first cycle as a recording stores it: without the estimate, which follows from it."""

STATE = np.dtype(
    [*((name, INITIAL[name]) for name in INITIAL.names or ()), ("estimate", ESTIMATE), ("demands", DEMANDS)],
    align=True,
)


def new_state(params: RecordArray, learned: RecordArray | None = None) -> RecordArray:
    """Return the state before the first cycle, shape (1,).

    Args:
        params: `PARAMS`, shape (1,).
        learned: `LEARNED`, shape (1,), from the state store; None: unadapted.
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
    row["distribution"]["trailing"] = row["distribution"]["rolled"] = 1.0
    row["guard"]["rolled"] = row["flags"]["last"] = math.nan
    watched = row["witness"]["published"]
    watched["innovation"] = watched["sigma"] = watched["ratio"] = math.nan
    watched["unused_s"] = math.inf
    _begin(params, state)
    return state


def initial_part(state: RecordArray) -> RecordArray:
    """Return the part of a state before the first cycle that a recording stores, `INITIAL`, shape (1,)."""
    kept = np.zeros(1, INITIAL)
    for name in INITIAL.names or ():
        kept[name] = state[name]
    return kept


def resume(state: RecordArray, initial: RecordArray) -> None:
    """Restore the state before the first cycle from the `initial` of a recording, shape (1,)."""
    state[:] = np.zeros(1, STATE)
    for name in INITIAL.names or ():
        state[name] = initial[name]
    _resume(state)


@kernel
def _resume(state: Record) -> None:
    start_estimate(state[0])


@kernel
def _begin(params: Record, state: Record) -> None:
    p, s = params[0], state[0]
    start_estimation(p, s)
    set_base(p, s.control, s.learned)
    start_discs(p, s.discs, s.learned)
    restore_wear(p, s.wear, s.learned)
    restore_dust(p, s.dust, s.learned, s.wear)


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
    s.trusted = u
    share_pressures(p, s.trusted)
    begin_watch(s.witness, dt)
    stuck = correct_flags(p, s.flags, s.witness, s.accel_error, s.trusted, s.estimate, s.application, dt)
    u = s.trusted
    faults, contradicted = watch_sensors(p, s, u, dt)
    faults |= stuck | u.bus_faults | u.e2e_faults | input_faults(p, u)
    mask_implausible(p, s, u)
    hold_pedal(p, s.demand, u)
    faults |= hold_automated(s.demand, u, dt)
    faults |= request_lost(p, u)
    _estimate(p, s, u, contradicted or u.e2e_unsure != 0, dt)
    update_discs(p, s.discs, s.learned, u, s.estimate, s.application, dt)
    update_wear(p, s.wear, s.learned, u, s.estimate, s.discs, s.application, dt)
    update_dust(p, s.dust, s.learned, u, s.estimate, s.discs, s.wear, s.application, dt)
    decel = _control(p, s, u, dt)
    if s.estimate.reset:
        faults |= FILTER_RESET
    if s.limiter.limited:
        faults |= DEMAND_LIMITED
    if s.limiter.starved or reads_empty(u):
        faults |= ACCUMULATOR_LOW
    if s.limiter.denied:
        faults |= ACCUMULATOR_IMPLAUSIBLE
    if s.guard.acting:
        faults |= WHEEL_SLIPS
    if s.distribution.trailing < KEPT:
        faults |= REAR_HELD
    if s.control.at_limit:
        faults |= BRAKE_FADE
    if s.control.beyond_grip:
        faults |= GRIP_EXCEEDED
    if s.estimate.at_bound:
        faults |= LEARNED_AT_BOUND
    if s.estimate.given_up:
        faults |= LEARNING_GIVEN_UP
    for i in range(4):
        if s.blending.lost[i] and s.plausibility.sent:
            faults |= MOTOR_SHORT
    asked = math.isfinite(decel) and decel > 0.05
    mode = decide_mode(s.mode, faults, asked or s.application.braking != 0, dt)
    s.plausibility.sent = 1 if speaks(p, mode) else 0
    end_watch(s.witness, inputs[0], u, dt)
    publish(p, s, u, y, decel, faults, mode)


@kernel
def _estimate(p: Record, s: Record, u: Record, contradicted: bool, dt: float) -> None:
    update_application(p, s.application, u, s.estimate.pressure_at_rest, dt)
    if s.application.ended:
        keep_application(p, s)
        learn_start(s.control, s.estimate, s.learned)
        hand_over_application(p, s)
    if s.application.braking == 0:
        set_base(p, s.control, s.learned)
    zero, failed = s.estimate.pressure_zero, s.failed_brakes.failed
    correct_pressures(p, s.hydraulics, u, s.limiter.pressure, zero, failed, dt)
    d = s.discs
    heat = (heat_widening(d, 0), heat_widening(d, 1), heat_widening(d, 2), heat_widening(d, 3))
    observe(p, s, u, heat, s.guard.acting != 0, contradicted, dt)


@kernel
def _control(p: Record, s: Record, u: Record, dt: float) -> float:
    e, demands = s.estimate, s.demands
    speed = e.speed if e.started else math.nan
    decel = update_demand(p, s.demand, u, speed, dt)
    backwards, failed = e.backwards != 0, s.failed_brakes.failed
    reckoned = s.speeds.reckoned if s.speeds.started else 0.0
    watch_trailing(p, s.distribution, u, e, failed, s.guard.capped, decel, speed, reckoned, dt)
    distribute(p, s.distribution, e.mass, decel, backwards, dt)
    held = s.guard.acting != 0 or s.distribution.trailing < 1.0 or s.failed_brakes.any != 0
    calm = not (held or backwards or s.control.beyond_grip or others_brake(u))
    torque, allowed = s.distribution.torque, s.blending.allowed
    if p.minimised:
        straight, share = calm and abs(e.accel_y) <= CALM_ACROSS, front_share(p, decel)
        lean(p, s.cleaner, torque, allowed, s.discs.temperature, share, e.mass, decel, straight, dt)
    slow, line = slowness(p, s.hydraulics), s.accel_error.wheels
    confirm_friction(p, s.control.confirmed, e, s.control.used, line, s.acceleration, decel, calm, slow, dt)
    follow_friction(p, s.control, e, dt)
    advance_pressures(p, s.hydraulics, s.limiter.pressure)
    update_motors(p, s.blending, u, s.guard.capped, e.speed, decel, slow, dt)
    replace_failed(p, s.replacement, s.failed_brakes, s.distribution, allowed, decel, backwards, dt)
    share_torque(p, s.blending, torque, slow, dt)
    for i in range(4):
        demands.uncompensated[i] = pressure_for_torque(p, s.blending.lining[i], s.control.base[i], i)
        demands.pressure[i] = compensated_pressure(p, s.control, demands.uncompensated[i], i)
    cap_trailing(p, s.distribution, decel, s.blending.lining, e, demands.pressure, failed, backwards)
    if p.slip_guard:
        sent, model, motors = s.limiter.pressure, s.hydraulics.model, s.blending.asked[0]
        guard_slip(p, s.guard, u, e, speed, sent, model, motors, demands.pressure, torque, dt)
    watch_accumulator(s.limiter, s.witness, u, dt)
    _limit(p, s, available_pressure(p, s.limiter, u), decel, dt)
    return decel


@kernel
def _limit(p: Record, s: Record, available: float, decel: float, dt: float) -> None:
    limiter, demands = s.limiter, s.demands
    limiter.limited = limiter.starved = 0
    for i in range(4):
        limiter.ceiling[i] = min(available, s.guard.cap[i]) if s.guard.capped[i] else available
        if available < min(demands.pressure[i], p.max_pressure):
            limiter.starved = 1
    for left in (0, 2):
        limit_axle(p, limiter, left, demands.pressure, demands.uncompensated, s.blending.lining, dt)
    for i in range(4):
        asked, pressure = limiter.asked[i], limiter.pressure[i]
        s.control.cut[i] = 1 if pressure < asked - 1.0 else 0
        motor = motor_torque_demand(
            p, s.blending, lagging_torque(p, s.hydraulics.value, s.control, asked, i), i
        )
        demands.motor[i] = motor if blends(p) else math.nan
    slips = s.guard.acting != 0 or s.distribution.trailing < KEPT
    watch_limit(p, s.control, s.estimate, s.guard.capped, slips, decel, dt)
