"""Electro-hydraulic brake: from a pressure demand to the calliper pressure.

Model. Second order with dead time, one parameter set for build-up (A.17) and one for release (A.18),
`BUILD_UP` and `RELEASE`; a drawn unit has its own. States: pressure and its rate, shared by both models, so
that a change of model is continuous. Input: the smaller of the demands 15 ms and 26 ms ago: a rise is seen
after the longer, a fall after the shorter dead time. The direction of that input chooses the model; it has
turned when it is HYSTERESIS away from its last extreme. The unit settles below high demands (offset map after
Figure A.10a, straight from a starting pressure on; assumption, the figure has no numbers) and its controller
inverts its own map; an exact inverse cancels the offset. The accumulator limits the pressure, a pump or the
valves its rate. Discretised by the trapezoidal rule (stable at every step, second order).
"""

from typing import Final

from brakelab.plant.jit import Record, kernel
from brakelab.plant.records import HISTORY

BUILD_UP: Final = (0.00075, 0.037, 0.026)  # s^2, s, dead time s (A.17)
RELEASE: Final = (0.00021, 0.045, 0.015)  # s^2, s, dead time s (A.18)
INERTIA, DAMPING, DEAD_TIME = range(3)
HYSTERESIS: Final = 0.5e5  # Pa. Assumption: below this the demand has not turned


@kernel
def second_order(
    value: float, rate: float, target: float, inertia: float, damping: float, dt: float
) -> tuple[float, float]:
    """Return value and rate a step `dt` later of inertia x'' + damping x' + x = target, constant target."""
    half = 0.5 * dt
    weight = half * (damping + half) / inertia
    new_rate = (rate * (1.0 - weight) + 2.0 * half / inertia * (target - value)) / (1.0 + weight)
    return value + half * (rate + new_rate), new_rate


@kernel
def look_back(dead_time: float, dt: float, place: int) -> int:
    """Return the index in a history of the sample that is `dead_time` [s] old, the newest at `place`."""
    return (place - round(dead_time / dt)) % HISTORY


@kernel
def settled_pressure(start: float, slope: float, command: float) -> float:
    """Return the settled pressure [Pa] for a command: `slope` of its excess over `start` [Pa] is lost."""
    return command - slope * max(command - start, 0.0)


@kernel
def command_for(start: float, slope: float, wanted: float) -> float:
    """Return the command [Pa] for which the unit settles at `wanted`: the inverse of `settled_pressure`."""
    return wanted + slope / (1.0 - slope) * max(wanted - start, 0.0)


@kernel
def advance_pressure(params: Record, state: Record, dt: float) -> None:
    """Advance the four calliper pressures by `dt` [s]; the newest demand is in the history already."""
    rising = look_back(params.build_up[DEAD_TIME], dt, state.place)
    falling = look_back(params.release[DEAD_TIME], dt, state.place)
    for wheel in range(4):
        demand = min(state.demand_history[rising, wheel], state.demand_history[falling, wheel])
        command = command_for(params.offset_start, params.offset_known, demand)
        demand = settled_pressure(params.offset_start, params.offset_slope, command)
        demand = min(max(demand, 0.0), params.pressure_limit[wheel])
        extreme = state.turning_point[wheel]
        if state.releasing[wheel]:
            extreme = min(extreme, demand)
            if demand > extreme + HYSTERESIS:
                state.releasing[wheel] = 0
                extreme = demand
        else:
            extreme = max(extreme, demand)
            if demand < extreme - HYSTERESIS:
                state.releasing[wheel] = 1
                extreme = demand
        state.turning_point[wheel] = extreme
        model = params.release if state.releasing[wheel] else params.build_up
        pressure, rate = second_order(
            state.pressure[wheel], state.pressure_rate[wheel], demand, model[INERTIA], model[DAMPING], dt
        )
        limited = min(max(rate, -params.fall_limit), params.rise_limit)
        if limited != rate:
            pressure = state.pressure[wheel] + 0.5 * dt * (state.pressure_rate[wheel] + limited)
            rate = limited
        if pressure < 0.0 or pressure > params.pressure_limit[wheel]:
            pressure = min(max(pressure, 0.0), params.pressure_limit[wheel])
            rate = 0.0
        state.pressure[wheel] = pressure
        state.pressure_rate[wheel] = rate
