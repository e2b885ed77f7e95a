"""Energy balance of a drive.

Kinetic energy (translation, yaw, spin, heave, pitch, roll, unsprung masses) and the energy stored in springs,
stops, bars and tyres are functions of the state. Energy that leaves or enters is summed by the plant in its
own steps (J in `STATE`): each part's force times its own mean speed, as the integrator moves it. For the
planar motion and the spins this is exact to rounding; the residual is the error of the suspension's
integration.

A tyre whose force lags (A.13, A.14) is a spring K in series with its slip: it stores F^2 / (2 K). `tyres` is
the rest of the work done on them, the loss by slip. A force acts on the car with the end of a step and on the
wheel with its middle, so `tyres` also holds half a step of it while it builds up.

A height of the road lifts a wheel without holding the car back, as a shaker would (assumption: slopes of a
profile are small); this work enters as `road`. The reduced car's body leans without energy.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brakelab.plant.chassis import sprung_front_length, sprung_mass, tyre_load
from brakelab.plant.jit import Record
from brakelab.plant.records import RecordArray


class Energy(NamedTuple):
    """Energy [J] released (first four) and its destinations (the rest)."""

    motion: float
    """Kinetic energy lost; negative: gained."""
    springs: float
    """Released by springs, stops, bars and tyres."""
    gravity: float
    """Potential energy lost."""
    driven: float
    """From the motors."""
    road: float
    """From the road's heights."""
    brakes: float
    tyres: float
    drag: float
    rolling: float
    dampers: float
    regenerated: float
    """To the motors."""
    engine: float
    """To an engine in overrun."""

    @property
    def turned_over(self) -> float:
        """Energy that changed its form [J]."""
        return 0.5 * sum(map(abs, self))

    @property
    def missing(self) -> float:
        """Residual: released energy without destination, as a share of the energy turned over."""
        return (sum(self[:5]) - sum(self[5:])) / self.turned_over


def kinetic(params: Record, state: Record) -> float:
    """Return the kinetic energy [J] of a car, records of PARAMS and STATE."""
    energy = params["mass"] * (state["speed_x"] ** 2 + state["speed_y"] ** 2)
    energy += params["yaw_inertia"] * state["yaw_rate"] ** 2
    energy += np.sum(params["wheel_inertia"] * state["wheel_speed"] ** 2)
    if params["suspended"]:
        energy += sprung_mass(params) * state["heave_rate"] ** 2
        energy += params["pitch_inertia"] * state["pitch_rate"] ** 2
        energy += params["roll_inertia"] * state["roll_rate"] ** 2
        energy += np.sum(params["unsprung_mass"] * state["unsprung_rate"] ** 2)
    return float(0.5 * energy)


def strut_travel(params: Record, state: Record) -> NDArray[np.float64]:
    """Return the compression u of the four struts [m] from the design height (A.10), shape (4,)."""
    front = sprung_front_length(params)
    rear = front - params["front_length"] - params["rear_length"]
    pitch, roll = state["pitch"], state["roll"]
    lean = params["cog_height"] * (2.0 - np.cos(pitch) - np.cos(roll))
    sides = 0.5 * params["track"] * np.array([1.0, -1.0, 1.0, -1.0])
    mount = state["heave"] + lean - np.array([front, front, rear, rear]) * np.sin(pitch)
    return np.asarray(state["unsprung_height"] - mount - sides * np.sin(roll))


def in_springs(params: Record, state: Record) -> float:
    """Return the energy stored in springs, stops, bars (A.9) and the tyres under their loads (A.8) [J]."""
    if not params["suspended"]:
        return 0.0
    travel = strut_travel(params, state)
    beyond = np.maximum(np.abs(travel) - params["stop_clearance"], 0.0)
    energy = np.sum(params["spring_preload"] * travel + 0.5 * params["spring_stiffness"] * travel**2)
    energy += 0.5 * params["stop_stiffness"] * np.sum(beyond**2)
    energy += 0.5 * np.sum(params["anti_roll_stiffness"] * (travel[::2] - travel[1::2]) ** 2)
    height = state["unsprung_height"] - state["road_height"]
    for wheel in range(4):
        energy += 0.5 * tyre_load(params, wheel, height[wheel]) ** 2 / params["vertical_stiffness"][wheel]
    return float(energy)


def in_carcasses(params: Record, state: Record) -> float:
    """Return the energy stored in the tyres, longitudinal and lateral [J]: F^2 / (2 K)."""
    along = np.sum(state["force_x"] ** 2) / params["longitudinal_stiffness"]
    across = np.sum(state["force_y"] ** 2) / params["lateral_stiffness"]
    return float(0.5 * (along + across))


def energy(params: RecordArray, before: RecordArray, after: RecordArray) -> Energy:
    """Return the energy balance of a car between two of its states; shape (1,) each.

    `before` is a copy of the earlier state, for a whole drive that of the new state.
    """
    car, old, new = params[0], before[0], after[0]

    def grown(name: str) -> float:
        return float(np.sum(new[name]) - np.sum(old[name]))

    carcasses = in_carcasses(car, new) - in_carcasses(car, old)
    return Energy(
        motion=kinetic(car, old) - kinetic(car, new),
        springs=in_springs(car, old) - in_springs(car, new) - carcasses,
        gravity=-grown("lifted"),
        driven=grown("driven"),
        road=grown("road_work"),
        brakes=grown("brake_heat"),
        tyres=grown("tyre_work") - carcasses,
        drag=grown("drag_loss"),
        rolling=grown("rolling_loss"),
        dampers=grown("damper_heat"),
        regenerated=grown("regenerated"),
        engine=grown("engine_loss"),
    )
