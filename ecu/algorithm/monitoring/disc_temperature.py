"""Temperature of the four discs by a thermal model of the ECU's own estimates, with its standard deviation.

Model. Each disc is one lump of heat, theta [K] above the air (3.7):

    theta' = xi T_b |omega| - (delta_0 + delta_1 v) theta

T_b is the ECU's own brake torque, v its vehicle speed, xi constant as in Table C.1; in rain delta_0 and
delta_1 are those of a wet disc (Figure 7.15). The disc follows a change of air temperature at once and so is
never colder. Solved exactly over a cycle of constant power and speed. `brake-ecu identify thermal` fits xi,
both pairs of delta and their errors to a car.

Error. Each cause is one constant unknown whose effect accumulates linearly along the model; independent
causes add as squares:

    heating     s_h' = e_h xi T_b |omega| - delta s_h    e_h: heat capacity, heat split, friction
    cooling     s_c' = e_c delta theta - delta s_c       e_c: relative error of delta
    start       s_0' = -delta s_0                        the unknown rest before the first cycle
    air         constant

So the standard deviation grows with the heat put in and falls towards that of the air at rest.

Start. The disc temperature is uniformly distributed between that of the air and the highest that the last
application can have left (`learned.disc_excess`; the daemon lowers it by a rest that its clock tells). A
thermocouple in a recording tells more, at its first sample; afterwards it is a reference, and no input.

Where a pressure is lost, the wheel's share by load of the total tyre force counts as heat, and as its error.

Source. Sections 3.4 and 7.6.1 (rain), Table C.1. Assumptions: all constants below without a source.
"""

import math

import numpy as np

from ecu.algorithm.inputs import usable
from ecu.contract.signals import (
    AMBIENT_TEMPERATURE,
    CALLIPER_PRESSURE,
    DISC_TEMPERATURE_MEASURED,
    OBSERVING,
    RAIN,
    WHEEL_SPEED,
)
from ecu.jit import Record, kernel

DISC_STATE = np.dtype(
    [
        ("excess", "f8", (4,)),  # theta, above the air [K]
        ("sigma_heating", "f8", (4,)),  # K
        ("sigma_cooling", "f8", (4,)),
        ("sigma_start", "f8", (4,)),
        ("sigma", "f8", (4,)),  # of the temperature, all causes [K]
        ("temperature", "f8", (4,)),  # degC
        ("observed_at", "f8", (4,)),  # temperature when friction was last observed [degC]
        ("ambient", "f8"),  # degC
        ("power", "f8", (4,)),  # of friction, W
        ("omega", "f8", (4,)),  # of the wheel, rad/s
    ],
    align=True,
)

GREATEST_EXCESS = 1200.0  # K above the air: cast iron melts
UNKNOWN_EXCESS = 200.0  # K above the air at most, where nothing was ever saved
RAIN_UNKNOWN_ERROR = 0.40  # of delta where rain is not reported
THERMOCOUPLE_ERROR = 5.0  # K: of a disc at rest, by where it touches
AMBIENT_ERROR = 3.0  # K: difference between the air at the wheel and at the sensor
AMBIENT_UNKNOWN = 15.0  # K: no sensor, or none received
FRICTION_PER_KELVIN = 0.04 / 100.0  # relative change of friction, its sign unknown
UNIFORM = math.sqrt(3.0)  # half the width of a uniform distribution per standard deviation


@kernel
def start_discs(params: Record, state: Record, learned: Record) -> None:
    """Start after a rest of unknown length: between the air and `learned.disc_excess` [K] above it."""
    state.ambient = params.ambient_temperature
    for i in range(4):
        half = 0.5 * learned.disc_excess[i]
        state.excess[i], state.sigma_start[i] = half, half / UNIFORM
        state.observed_at[i] = state.ambient + half


@kernel
def update_discs(
    params: Record,
    state: Record,
    learned: Record,
    inputs: Record,
    estimate: Record,
    application: Record,
    dt: float,
) -> None:
    """Overwrite temperature and standard deviation of every disc after `dt` [s].

    The force of all tyres, negative when braking, and the wheel loads of `estimate` serve where a pressure is
    lost. At the end of an application `learned.disc_excess` becomes the greatest possible excess over the
    air.
    """
    sigma_ambient = AMBIENT_UNKNOWN
    if usable(inputs, AMBIENT_TEMPERATURE):
        state.ambient, sigma_ambient = inputs.value[AMBIENT_TEMPERATURE], AMBIENT_ERROR
    speed, load = estimate.speed, estimate.load
    rain_known = usable(inputs, RAIN)
    wet = rain_known and inputs.value[RAIN] > 0.5
    last, stays = -1.0, 1.0
    load_sum = load[0] + load[1] + load[2] + load[3]
    for i in range(4):
        if state.sigma_start[i] > THERMOCOUPLE_ERROR and usable(inputs, DISC_TEMPERATURE_MEASURED + i):
            state.excess[i] = max(inputs.value[DISC_TEMPERATURE_MEASURED + i] - state.ambient, 0.0)
            state.sigma_start[i] = THERMOCOUPLE_ERROR
            state.observed_at[i] = state.ambient + state.excess[i]
        seen = usable(inputs, WHEEL_SPEED + i)
        omega = abs(inputs.value[WHEEL_SPEED + i]) if seen else abs(speed) / params.wheel_radius[i]
        if usable(inputs, CALLIPER_PRESSURE + i):
            power = heating_error = 0.0
            # The noise of a released brake has a mean above zero once negative torque is cut off.
            if application.braking:
                power = estimate.brake_torque[i] * omega
                heating_error = math.hypot(params.sigma_disc_heating[i], estimate.sigma[i] / estimate.mu[i])
        else:
            power = max(-estimate.tyre_force, 0.0) * load[i] / load_sum * abs(speed)
            heating_error = 1.0
        state.power[i], state.omega[i] = power, omega
        if wet:
            rate = params.disc_cooling_wet[i] + params.disc_cooling_by_speed_wet[i] * abs(speed)
            cooling_error = params.sigma_disc_cooling_wet[i]
        else:
            rate = params.disc_cooling[i] + params.disc_cooling_by_speed[i] * abs(speed)
            cooling_error = params.sigma_disc_cooling[i] if rain_known else RAIN_UNKNOWN_ERROR
        if rate != last:  # discs of an axle cool alike
            last, stays = rate, math.exp(-rate * dt)
        _advance(state, i, params.disc_heating[i] * power, heating_error, rate, cooling_error, stays)
        parts = state.sigma_heating[i] ** 2 + state.sigma_cooling[i] ** 2 + state.sigma_start[i] ** 2
        state.sigma[i] = math.sqrt(parts + sigma_ambient**2)
        state.temperature[i] = state.ambient + state.excess[i]
        if estimate.mode[i] == OBSERVING:
            state.observed_at[i] = state.temperature[i]
        if application.ended:
            learned.disc_excess[i] = min(state.excess[i] + UNIFORM * state.sigma[i], GREATEST_EXCESS)


@kernel
def _advance(
    state: Record,
    i: int,
    warming: float,
    heating_error: float,
    rate: float,
    cooling_error: float,
    stays: float,
) -> None:
    """Advance the excess and its errors of one disc by `warming` [K/s] and cooling at `rate` [1/s].

    `stays`: share of the excess that is left after the cycle.
    """
    gain = (1.0 - stays) / rate
    state.sigma_heating[i] = stays * state.sigma_heating[i] + heating_error * gain * warming
    state.sigma_cooling[i] = stays * state.sigma_cooling[i] + cooling_error * rate * gain * state.excess[i]
    state.sigma_start[i] *= stays
    state.excess[i] = stays * state.excess[i] + gain * warming


@kernel
def heat_widening(state: Record, i: int) -> float:
    """Return the relative standard deviation that a friction observed earlier has gained by the disc's heat.

    It follows from the temperature change since, in either direction, not from a map of friction over
    temperature.
    """
    change: float = state.temperature[i] - state.observed_at[i]
    return FRICTION_PER_KELVIN * abs(change)
