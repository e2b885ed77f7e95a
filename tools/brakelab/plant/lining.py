"""The four brakes of a car: pressure becomes friction, torque and heat.

The friction law of every corner is one of `friction/laws.py`, the disc that of `disc.py`. An application
starts when the pressure passes the push-out pressure; the law's memory then has its starting value.
Torque: T_b = 2 mu_b (p - p_0) A_k r_eff (A.19, corrected: A_k sums the pistons of one side already).
"""

from brakelab.plant.disc import cooling_rate, disc_step
from brakelab.plant.friction.law import START
from brakelab.plant.friction.laws import friction
from brakelab.plant.jit import Record, kernel


@kernel
def advance_lining(params: Record, state: Record, dt: float) -> None:
    """Advance memory and friction of the four linings by `dt` [s] and set the brake torque [N m]."""
    for wheel in range(4):
        pressure = state.pressure[wheel] - params.push_out_pressure[wheel]
        row = params.friction_row[wheel]
        radius = params.effective_radius[wheel]
        if pressure <= 0.0:
            state.applied[wheel] = 0
            pressure = 0.0
        elif not state.applied[wheel]:
            state.applied[wheel] = 1
            state.lining_memory[wheel] = row[START]
        # At standstill nothing slides: friction is that of the resting contact.
        slides = dt if state.wheel_speed[wheel] != 0.0 else 0.0
        memory, mu_b = friction(
            params.friction_law[wheel],
            row,
            state.lining_memory[wheel],
            pressure,
            radius * abs(state.wheel_speed[wheel]),
            params.rig_gain[wheel] * state.mu_b[wheel] * pressure,
            state.disc_temperature[wheel],
            slides,
        )
        state.lining_memory[wheel] = memory
        state.mu_b[wheel] = params.friction_scale[wheel] * mu_b
        state.brake_torque[wheel] = 2.0 * state.mu_b[wheel] * pressure * params.piston_area[wheel] * radius


@kernel
def advance_disc_temperature(
    params: Record, state: Record, ambient: float, wetness: float, dt: float
) -> None:
    """Heat the discs by the friction power of this step and cool them by the air [degC] (3.7)."""
    for wheel in range(4):
        state.brake_heat[wheel] += state.brake_work[wheel]
        cooling = cooling_rate(params.cooling[wheel], params.cooling_by_speed[wheel], state.speed_x, wetness)
        state.disc_temperature[wheel] = disc_step(
            state.disc_temperature[wheel],
            params.heating[wheel],
            cooling,
            state.brake_work[wheel] / dt,
            ambient,
            dt,
        )
