"""Wear dynamometer: one brake of a car and its flywheel, applications by speed and deceleration.

Between applications the flywheel runs up and the disc is cooled for as long as on the road, by less air;
within one the deceleration is held from speed to speed (Figure 7.5). Unlike on the road, no drag and no
rolling resistance assist the brake (7.20, 7.21).
"""

from typing import Final

from brakelab.plant.disc import cooling_rate, disc_step
from brakelab.plant.friction.law import START
from brakelab.plant.friction.laws import friction
from brakelab.plant.jit import Record, kernel
from brakelab.plant.wear import running_in, wear_rate

STEP: Final = 1e-3  # s
SAMPLE: Final = 20  # steps
RAMP: Final = 0.3  # s of the deceleration
FAN: Final = 0.6  # of the road's air speed. Assumption
AIR: Final = 22.0  # degC
LOWEST_SPEED: Final = 0.2  # m/s, end of a stop
T, OMEGA, PRESSURE, TORQUE, HEAT = range(5)


@kernel
def wear_block(
    car: Record, wheel: int, mass: float, radius: float, stops: Record, worn: float, trace: Record
) -> tuple[int, float]:
    """Run a block with the brake of one corner of `car`; return rows of `trace` written, wear [g].

    Args:
        car: the plant's parameters.
        wheel: the corner.
        mass: represented by the flywheel [kg].
        radius: of the tyre [m].
        stops: speed before and after [m/s], deceleration [m/s^2], seconds before; shape (n, 4).
        worn: off both pads before [g].
        trace: `t`, omega, pressure above push-out [bar], torque, temperature; overwritten, shape (rows, 5).
    """
    row, wear_row = car.friction_row[wheel], car.wear_row[wheel]
    lever = 2.0 * car.piston_area[wheel] * car.effective_radius[wheel]
    heat, t, place, mu = AIR, 0.0, 0, 0.3
    for k in range(len(stops)):
        first, last, decel, gap = stops[k, 0], max(stops[k, 1], LOWEST_SPEED), stops[k, 2], stops[k, 3]
        air = cooling_rate(car.cooling[wheel], car.cooling_by_speed[wheel], FAN * first, 0.0)
        for _ in range(int(gap / 0.1)):
            heat = disc_step(heat, 0.0, air, 0.0, AIR, 0.1)
        t += gap
        omega, memory, elapsed = first / radius, row[START], 0.0
        steps = 0
        while omega * radius > last and place < len(trace) - 1:
            torque = min(elapsed / RAMP, 1.0) * mass * decel * radius
            pressure = torque / (lever * max(mu, 0.05))
            speed = car.effective_radius[wheel] * omega
            slowing = torque / (mass * radius * radius)
            law = car.friction_law[wheel]
            memory, now = friction(law, row, memory, pressure, speed, slowing, heat, STEP)
            mu = car.friction_scale[wheel] * now
            force = 2.0 * pressure * car.piston_area[wheel]
            rate = wear_rate(wear_row, force, speed, pressure, heat)
            worn += STEP * car.wear_scale[wheel] * running_in(wear_row, worn) * rate
            if steps % SAMPLE == 0:
                out = trace[place]
                out[T], out[OMEGA], out[PRESSURE], out[TORQUE], out[HEAT] = (
                    t + elapsed, omega, 1e-5 * pressure, torque, heat,
                )  # fmt: skip
                place += 1
            heat = disc_step(heat, car.heating[wheel], air, torque * omega, AIR, STEP)
            omega -= STEP * slowing
            elapsed += STEP
            steps += 1
        t += elapsed
        out = trace[place]
        out[T], out[OMEGA], out[PRESSURE], out[TORQUE], out[HEAT] = t, omega, 0.0, 0.0, heat
        place += 1
    return place, worn
