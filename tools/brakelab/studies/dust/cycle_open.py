"""A car over a cycle at the level of its brakes: no wheels, no observer, ideal pressure.

The driver touches the brakes where the trace asks for `PRESSES` more than drag, rolling and grade give, and
then they give all of it, unless motors take their part. Forces are shared by the configured distribution or
by the ECU's own tables (`control.minimise`); heat, emission and wear are those of the plant's laws.
"""

from typing import Any, Final, NamedTuple

import numpy as np

from brakelab.arrays import Array
from brakelab.plant.disc import cooling_rate, disc_step
from brakelab.plant.driver import LIFT_OFF_DECEL
from brakelab.plant.dynamometer import AMBIENT
from brakelab.plant.emission import conditioning, emission_rate, treat
from brakelab.plant.jit import Record, kernel
from brakelab.plant.records import GRAVITY, RecordArray
from brakelab.plant.wear import wear_rate
from brakelab.simulation.trip.generate import real_driving
from brakelab.simulation.trip.wltp_brake import DISC_AT_START, TRIPS, wltp_brake
from ecu.algorithm.control.cleaner_share import CLEANER_STATE, lean
from ecu.algorithm.control.distribution import front_share
from ecu.contract.records import RecordArray as Params

STEP: Final = 0.1  # s
REFERENCE_FRICTION: Final = 0.4  # pressure and normal force for wear


class OpenDrive(NamedTuple):
    """Sums of a car's brakes over a cycle; shape (4,) each."""

    particles: Array
    worn: Array
    """g"""
    work: Array
    """J"""
    hottest: Array
    """degC"""


def profile(t: Array, speed: Array, grade: Array) -> Array:
    """Return speed [m/s], acceleration [m/s^2] and grade [rad] every `STEP`, shape (n, 3)."""
    fine = np.arange(0.0, t[-1], STEP)
    v = np.interp(fine, t, speed)
    return np.column_stack((v, np.gradient(v, STEP), np.interp(fine, t, grade)))


def real_driving_profile() -> list[tuple[float, Array]]:
    """Return the trip of seed 1 as its disc temperature at the start [degC] and its `profile`."""
    trip = real_driving(1)
    return [(20.0, profile(trip.t, trip.speed, trip.grade_by_time()))]


def wltp_brake_profile() -> list[tuple[float, Array]]:
    """Return the trips of the WLTP-Brake cycle likewise."""
    knots = [wltp_brake(number) for number in range(1, len(TRIPS) + 1)]
    level = [profile(rows[:, 0], rows[:, 1], np.zeros(len(rows))) for rows in knots]
    return list(zip(DISC_AT_START, level, strict=True))


@kernel
def _brake(
    car: Record,
    params: Record,
    cleaner: Record,
    drive: Any,
    ambient: float,
    heat: Any,
    sums: Any,
    treatment: Any,
) -> None:
    """Brake along `drive`; `sums`, shape (4, 4), grows by particles, g, J, and holds the hottest."""
    torque, motors = np.zeros(4), np.zeros(4)
    for k in range(len(drive)):
        speed, accel, grade = drive[k, 0], drive[k, 1], drive[k, 2]
        drag = car.drag_factor * speed * speed / car.mass
        decel = -accel - drag - GRAVITY * (car.rolling_resistance + grade)
        if decel < LIFT_OFF_DECEL or speed < 0.3:
            decel = 0.0
        front = front_share(params, decel)
        for i in range(4):
            axle = front if i < 2 else 1.0 - front
            torque[i] = 0.5 * axle * params.mass * decel * params.wheel_radius[i]
        if params.minimised:
            lean(params, cleaner, torque, motors, heat, front, params.mass, decel, True, STEP)
        for i in range(4):
            row, power = car.emission_row[i], torque[i] / car.free_radius[i] * speed
            sliding = car.effective_radius[i] * speed / car.free_radius[i]
            if power > 0.0:
                rate = emission_rate(row, power, sliding, heat[i]) * car.emission_scale[i]
                sums[0, i] += STEP * rate * conditioning(row, 1e9, treatment[i])
                treatment[i] = treat(row, treatment[i], power, heat[i], STEP)
                force = torque[i] / (REFERENCE_FRICTION * car.effective_radius[i])
                pressure = 0.5 * force / car.piston_area[i]
                sums[1, i] += (
                    STEP * car.wear_scale[i] * wear_rate(car.wear_row[i], force, sliding, pressure, heat[i])
                )
                sums[2, i] += STEP * power
            cooling = cooling_rate(car.cooling[i], car.cooling_by_speed[i], speed, 0.0)
            heat[i] = disc_step(heat[i], car.heating[i], cooling, power, ambient, STEP)
            sums[3, i] = max(sums[3, i], heat[i])


def drive_open(car: RecordArray, params: Params, trips: list[tuple[float, Array]]) -> OpenDrive:
    """Return the sums of a drawn car's brakes on `trips`; `params` of its ECU, shape (1,)."""
    sums, treatment = np.zeros((4, 4)), np.zeros(4)
    for begins, drive in trips:
        cleaner = np.zeros(1, CLEANER_STATE)
        _brake(car[0], params[0], cleaner[0], drive, AMBIENT, np.full(4, begins), sums, treatment)
    return OpenDrive(*sums)
