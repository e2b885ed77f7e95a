"""Brake dynamometer: one brake, a flywheel for a quarter car, and the conditions imposed on them (3.2).

A stop runs from a speed to a speed, or for a time, or up to a temperature, under one of four controls:

PRESSURE      a pressure is held, the flywheel runs free
DECELERATION  the pressure, up to 210 bar, follows from the present friction for the demanded deceleration
REPLAY        a measured pressure and the speed are imposed, friction is observed; the heat is measured too
DRAG          pressure and speed are held

All ramp up over `ramp`. I = m r_tyre^2, T_b = 2 mu_b p A_k r_eff (corrected: A_k sums the pistons of a side).
Mean friction as SAE J2522 has it: from 90 % of the pressure to the end, by distance or by time.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from brakelab.plant.disc import cooling_rate, disc_step
from brakelab.plant.friction.law import ROW, START
from brakelab.plant.friction.laws import friction
from brakelab.plant.jit import Record, kernel
from brakelab.plant.records import RecordArray, new_record

STEP: Final = 1e-3  # s
AMBIENT: Final = 20.0  # degC
RAMP: Final = 0.15  # s. Assumption
LONGEST_S: Final = 180.0  # s of a stop
HIGHEST_PRESSURE: Final = 210e5  # Pa (3.2)
SMALLEST_LEVER: Final = 1e-9  # m^3, keeps the quotient finite for a brake without friction
PRESSURE, DECELERATION, REPLAY, DRAG = range(4)

# Test object on the rig.
RIG: Final = np.dtype(
    [
        ("law", "i8"),
        ("row", "f8", (ROW,)),
        ("mass", "f8"),  # kg, of the quarter car represented by the flywheel
        ("gain", "f8"),  # rad/s^2 per Pa, 2 A_k r_eff / I
        ("piston_area", "f8"),  # m^2
        ("effective_radius", "f8"),  # m
        ("tyre_radius", "f8"),  # m
        ("heating", "f8"),  # K/J
        ("cooling", "f8"),  # 1/s
        ("cooling_by_speed", "f8"),  # 1/m
        ("ambient", "f8"),  # degC
        ("wetness", "f8"),  # -
    ],
    align=True,
)

# Demands of one stop.
STOP: Final = np.dtype(
    [
        ("control", "i8"),
        ("speed", "f8"),  # m/s
        ("end_speed", "f8"),  # m/s
        ("pressure", "f8"),  # Pa; PRESSURE, DRAG
        ("deceleration", "f8"),  # m/s^2 of the car; DECELERATION, REPLAY
        ("measured_mu", "f8"),  # -; REPLAY: turns the measured torque into the measured pressure
        ("temperature", "f8"),  # degC, of the disc at the start
        ("end_temperature", "f8"),  # degC; inf: none
        ("ramp", "f8"),  # s
    ],
    align=True,
)

# Recorded at every step.
TRACE: Final = np.dtype(
    [
        ("t", "f8"),  # s
        ("share", "f8"),  # of the full pressure or deceleration
        ("pressure", "f8"),  # Pa
        ("speed", "f8"),  # m/s, of the car
        ("temperature", "f8"),  # degC
        ("memory", "f8"),
        ("mu_b", "f8"),
        ("torque", "f8"),  # N m
    ],
    align=True,
)


@kernel
def run(rig: Record, stop: Record, trace: Record, dt: float) -> int:
    """Run a stop in steps of `dt` [s] into `trace`, whose length ends it; return the number of steps."""
    lever = 2.0 * rig.piston_area * rig.effective_radius
    inertia = rig.mass * rig.tyre_radius * rig.tyre_radius
    omega = stop.speed / rig.tyre_radius
    temperature = stop.temperature
    memory = rig.row[START]
    # Initial friction for the control: the law's at the first contact.
    sliding = rig.effective_radius * omega
    memory, mu = friction(rig.law, rig.row, memory, 0.0, sliding, 0.0, temperature, 0.0)
    wanted = rig.mass * stop.deceleration * rig.tyre_radius
    steps = 0
    while steps < trace.shape[0]:
        speed = omega * rig.tyre_radius
        if (speed <= stop.end_speed and stop.control != DRAG) or temperature >= stop.end_temperature:
            break
        t = steps * dt
        share = min(t / stop.ramp, 1.0)
        if stop.control == DECELERATION:
            pressure = min(share * wanted / max(lever * mu, SMALLEST_LEVER), HIGHEST_PRESSURE)
        elif stop.control == REPLAY:
            pressure = share * wanted / (lever * stop.measured_mu)
        else:
            pressure = share * stop.pressure
        slowing = rig.gain * mu * pressure
        if stop.control == REPLAY:
            slowing = share * stop.deceleration / rig.tyre_radius
        elif stop.control == DRAG:
            slowing = 0.0
        sliding = rig.effective_radius * omega
        memory, mu = friction(rig.law, rig.row, memory, pressure, sliding, slowing, temperature, dt)
        torque = share * wanted if stop.control == REPLAY else lever * mu * pressure
        now = trace[steps]
        now.t, now.share, now.pressure, now.speed = t, share, pressure, speed
        now.temperature, now.memory, now.mu_b, now.torque = temperature, memory, mu, torque
        cooling = cooling_rate(rig.cooling, rig.cooling_by_speed, speed, rig.wetness)
        temperature = disc_step(temperature, rig.heating, cooling, torque * omega, rig.ambient, dt)
        if stop.control != DRAG:
            omega -= dt * torque / inertia
        steps += 1
    return steps


def new_stop(
    control: int,
    speed: float,
    end_speed: float,
    temperature: float,
    *,
    pressure: float = 0.0,
    deceleration: float = 0.0,
    measured_mu: float = 0.0,
    end_temperature: float = np.inf,
) -> RecordArray:
    """Return the demands of a stop, shape (1,): speeds [m/s], temperatures [degC], pressure [Pa]."""
    record = new_record(STOP)
    record[0] = (
        control,
        speed,
        end_speed,
        pressure,
        deceleration,
        measured_mu,
        temperature,
        end_temperature,
        RAMP,
    )
    return record


def run_stop(
    rig: RecordArray, stop: RecordArray, dt: float = STEP, longest: float = LONGEST_S
) -> RecordArray:
    """Return the trace of a stop, at most `longest` [s]; dtype TRACE, one entry per step."""
    trace = np.empty(round(longest / dt), TRACE)
    return trace[: run(rig[0], stop[0], trace, dt)].copy()


def mean_friction(trace: RecordArray, by_distance: bool = True) -> float:
    """Return the mean friction from 90 % of the pressure on, by distance or by time (SAE J2522)."""
    braked = trace[trace["share"] >= 0.9]
    weight: NDArray[np.float64] | None = braked["speed"] if by_distance else None
    return float(np.average(braked["mu_b"], weights=weight))


def nominal_friction(rig: RecordArray) -> float:
    """Return the nominal friction as SAE J2522 measures it: 30 bar, from 80 to 30 km/h, disc at 100 degC."""
    return mean_friction(run_stop(rig, new_stop(PRESSURE, 80.0 / 3.6, 30.0 / 3.6, 100.0, pressure=30e5)))


def cool(rig: RecordArray, speed: float, temperature: float, to: float) -> float:
    """Return the time [s] in which a disc cools from `temperature` to `to` [degC] at `speed` [m/s]."""
    rate = cooling_rate(rig[0]["cooling"], rig[0]["cooling_by_speed"], speed, rig[0]["wetness"])
    ambient = rig[0]["ambient"]
    return float(np.log((temperature - ambient) / (to - ambient)) / rate)
