"""A pad as no law under test has it: plateaus that heat builds, a film that running-in leaves, and chance.

Model. Contact temperature T_c of the plateaus, share n of secondary plateaus, film f, chance x, with p
pressure, v sliding speed and T disc temperature; w the sliding distance of the pad:

    T_c' = (T + flash p v - T_c) / 0.3 s
    dn/dw = (B (1 - n) - D n) / distance,   B = birth exp(-E (1/T_c - 1/373 K)) (p / 30 bar)^press
                                       D = 1 + wear p v / 30 MPa m/s + 3 S((T_c - fade_at) / 40 K)
    df/dw = (1 - f) / 600 m - S((T_c - fade_at) / 40 K) f / 80 m,   S the logistic function
    mu_b = (mu_0 + mu_n n (0.8 + 0.2 f)) (1 - fade S((T_c - fade_at) / 60 K)) exp(x + x_stop)

x is a first-order Markov process over distance (5 m, `ripple`), x_stop a draw per application (`scatter`).
At the release half of what n differs from its value at rest is lost. T_c is not measured, n and f outlive
the stop: so the same stop depends on what was before it. The disc's heat capacity rises with temperature
(xi of 3.7, Figure 3.6a), which the lining file and every lumped model leave out: theirs holds at 100 degC.

Source. The ingredients are those of sections 2.3 and 3.3 (plateaus that temperature, pressure and shear build
and wear destroys; decay above a critical temperature); the form and the numbers are an assumption, chosen so
that a constant pressure cycle correlates roughly as Table 3.2 has it and AMS fades as Table 3.4 measured.
"""

import math
from typing import Final

import numpy as np
from numpy.random import Generator

from brakelab.plant.disc import cooling_rate, disc_step
from brakelab.plant.dynamometer import DECELERATION, DRAG, HIGHEST_PRESSURE, SMALLEST_LEVER
from brakelab.plant.friction.law import KELVIN
from brakelab.plant.jit import Record, kernel
from brakelab.plant.records import RecordArray, new_record

PAD: Final = np.dtype(
    [
        ("mu_0", "f8"),
        ("mu_n", "f8"),
        ("birth", "f8"),
        ("activation", "f8"),  # K
        ("press", "f8"),
        ("wear", "f8"),
        ("flash", "f8"),  # K per Pa m/s
        ("distance", "f8"),  # m
        ("fade", "f8"),
        ("fade_at", "f8"),  # degC
        ("scatter", "f8"),
        ("ripple", "f8"),
    ],
    align=True,
)
STATE: Final = np.dtype(
    [
        ("plateaus", "f8"),
        ("film", "f8"),
        ("contact_temperature", "f8"),  # degC
        ("ripple", "f8"),
        ("scatter", "f8"),
    ],
    align=True,
)

MEDIANS: Final[dict[str, tuple[float, ...]]] = {
    "A": (0.250, 0.420, 1.1, 1500.0, 0.45, 0.70, 0.9e-6, 7.0, 0.55, 390.0, 0.020, 0.012),
    "B": (0.200, 0.520, 0.9, 1600.0, 0.45, 0.70, 0.7e-6, 8.0, 0.30, 460.0, 0.030, 0.015),
    "C": (0.230, 0.370, 1.2, 1500.0, 0.35, 0.70, 0.8e-6, 7.0, 0.65, 365.0, 0.025, 0.012),
}
SPREAD: Final = 0.06
"""Standard deviation of the logarithm of each number between pads of one make."""
REST: Final = 0.30  # share of plateaus that a pad at rest tends to
KEPT: Final = 0.5
FLASH_TIME: Final = 0.3  # s
RIPPLE_DISTANCE: Final = 5.0  # m
PRESSURE: Final = 30e5  # Pa
POWER: Final = 30e6  # Pa m/s
LEAST_DEMAND: Final = 0.3  # of a demand that falls
CAPACITY_RISE: Final = 8e-4  # 1/K, of the heat capacity; the straight line of EN 1993-1-2 (steel) to 400 degC
CAPACITY_AT: Final = 100.0  # degC


def draw_pad(brake: str, random: Generator) -> RecordArray:
    """Return one pad of the make of brake A, B or C, shape (1,), dtype PAD."""
    pad = new_record(PAD)
    pad[0] = tuple(value * math.exp(SPREAD * random.standard_normal()) for value in MEDIANS[brake])
    return pad


def bedded(ambient: float) -> RecordArray:
    """Return the state of a pad that was bedded in, at `ambient` [degC], shape (1,), dtype STATE."""
    state = new_record(STATE)
    state[0] = (REST, 0.8, ambient, 0.0, 0.0)
    return state


@kernel
def apply(pad: Record, state: Record, temperature: float, random: Generator) -> None:
    """Start an application on a disc of `temperature` [degC]."""
    state.plateaus = REST + KEPT * (state.plateaus - REST)
    state.contact_temperature = temperature
    state.scatter = pad.scatter * random.standard_normal()


@kernel
def logistic(x: float) -> float:
    """Return 1 / (1 + exp(-x)), x within 40."""
    return 1.0 / (1.0 + math.exp(-min(max(x, -40.0), 40.0)))


@kernel
def rub(
    pad: Record,
    state: Record,
    pressure: float,
    speed: float,
    temperature: float,
    dt: float,
    random: Generator,
) -> float:
    """Return mu_b `dt` [s] later, at `pressure` [Pa], sliding `speed` [m/s], disc `temperature` [degC]."""
    power = pressure * speed
    goal = temperature + pad.flash * power
    state.contact_temperature += (goal - state.contact_temperature) * dt / FLASH_TIME
    distance = speed * dt
    kelvin = state.contact_temperature + KELVIN
    burnt = logistic((state.contact_temperature - pad.fade_at) / 40.0)
    births = pad.birth * math.exp(-pad.activation * (1.0 / kelvin - 1.0 / 373.15))
    births *= (max(pressure, 1e3) / PRESSURE) ** pad.press
    deaths = 1.0 + pad.wear * power / POWER + 3.0 * burnt
    state.plateaus += (births * (1.0 - state.plateaus) - deaths * state.plateaus) * distance / pad.distance
    state.film += distance * ((1.0 - state.film) / 600.0 - burnt * state.film / 80.0)
    kept = math.exp(-distance / RIPPLE_DISTANCE)
    state.ripple = kept * state.ripple + pad.ripple * math.sqrt(1.0 - kept * kept) * random.standard_normal()
    mu = pad.mu_0 + pad.mu_n * state.plateaus * (0.8 + 0.2 * state.film)
    mu *= 1.0 - pad.fade * logistic((state.contact_temperature - pad.fade_at) / 60.0)
    return float(mu * math.exp(state.ripple + state.scatter))


@kernel
def run_pad(
    rig: Record,
    stop: Record,
    fall: float,
    pad: Record,
    state: Record,
    random: Generator,
    trace: Record,
    dt: float,
) -> int:
    """Run a stop as brakelab.plant.dynamometer does, with the pad's friction; return the number of steps.

    `fall` [1/s]: the demand falls by this share of itself per second, down to LEAST_DEMAND.
    """
    lever = 2.0 * rig.piston_area * rig.effective_radius
    inertia = rig.mass * rig.tyre_radius * rig.tyre_radius
    omega = stop.speed / rig.tyre_radius
    temperature = stop.temperature
    apply(pad, state, temperature, random)
    mu = pad.mu_0 + pad.mu_n * state.plateaus
    wanted = rig.mass * stop.deceleration * rig.tyre_radius
    steps = 0
    while steps < trace.shape[0]:
        speed = omega * rig.tyre_radius
        if (speed <= stop.end_speed and stop.control != DRAG) or temperature >= stop.end_temperature:
            break
        t = steps * dt
        share = min(t / stop.ramp, 1.0)
        asked = share * max(1.0 - fall * t, LEAST_DEMAND)
        if stop.control == DECELERATION:
            pressure = min(asked * wanted / max(lever * mu, SMALLEST_LEVER), HIGHEST_PRESSURE)
        else:
            pressure = asked * stop.pressure
        mu = rub(pad, state, pressure, rig.effective_radius * omega, temperature, dt, random)
        torque = lever * mu * pressure
        now = trace[steps]
        now.t, now.share, now.pressure, now.speed = t, share, pressure, speed
        now.temperature, now.memory, now.mu_b, now.torque = temperature, state.plateaus, mu, torque
        cooling = cooling_rate(rig.cooling, rig.cooling_by_speed, speed, rig.wetness)
        heating = rig.heating / (1.0 + CAPACITY_RISE * (temperature - CAPACITY_AT))
        temperature = disc_step(temperature, heating, cooling, torque * omega, rig.ambient, dt)
        if stop.control != DRAG:
            omega -= dt * torque / inertia
        steps += 1
    return steps
