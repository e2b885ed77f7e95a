"""Brake in its enclosure on the road: load by a trip, emission, and the counter's reading.

The brake of one corner follows a speed trace: the brakes supply the force not given by drag, rolling, grade
and engine. Air is drawn through the enclosure and a tunnel (Figure 8.1); there

    n' = (1 - d) N' + s / T_s - n / T_m             n mixes in the enclosure
    s' = d N' - s / T_s                             a share d settles and comes off later, while driving
    c(t) = n(t - delay) / (T_m Q) + background      Q: flow of the tunnel

and the counter answers with a lag and is read once a second. The background grows with speed; traffic makes
it wander log-normally. The emission of an application scatters log-normally about the law of `emission.py`.

Source: sections 8.2 to 8.4. Assumption: all constants below.
"""

from typing import Final

import numpy as np

from brakelab.plant.disc import cooling_rate, disc_step
from brakelab.plant.emission import conditioning, emission_rate, treat
from brakelab.plant.friction.law import START
from brakelab.plant.friction.laws import friction
from brakelab.plant.jit import Record, kernel
from brakelab.plant.records import GRAVITY

STEP: Final = 0.01  # s
SAMPLE: Final = 10  # steps: 10 Hz
COUNTED: Final = 100  # steps: the counter is read once a second
STORED: Final = 200  # steps, longest transport delay of the air
PRESSES: Final = 0.30  # m/s^2 of the brakes, from which the driver presses the pedal
LEAVES: Final = 0.05  # m/s^2
ACTUATION: Final = 0.12  # s, lag of the torque
HELD: Final = 12e5  # Pa, at standstill
CUBIC_METRE: Final = 1e6  # cm^3

TRIP: Final = np.dtype(
    [
        ("overrun", "f8"),  # m/s^2, by the engine, foot off
        ("ambient", "f8"),  # degC
        ("flow", "f8"),  # m^3/s of the tunnel
        ("delay", "f8"),  # s, transport delay of the air
        ("mixing", "f8"),  # s
        ("response", "f8"),  # s of the counter
        ("settles", "f8"),  # share that settles in enclosure and tunnel
        ("settled_for", "f8"),  # s
        ("background", "f8"),  # 1/cm^3 of still air
        ("background_by_speed", "f8"),  # 1/cm^3 per m/s
        ("work", "f8"),  # J of this brake before the trip
        ("treatment", "f8"),  # -, of its surface before the trip
        ("day", "f8"),  # -, factor on the emission
    ],
    align=True,
)
T, SPEED, PRESSURE, TORQUE, HEAT, CONCENTRATION, EMITTED = range(7)
"""Columns of what a trip leaves: s, m/s, Pa above push-out, N m, degC, 1/cm^3, particles so far."""


@kernel
def _asked(car: Record, wheel: int, speed: float, accel: float, grade: float, overrun: float) -> float:
    """Return the torque [N m] demanded of this brake, ideally distributed; may be negative."""
    drag = car.drag_factor * speed * speed / car.mass
    rest = drag + GRAVITY * (car.rolling_resistance + grade) + overrun
    brakes = -accel - rest
    length = car.front_length + car.rear_length
    transfer = car.cog_height * max(-accel, 0.0) / GRAVITY
    share = (car.rear_length + transfer if wheel < 2 else car.front_length - transfer) / length
    return 0.5 * share * car.mass * brakes * car.free_radius[wheel]


@kernel
def run_trip(
    car: Record, wheel: int, trip: Record, drive: Record, wander: Record, scatter: Record, out: Record
) -> tuple[int, int]:
    """Drive a trip; return rows of `out` written and applications.

    Args:
        car: the plant's parameters.
        wheel: the corner.
        trip: `TRIP`.
        drive: speed [m/s], acceleration [m/s^2] and grade [rad] every `STEP`, shape (n, 3).
        wander: factor on the background every `STEP`, shape (n,).
        scatter: factor on the emission of each application, shape (m,).
        out: overwritten, shape (rows, 7), see `T` and those after.
    """
    row, law, lining = car.emission_row[wheel], car.friction_law[wheel], car.friction_row[wheel]
    lever = 2.0 * car.piston_area[wheel] * car.effective_radius[wheel]
    heat, mu, memory, torque = trip.ambient, 0.4, lining[START], 0.0
    work, treatment, emitted, settled, mixed, shown = trip.work, trip.treatment, 0.0, 0.0, 0.0, 0.0
    last, presses, count, rows = 0.0, False, 0, 0
    delayed = np.zeros(STORED)
    delay = min(int(trip.delay / STEP), STORED - 1)
    for k in range(len(drive)):
        speed, accel, grade = drive[k, 0], drive[k, 1], drive[k, 2]
        asked = _asked(car, wheel, speed, accel, grade, trip.overrun)
        unit = 0.5 * car.mass * car.free_radius[wheel]
        if not presses and speed > 0.5 and asked > 0.5 * PRESSES * unit:
            presses, memory = True, lining[START]
            count += 1
        elif presses and (asked < 0.5 * LEAVES * unit or speed <= 0.0):
            presses = False
        torque += STEP / ACTUATION * ((max(asked, 0.0) if presses else 0.0) - torque)
        omega = speed / car.free_radius[wheel]
        sliding = car.effective_radius[wheel] * omega
        pressure = torque / (lever * max(mu, 0.05))
        if torque > 1.0 and speed > 0.0:
            slowing = torque / (unit * car.free_radius[wheel])
            memory, now = friction(law, lining, memory, pressure, sliding, slowing, heat, STEP)
            mu = car.friction_scale[wheel] * now
        power = torque * omega
        rate = emission_rate(row, power, sliding, heat) * conditioning(row, work, treatment)
        rate *= trip.day * car.emission_scale[wheel] * scatter[min(max(count - 1, 0), len(scatter) - 1)]
        treatment = treat(row, treatment, power, heat, STEP)
        work += power * STEP
        emitted += rate * STEP
        comes_off = settled / trip.settled_for if speed > 0.5 else 0.0
        settled += STEP * (trip.settles * rate - comes_off)
        mixed += STEP * ((1.0 - trip.settles) * rate + comes_off - mixed / trip.mixing)
        delayed[k % STORED] = mixed / trip.mixing / trip.flow / CUBIC_METRE
        arrives = delayed[(k - delay) % STORED]
        air = wander[k] * (trip.background + trip.background_by_speed * speed)
        shown += STEP / trip.response * (arrives + air - shown)
        cooling = cooling_rate(car.cooling[wheel], car.cooling_by_speed[wheel], speed, 0.0)
        heat = disc_step(heat, car.heating[wheel], cooling, power, trip.ambient, STEP)
        if k % COUNTED == 0:
            last = shown
        if k % SAMPLE == 0:
            line = out[rows]
            held = HELD if speed <= 0.0 else pressure
            line[T], line[SPEED], line[PRESSURE], line[TORQUE] = k * STEP, speed, held, torque
            line[HEAT], line[CONCENTRATION], line[EMITTED] = heat, last, emitted
            rows += 1
    return rows, count
