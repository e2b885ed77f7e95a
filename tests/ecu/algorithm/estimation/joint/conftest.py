"""A car on a straight road for the joint observer: linings, tyres and balance solved here.

Signs of the observer: forces are positive forward, torques positive when they brake.
"""

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from ecu.algorithm.estimation.joint.layout import CHANGE, JOINT_STATE, LEVEL, N
from ecu.algorithm.estimation.joint.observer import start_joint, update_joint
from ecu.algorithm.estimation.joint.prior import PRIOR, begin_application, end_application, set_prior
from ecu.algorithm.estimation.joint.wheel import SHAPE
from ecu.algorithm.estimation.motion import MOTION_STATE
from ecu.algorithm.hydraulics import HYDRAULICS_STATE
from ecu.contract.signals import CALLIPER_PRESSURE, MOTOR_TORQUE, VEHICLE_SPEED, WHEEL_SPEED

DT = 0.01
BAR = 1e5
GRAVITY = 9.81
PEAK = 0.9  # Magic Formula: D at static load; c is the observer's: here the car is as it is configured
NEARLY_QUIET = 1e-4  # bar; a sensor that read exactly zero at rest would pass for one that is cut off there


def tied(seed: int) -> Any:
    """Return a state in which everything is tied to everything."""
    state, random = np.zeros(1, JOINT_STATE)[0], np.random.default_rng(seed)
    root = np.maximum(PRIOR, 0.05)[:, None] * random.standard_normal((N, 2 * N)) / math.sqrt(2 * N)
    state["p"] = root @ root.T
    state["x"] = 0.05 * random.standard_normal(N)
    state["drive_known"] = 1.0
    return state


def magic_formula_slip(used: np.ndarray, stiffness: np.ndarray, peak: float) -> np.ndarray:
    """Return the slips at which D sin(c atan(B s)) is `used` [-], left of the peak; B c D = `stiffness`."""
    return np.tan(np.arcsin(used / peak) / SHAPE) * (SHAPE * peak) / stiffness


class Car:
    """What is true of the car, and the observer that hears of it."""

    def __init__(self, params: Any, inputs: Any, seed: int = 0, **true: Any) -> None:
        self.params, self.inputs, self.random = params[0], inputs, np.random.default_rng(seed)
        self.speed: float = true.pop("speed", 30.0)
        self.mu = np.broadcast_to(true.pop("mu", 0.45), 4).copy()
        self.mass = self.params["mass"] * true.pop("mass", 1.0)
        self.stiffness: Any = true.pop("stiffness", 1.0)
        names = ("wheel_speed", "pressure", "accel", "vehicle_speed")
        quiet = true.pop("quiet", False)
        self.sigma = {name: 0.0 if quiet else float(self.params[f"sigma_{name}"]) for name in names}
        self.sigma["motor"] = true.pop("motor_noise", 0.0)  # N m
        assert not true
        self.state = np.zeros(1, JOINT_STATE)[0]
        set_prior(self.params, self.state)
        start_joint(self.state)
        self.motion = np.zeros(1, MOTION_STATE)[0]
        self.motion["measured"] = 1
        self.load = self.params["static_load"].copy()
        self.radius = np.ones(4)  # of the wheels, over the configured one
        self.hydraulics = np.zeros(1, HYDRAULICS_STATE)[0]
        self.reference_zero = 0.0  # m/s, of the speed reference
        self.time = 0.0
        self.braked = False

    def forces(self, bar: np.ndarray, motor: np.ndarray, slope: float) -> tuple[np.ndarray, float]:
        """Return the four tyre forces [N] and dv/dt [m/s^2] while no wheel slides."""
        p = self.params
        r, heavier = p["wheel_radius"], self.mass / p["mass"]
        self.load = p["static_load"] * heavier
        torque = 2 * BAR * p["piston_area"] * p["effective_radius"] * self.mu * bar + motor
        torque = torque + p["rolling_resistance"] * self.load * r
        inertia = heavier * p["wheel_inertia"] / r  # the observer scales the wheels with the car
        drag = heavier * p["drag_area"] * self.speed**2
        # m (v' + g_slope) = -sum((T + I v'/r) / r) - drag
        change = -(drag + self.mass * slope + (torque / r).sum()) / (self.mass + (inertia / r).sum())
        return -(torque + inertia * change) / r, float(change)

    def modelled(self, bar: np.ndarray, motor: np.ndarray) -> float:
        """Return the acceleration [m/s^2] by the observer's own friction and the configured car."""
        p, x = self.params, self.state["x"]
        mu = p["mu_nominal"] * np.exp(x[LEVEL : LEVEL + 4] + np.repeat(x[CHANGE : CHANGE + 2], 2))
        torque = 2 * BAR * p["piston_area"] * p["effective_radius"] * mu * bar + motor
        return -float(p["drag_area"] * self.speed**2 + (torque / p["wheel_radius"]).sum()) / p["mass"]

    def cycles(
        self,
        seconds: float,
        front: Any = 0.0,
        rear: Any = 0.0,
        motor: Any = 0.0,
        slope: float = 0.0,
        reference: bool = True,
        slide: dict[int, float] | None = None,
        braking: bool | None = None,
    ) -> Iterator[Any]:
        """Drive with pressures above push-out [bar]; `slide`: slip of wheels that have left the tyre's curve.

        Yields the observer's state after each cycle.
        """  # fmt: skip
        p, value, new = self.params, self.inputs[0]["value"], self.inputs[0]["new"]
        bar = np.concatenate([np.broadcast_to(front, 2), np.broadcast_to(rear, 2)]).astype(float)
        motor = np.broadcast_to(motor, 4).astype(float)
        sigma, normal = self.sigma, self.random.standard_normal
        for k in range(round(seconds / DT)):
            force, change = self.forces(bar, motor, slope)
            self.speed = max(self.speed + change * DT, 0.0)
            used = force / self.load
            stiffness = p["slip_stiffness"] * self.stiffness
            slip = magic_formula_slip(used, stiffness, PEAK)
            for i, own in (slide or {}).items():
                slip[i] = own
            rolled = np.where(slip < 0, 1 + slip, 1 / (1 - slip)) * self.speed
            omega = rolled / (self.radius * p["wheel_radius"]) + sigma["wheel_speed"] * normal(4)
            value[WHEEL_SPEED : WHEEL_SPEED + 4] = omega
            reading = np.where(bar > 0, bar + p["push_out_pressure"] / BAR, 0.0)
            reading = reading + max(sigma["pressure"] / BAR, NEARLY_QUIET) * normal(4)
            value[CALLIPER_PRESSURE : CALLIPER_PRESSURE + 4] = reading
            value[MOTOR_TORQUE : MOTOR_TORQUE + 4] = motor + sigma["motor"] * normal(4)
            self.motion["accel_x"] = change + slope + sigma["accel"] * normal()
            if not self.motion["measured"]:
                self.motion["accel_x"] = self.modelled(bar, motor)
            new[VEHICLE_SPEED] = reference and k % 2 == 0
            value[VEHICLE_SPEED] = self.speed + self.reference_zero + sigma["vehicle_speed"] * normal()
            self.observe(bool(bar.any()) if braking is None else braking)
            yield self.state

    def observe(self, braking: bool) -> None:
        """Run one cycle of the observer on the inputs as they are; brake applications begin and end."""
        if self.braked and not braking:
            end_application(self.state)
        if braking and not self.braked:
            begin_application(self.state, np.zeros(4))
        self.braked = braking
        at_rest = self.params["static_load"]  # by the configured mass, as the ECU has it
        update_joint(
            self.params, self.state, self.inputs[0], self.motion, at_rest, self.hydraulics, braking, DT
        )
        self.time += DT

    def drive(self, seconds: float, **how: Any) -> Any:
        """Drive on as `cycles` does and return the observer's state."""
        for _ in self.cycles(seconds, **how):
            pass
        return self.state


@pytest.fixture
def new_car(params: Any, feed: Any) -> Callable[..., Car]:
    """Make a `Car` whose signals all arrive: `new_car(seed=3, mu=0.5, speed=20.0)`."""

    def make(**true: Any) -> Car:
        return Car(params, feed(vehicle_speed_valid=1.0), **true)

    return make


@pytest.fixture
def state(params: Any) -> Any:
    """`JOINT_STATE` before anything is learned, at 25 m/s."""
    fresh = np.zeros(1, JOINT_STATE)[0]
    set_prior(params[0], fresh)
    start_joint(fresh)
    fresh["x"][0] = 25.0
    return fresh
