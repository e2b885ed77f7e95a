"""Outputs of a cycle: estimates and state, NaN where nothing is known."""

import math

from ecu.algorithm.control.blending import blends
from ecu.algorithm.estimation.joint.kalman import GATE
from ecu.algorithm.estimation.joint.layout import BIAS, MASS, OVERRUN
from ecu.algorithm.estimation.motion import STANDING
from ecu.contract.params import JOINT
from ecu.contract.signals import CALLIPER_PRESSURE, FAILED, STARTING
from ecu.jit import Record, kernel


@kernel
def _test_ratio(p: Record, s: Record, channel: int) -> float:
    ratio: float = s.joint.ratio[channel] / (GATE * GATE)
    return ratio if p.observer == JOINT and s.joint.started else math.nan


@kernel
def _publish_car(p: Record, s: Record, y: Record) -> None:
    """Write what the joint observer knows of the car; of the others, what is configured."""
    y.overrun = y.accel_x_zero = 0.0
    y.vehicle_mass, y.sigma_brake_force = p.mass, math.nan
    if p.observer == JOINT:
        x = s.joint.x
        y.overrun, y.accel_x_zero, y.vehicle_mass = x[OVERRUN], x[BIAS], p.mass * math.exp(x[MASS])
        y.sigma_brake_force = s.joint.sigma_force


@kernel
def publish(p: Record, s: Record, u: Record, y: Record, decel: float, faults: int, mode: int) -> None:
    """Overwrite the outputs that no part before wrote.

    Args:
        p: `PARAMS`.
        s: `STATE`.
        u: `INPUTS` without what is implausible.
        y: `OUTPUTS`; pressures and motor torques demanded are there.
        decel: demanded [m/s^2], may be NaN.
        faults: the bits of `active_faults`.
        mode: that of the ECU.
    """
    started = s.speed.started != 0
    rolls = started and s.speed.speed > STANDING
    y.vehicle_speed = s.speed.speed if started else math.nan
    y.k_f = s.force.k_f
    y.mode = mode
    y.active_faults = faults
    y.overruns = u.overruns
    y.worst_lateness_us = u.worst_lateness_us
    y.pressure_demand_valid = 1.0 if p.transmit and mode != STARTING and mode != FAILED else 0.0
    s.plausibility.sent = 1 if y.pressure_demand_valid > 0.5 else 0
    y.motor_demand_valid = y.pressure_demand_valid if blends(p) else 0.0
    y.decel_demand_total = decel
    y.accel_x_road = s.motion.accel_x if s.motion.measured else math.nan
    y.accel_x_model = s.motion.accel_x_model
    _publish_car(p, s, y)
    y.braking = s.application.braking
    y.test_ratio_balance, y.test_ratio_speed = _test_ratio(p, s, 4), _test_ratio(p, s, 5)
    y.particles_last_brake, y.particles_per_km = s.dust.particles, s.dust.per_km
    y.particles_last_brake_low, y.particles_last_brake_high = s.dust.low, s.dust.high
    y.particle_mass_per_km = s.dust.mass_per_km
    for i in range(4):
        y.slip[i] = s.wheels.slip[i] if rolls else math.nan
        y.wheel_force_x[i] = s.force.virtual[i] if rolls else math.nan
        y.wheel_force_z[i] = s.wheel_load.load[i]
        y.mu_b[i] = s.friction.mu[i]
        y.sigma_mu_b[i] = s.friction.sigma[i]
        y.mode_mu_b[i] = s.friction.mode[i]
        y.brake_torque[i] = s.friction.torque[i]
        y.calliper_pressure[i] = u.value[CALLIPER_PRESSURE + i]
        y.pressure_zero[i] = s.joint.zero.value[i]
        mapped = p.mapped[CALLIPER_PRESSURE + i] != 0
        y.disc_temperature[i] = s.discs.temperature[i] if mapped else math.nan
        y.sigma_disc_temperature[i] = s.discs.sigma[i] if mapped else math.nan
        y.test_ratio[i] = _test_ratio(p, s, i)
        y.pad_wear[i] = s.wear.wear[i] if mapped else math.nan
        y.sigma_pad_wear[i] = s.wear.sigma[i] if mapped else math.nan
        y.pad_remaining[i] = 100.0 * max(1.0 - s.wear.wear[i] / p.pad_life[i], 0.0) if mapped else math.nan
        y.pad_wear_mass[i] = s.wear.mass[i] if mapped else math.nan
        if mode == FAILED:
            y.pressure_demand[i] = 0.0
