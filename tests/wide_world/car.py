"""A stranger's car on a route: four wheels, brakes, discs, a slip control that reports nothing.

    m dv/dt = -sum F_i - drag - rolling - cornering - m g grade,  I omega' = r F - T_brake - T_engine

The lateral motion is the route's: a_y = v^2 curvature up to what the road holds, shared like the loads.
Loads shift with the specific force a lag behind. 10 ms a row, four steps in each.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.jit import kernel

from .driver import Driver, Engine, accelerate, decide, meant_ahead, press, yield_to_lock
from .lining import Brake, friction, rear_pressure
from .route import G, Route, Values
from .state import ROW
from .tyre import Tyre, grip_left, spin

STEPS = 4
NO_ABS, CYCLING, HOLDING = range(3)


class Body(NamedTuple):
    """Masses, lengths and resistances."""

    mass: float  # kg
    fuel: float  # kg/s at full throttle
    wheelbase: float  # m
    front_axle: float  # m, from the centre of gravity
    cog_height: float  # m
    track: float  # m
    drag: float  # N/(m/s)^2
    lift: float  # downforce, N/(m/s)^2
    lift_front: float  # share
    rolling: float  # over weight
    cornering: float  # 1/rad, cornering stiffness over load
    roll_front: float  # share of the lateral load transfer
    inertia_front: float  # kg m^2, one wheel
    inertia_rear: float
    radius_front: float  # m, rolling, at static load
    radius_rear: float
    vertical_stiffness: float  # N/m, of a tyre
    transfer_lag: float  # s, of the loads


class Abs(NamedTuple):
    """A hidden slip control."""

    kind: int
    high: float  # slip that cuts
    low: float  # slip that lets go
    rate: float  # 1/s of the cut; an eighth of it back


class Start(NamedTuple):
    """How the recording begins."""

    idle: float  # s at rest
    speed: float  # m/s if it does not begin at rest
    front: float  # degC of the discs
    rear: float
    ambient: float  # degC


class Car(NamedTuple):
    """A car and its driver."""

    body: Body
    tyre: Tyre
    brake: Brake
    engine: Engine
    driver: Driver
    abs_: Abs


@kernel
def share_load(state: NDArray[np.void], body: Body, down: float, bounce: float) -> None:
    """Write the wheel loads at a downforce [N]; a kerb adds the share `bounce` right and takes it left."""
    rear = body.front_axle / body.wheelbase
    along = -state.mass * state.lagged_force * body.cog_height / body.wheelbase
    across = state.mass * state.lateral * body.cog_height / body.track
    for i in range(4):
        front = i < 2
        load = 0.5 * state.mass * G * (1.0 - rear if front else rear) + 0.5 * (along if front else -along)
        load += 0.5 * down * (body.lift_front if front else 1.0 - body.lift_front)
        load += (across if i % 2 else -across) * (body.roll_front if front else 1.0 - body.roll_front)
        load *= 1.0 + (bounce if i % 2 else -bounce)
        state.load[i] = max(load, 0.005 * state.mass * G)


@kernel
def slip_control(abs_: Abs, cut: float, slip: float, speed: float, bearable: float, dt: float) -> float:
    """Return which share of the pressure comes to a wheel after dt.

    Args:
        abs_: the slip control.
        cut: the share now.
        slip: of the wheel.
        speed: m/s.
        bearable: share with which the brake would have 0.96 of what the tyre bears.
        dt: s.
    """
    if abs_.kind == CYCLING and speed > 3.0:
        if slip > abs_.high:
            return max(cut - abs_.rate * dt, 0.2)
        return min(cut + abs_.rate / 8.0 * dt, 1.0) if slip < abs_.low else cut
    if abs_.kind == HOLDING and speed > 3.0:
        most = min(bearable, 1.0) * (0.5 if slip > abs_.high else 1.0)
        return cut + (most - cut) * dt / 0.03
    return min(cut + abs_.rate * dt, 1.0)


@kernel
def rub(state: NDArray[np.void], brake: Brake, ambient: float, scatter: float) -> None:
    """Write disc temperatures, work and friction of the linings; `scatter` is this braking's own factor."""
    cooling = brake.cooling + brake.cooling_by_speed * state.speed
    for i in range(4):
        power = state.torque[i] * state.omega[i]
        heat = brake.heat_front if i < 2 else brake.heat_rear
        state.work[i] += power * ROW
        state.temperature[i] += (heat * power - cooling * (state.temperature[i] - ambient)) * ROW
        level = brake.level_front if i < 2 else brake.level_rear
        pressure = state.calliper[i // 2]
        state.mu[i] = scatter * friction(
            brake, level, state.temperature[i], pressure, state.speed, state.work[i]
        )


@kernel
def turn_wheel(
    state: NDArray[np.void],
    car: Car,
    i: int,
    grip: float,
    lateral_share: float,
    recuperated: float,
    dt: float,
) -> float:
    """Move one wheel by dt and write its torques, slip and force; return its inertia [kg m^2]."""
    body, brake, engine = car.body, car.brake, car.engine
    front, axle, load = i < 2, i // 2, state.load[i]
    rear = body.front_axle / body.wheelbase
    radius = body.radius_front if front else body.radius_rear
    radius -= (load - 0.5 * body.mass * G * (1.0 - rear if front else rear)) / (3.0 * body.vertical_stiffness)
    share = engine.front if front else 1.0 - engine.front
    inertia = body.inertia_front if front else body.inertia_rear
    inertia += 0.5 * share * engine.inertia * engine.ratios[state.gear] ** 2
    left = grip_left(car.tyre, load, grip, lateral_share)
    # A locking differential shares by load; the driver lets no wheel spin, clutch or motor control none lock.
    pull = share * (state.crank + recuperated) * load / (load + state.load[i ^ 1])
    bears = left * load * radius
    state.engine[i] = min(max(pull, -0.85 * bears), 0.6 * bears)
    gain = (brake.gain_front if front else brake.gain_rear) * state.mu[i]
    torque = gain * max(state.cut[i] * state.calliper[axle] - brake.push_out, 0.0)
    before = state.omega[i]
    if state.standing:
        state.force[i] = 0.0
    else:
        state.omega[i], state.force[i] = spin(
            car.tyre, before, state.speed, torque + state.engine[i], inertia, radius, load, left, dt
        )
    if state.omega[i] == 0.0:  # a brake holds no more than what turns the wheel
        torque = min(torque, state.force[i] * radius)
    state.torque[i] = torque
    state.slip[i] = (state.speed - state.omega[i] * radius) / max(state.speed, 1.0)
    mean = 0.5 * (before + state.omega[i])
    state.brake_work += torque * mean * dt
    state.engine_work += state.engine[i] * mean * dt
    state.slip_work += state.force[i] * (state.speed - mean * radius) * dt
    bearable = (0.96 * bears / gain + brake.push_out) / max(state.calliper[axle], 1.0)
    state.cut[i] = slip_control(car.abs_, state.cut[i], state.slip[i], state.speed, bearable, dt)
    return inertia


@kernel
def move(
    state: NDArray[np.void], car: Car, route: Route, bounce: float, recuperated: float, dt: float
) -> None:
    """Move the car by dt; `specific_force` becomes that of the step."""
    body, place = car.body, int(state.distance)
    air = max(state.speed + route.headwind[place], 0.0)
    down, grip, grade = body.lift * air**2, route.grip[place], route.grade[place]
    widest = 0.97 * grip * (G + down / state.mass)  # faster, it runs wide
    state.lateral = min(max(state.speed**2 * route.curvature[place], -widest), widest)
    for axle in range(2):
        state.calliper[axle] += (state.line[axle] - state.calliper[axle]) * dt / car.brake.lag
    share_load(state, body, down, bounce)
    lateral_share = abs(state.lateral) * state.mass / (state.mass * G + down)
    rotation = 0.0
    for i in range(4):
        rotation += (
            0.5 * turn_wheel(state, car, i, grip, lateral_share, recuperated, dt) * state.omega[i] ** 2
        )
    resisting = body.drag * air**2 + body.rolling * state.mass * G * min(state.speed, 1.0)
    resisting += state.mass * state.lateral**2 / (body.cornering * G)
    specific = -(np.sum(state.force) + resisting) / state.mass
    if state.standing:
        specific, resisting = G * grade, 0.0
    change = (specific - G * grade) * dt
    step = max(state.speed + 0.5 * change, 0.0) * dt
    state.resistance_work += resisting * step
    state.climb_work += state.mass * G * grade * step
    state.speed = max(state.speed + change, 0.0)
    state.distance += step
    state.kinetic = 0.5 * state.mass * state.speed**2 + rotation
    state.lagged_force += (specific - state.lagged_force) * dt / body.transfer_lag
    state.specific_force, state.resistance = specific, resisting / state.mass


@kernel
def drive(
    car: Car, route: Route, start: Start, tremor: Values, scatter: Values, rows: NDArray[np.void]
) -> int:
    """Drive the route; return how many rows it took.

    Args:
        car: the car.
        route: the road.
        start: how it begins.
        tremor: of the brake foot, standard normal and slow, a value each row.
        scatter: factor of the linings' friction, a value each brake application.
        rows: of STATE, written, 10 ms each; when they are full the drive ends. The first holds zeros.
    """
    state, body = rows[0], car.body
    radius = body.radius_front if car.engine.front > 0.5 else body.radius_rear
    state.mass, state.relax, state.habit = body.mass, 1.0, 1.0
    state.standing, state.wait = 1 if start.idle > 0.0 else 0, start.idle
    state.speed = 0.0 if state.standing else start.speed
    for i in range(4):
        state.omega[i] = state.speed / (body.radius_front if i < 2 else body.radius_rear)
        state.temperature[i], state.cut[i] = start.front if i < 2 else start.rear, 1.0
    for row in range(len(rows)):
        if row > 0:
            rows[row] = rows[row - 1]
        state = rows[row]
        place = int(state.distance)
        if place >= len(route.speed) - 2:
            return row
        meant, demand = meant_ahead(route, place, state.speed)
        decide(state, route, state.speed - meant, demand)
        recuperated = press(
            state, car.driver, car.engine, route, radius, tremor[row], state.speed - meant, demand
        )
        if car.abs_.kind == NO_ABS:
            yield_to_lock(state, car.driver)
        accelerate(state, car.driver, car.engine, route.grip[place], radius, meant)
        state.line[1] = rear_pressure(car.brake, state.line[0])
        rub(state, car.brake, start.ambient, scatter[min(state.applications, len(scatter) - 1)])
        bounce = 0.4 * route.kerb[place] * np.sin(75.0 * row * ROW)
        total = 0.0
        for _ in range(STEPS):
            move(state, car, route, bounce, recuperated, ROW / STEPS)
            total += state.specific_force / STEPS
        state.specific_force = total
        state.mass -= body.fuel * ROW * state.throttle
        state.yaw_rate = state.lateral / max(state.speed, 1.0)
        state.steering = route.curvature[place] * (body.wheelbase + 0.002 * state.speed**2)
        state.kerb = route.kerb[place]
    return len(rows)
