"""Outputs of a cycle: demands, estimates and state, NaN where nothing is known.

A failed ECU demands no pressure: in mode `FAILED` the pressures and torques sent are 0.
"""

import math

import numpy as np

from ecu.algorithm.control.blending import blends
from ecu.algorithm.control.friction_torque import lining_torque
from ecu.algorithm.estimate import STANDING
from ecu.algorithm.hydraulics import lateness
from ecu.algorithm.monitoring.wear_belief import is_known
from ecu.contract.faults import WORD
from ecu.contract.params import BAR, FALL, RISE
from ecu.contract.signals import CALLIPER_PRESSURE, FAILED
from ecu.jit import Record, kernel

DEMANDS = np.dtype(
    [
        ("pressure", "f8", (4,)),  # compensated, before the limiter [Pa]
        ("uncompensated", "f8", (4,)),  # with the base friction [Pa]
        ("motor", "f8", (4,)),  # torque [N m], NaN where no motors blend
    ],
    align=True,
)
"""What control demands in a cycle, overwritten by each; the limiter holds the pressures to send."""


@kernel
def publish(p: Record, s: Record, u: Record, y: Record, decel: float, faults: int, mode: int) -> None:
    """Overwrite the outputs, in their units.

    Args:
        p: `PARAMS`.
        s: `STATE`.
        u: `INPUTS` with implausible ones masked out.
        y: `OUTPUTS`.
        decel: demanded [m/s^2], may be NaN.
        faults: mask of both words.
        mode: of the ECU.
    """
    e = s.estimate
    started = e.started != 0
    rolls = started and e.speed > STANDING
    y.vehicle_speed = e.speed if started else math.nan
    y.k_f = e.k_f
    y.mode = mode
    y.active_faults, y.active_faults_2 = faults & (1 << WORD) - 1, faults >> WORD
    y.overruns = u.overruns
    y.worst_lateness_us = u.worst_lateness_us
    y.pressure_demand_valid = 1.0 if s.plausibility.sent else 0.0
    y.motor_demand_valid = y.pressure_demand_valid if blends(p) else 0.0
    y.decel_demand_total = decel
    y.accel_x_road = e.accel_x if e.measured else math.nan
    y.accel_x_model = e.accel_x_model
    y.overrun, y.accel_x_zero, y.vehicle_mass = e.overrun, e.accel_bias, e.mass
    y.sigma_brake_force, y.sigma_overrun = e.sigma_force, e.sigma_overrun
    y.overrun_power, y.grip_fall = e.overrun_power, e.grip_fall
    y.grip_limit, y.sigma_grip_limit, y.grip_knee = e.grip_limit, e.sigma_grip_limit, e.grip_knee
    y.motor_torque_share = e.torque_share
    y.pressure_lateness_rise = lateness(p, s.hydraulics, RISE)
    y.pressure_lateness_fall = lateness(p, s.hydraulics, FALL)
    y.braking = s.application.braking
    y.test_ratio_balance, y.test_ratio_speed = e.test_ratio_balance, e.test_ratio_speed
    y.particles_last_brake, y.particles_per_km = s.dust.particles, s.dust.per_km
    y.particles_last_brake_low, y.particles_last_brake_high = s.dust.low, s.dust.high
    y.particle_mass_per_km = s.dust.mass_per_km
    for i in range(4):
        y.pressure_demand[i] = s.limiter.pressure[i] / BAR if mode != FAILED else 0.0
        y.torque_demand[i] = lining_torque(p, BAR * y.pressure_demand[i], s.control, i)
        y.pressure_uncompensated[i] = s.demands.uncompensated[i] / BAR
        y.motor_demand[i] = s.demands.motor[i]
        y.slip[i] = e.slip[i] if rolls else math.nan
        y.wheel_force_x[i] = e.force[i] if rolls else math.nan
        y.wheel_force_z[i] = e.load[i]
        y.mu_b[i] = e.mu[i]
        y.sigma_mu_b[i] = e.sigma[i]
        y.mode_mu_b[i] = e.mode[i]
        y.brake_torque[i] = e.brake_torque[i]
        y.calliper_pressure[i] = u.value[CALLIPER_PRESSURE + i]
        y.pressure_zero[i] = e.pressure_zero[i]
        mapped = p.mapped[CALLIPER_PRESSURE + i] != 0
        y.disc_temperature[i] = s.discs.temperature[i] if mapped else math.nan
        y.sigma_disc_temperature[i] = s.discs.sigma[i] if mapped else math.nan
        y.test_ratio[i] = e.test_ratio[i]
        y.pad_wear[i] = s.wear.wear[i] if mapped else math.nan
        y.sigma_pad_wear[i] = s.wear.sigma[i] if mapped else math.nan
        left = 100.0 * max(1.0 - s.wear.wear[i] / p.pad_life[i], 0.0)
        y.pad_remaining[i] = left if mapped and is_known(s.learned.wear, i) else math.nan
        y.pad_wear_mass[i] = s.wear.mass[i] if mapped else math.nan
