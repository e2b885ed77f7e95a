"""What an engineer believes of a stranger's car: its CONFIG, and the deceleration that this CONFIG expects.

m_e a = sum_i 2 A_i r_i mu_i (p_i - p_0) / R_i + m g f + rho/2 c_d A v^2,  m_e = m + sum_i I_i / R_i^2
"""

from typing import NamedTuple

import numpy as np

from .car import Body
from .lining import Brake, warm_level
from .logger import Logger
from .route import G, Values

VEHICLE = (
    "mass", "wheelbase", "front_axle", "cog_height", "track", "drag_coefficient", "frontal_area",
    "rolling_resistance", "pitch_gradient",
)  # fmt: skip


class Nominal(NamedTuple):
    """The engineer's car; pairs are front and rear."""

    mass: float  # kg
    wheelbase: float  # m
    front_axle: float  # m
    cog_height: float  # m
    track: float  # m
    drag_coefficient: float
    frontal_area: float  # m^2
    rolling_resistance: float
    pitch_gradient: float  # rad per m/s^2
    unloaded_radius: tuple[float, float]  # m
    vertical_stiffness: float  # N/m
    wheel_inertia: float  # kg m^2
    slip_stiffness: float
    pistons: int
    piston_diameter: tuple[float, float]  # m
    effective_radius: float  # m
    mu_nominal: tuple[float, float]
    push_out_pressure: float  # bar
    disc_heating: tuple[float, float]  # K/J
    sensors: dict[str, float]
    electric: bool  # what is reported as motor torque is that of motors

    @property
    def radius(self) -> Values:
        """Rolling radius of each wheel at rest [m], shape (4,): a third of the deflection less."""
        rear = self.front_axle / self.wheelbase
        load = 0.5 * self.mass * G * np.array([1.0 - rear, 1.0 - rear, rear, rear])
        return np.repeat(self.unloaded_radius, 2) - load / (3.0 * self.vertical_stiffness)

    @property
    def gain(self) -> Values:
        """Torque per pressure and friction [N m/bar] of each wheel, shape (4,)."""
        area = self.pistons * np.pi / 4.0 * np.repeat(self.piston_diameter, 2) ** 2
        return 2e5 * area * self.effective_radius

    @property
    def inertia(self) -> float:
        """What the wheels add to the mass [kg]."""
        return float(np.sum(self.wheel_inertia / self.radius**2))

    def resistance(self, speed: Values, mass: float) -> Values:
        """Return the force of drag and rolling [N] at m/s for a mass [kg]."""
        return 0.6 * self.drag_coefficient * self.frontal_area * speed**2 + self.rolling_resistance * mass * G

    def toml(self, name: str) -> str:
        """Return the CONFIG."""

        def table(values: dict[str, float]) -> str:
            return "\n".join(f"{key} = {value:.9g}" for key, value in values.items())

        def axle(which: int) -> str:
            return table(
                {
                    "unloaded_radius": self.unloaded_radius[which],
                    "vertical_stiffness": self.vertical_stiffness,
                    "wheel_inertia": self.wheel_inertia,
                    "slip_stiffness": self.slip_stiffness,
                    "stiffness_degression": 0.07,
                    "pistons": self.pistons,
                    "piston_diameter": self.piston_diameter[which],
                    "effective_radius": self.effective_radius,
                    "mu_nominal": self.mu_nominal[which],
                    "push_out_pressure": self.push_out_pressure,
                    "activation_decel": 1.0,
                    "disc_heating": self.disc_heating[which],
                }
            )

        body = {name: getattr(self, name) for name in VEHICLE} | {"imu_x": 0.0, "load_transfer_lag": 0.06}
        return (
            f'name = "{name}"\n\n[vehicle]\n{table(body)}\n\n[front]\n{axle(0)}\n\n[rear]\n{axle(1)}\n\n'
            f"[sensors]\n{table(self.sensors)}\n\n"
            "[control]\npedal_position = [0.0, 5.0, 50.0, 100.0]\npedal_decel = [0.0, 0.0, 4.0, 10.0]\n"
        )


def believe(
    body: Body,
    brake: Brake,
    scale: tuple[float, float],
    logger: Logger,
    electric: bool,
    rng: np.random.Generator,
) -> Nominal:
    """Return what an engineer takes from data sheets and scales.

    Args:
        body: the car.
        brake: its brakes.
        scale: of true over believed friction: its median and the spread of its logarithm.
        logger: of which he states the sensors.
        electric: the reported torque is that of motors, not of an engine.
        rng: random numbers.
    """

    def off(sigma: float) -> float:
        return float(np.clip(rng.normal(1.0, sigma), 1.0 - 2.5 * sigma, 1.0 + 2.5 * sigma))

    light = body.mass < 500.0
    rear = body.front_axle / body.wheelbase
    load = 0.5 * body.mass * G * np.array([1.0 - rear, rear])
    unloaded = np.array([body.radius_front, body.radius_rear]) + load / (3.0 * body.vertical_stiffness)
    circumference = off(0.015)
    lever, pistons = (0.092, 1) if light else (rng.uniform(0.125, 0.155), 2)
    gain = brake.gain_front * off(0.015), brake.gain_rear * off(0.015)
    diameter = np.sqrt(np.array(gain) / (2e5 * lever * pistons * np.pi / 4.0))
    truer = (
        scale[0]
        * np.exp(scale[1] * np.clip(rng.normal(), -2.0, 2.0))
        / warm_level(brake.kind, brake.strength)
    )
    area = 1.0 if light else 2.2
    sensors = {"wheel_speed": 0.2, "accel": 0.2, "pressure": 1.0, "vehicle_speed": 0.2}
    if logger.speed.rate > 0.0 and not logger.speed_for_wheels:
        sensors["vehicle_speed_delay"] = 0.1
    if logger.motor.rate > 0.0 and not electric and rng.random() < 0.5:
        sensors["motor_torque"] = 0.3
    return Nominal(
        mass=body.mass * off(0.04),
        wheelbase=body.wheelbase,
        front_axle=body.front_axle * off(0.02),
        cog_height=body.cog_height * off(0.06),
        track=body.track,
        drag_coefficient=body.drag / 0.6 / area * off(0.1),
        frontal_area=area,
        rolling_resistance=0.013,
        pitch_gradient=0.0035 if electric else 0.0015,
        unloaded_radius=(unloaded[0] * circumference * off(0.005), unloaded[1] * circumference * off(0.005)),
        vertical_stiffness=body.vertical_stiffness * off(0.08),
        wheel_inertia=body.inertia_front * off(0.1),
        slip_stiffness=24.0,
        pistons=pistons,
        piston_diameter=(diameter[0], diameter[1]),
        effective_radius=lever,
        mu_nominal=(brake.level_front / truer * off(0.04), brake.level_rear / truer * off(0.04)),
        push_out_pressure=0.5,
        disc_heating=(brake.heat_front * off(0.15), brake.heat_rear * off(0.15)),
        sensors=sensors,
        electric=electric,
    )
