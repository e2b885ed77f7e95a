"""Beside commonroad-vehicle-models: its multi-body car and ours with its parameters; skipped where absent.

Its tyre offsets, camber and compliance are switched off; ours has no relaxation, drag, rolling resistance or
degression. Side force and load share stand to each other as in its equations, which put the tyre forces' yaw
moments about the sprung mass.
"""

import copy
import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from brakelab.plant.tyre import rolling_radius
from brakelab.plant.vehicle import new_state

pytestmark = pytest.mark.study

multi_body = pytest.importorskip("vehiclemodels.vehicle_dynamics_mb")
G: Final = 9.81
SECONDS: Final = 3.0
STEERING_RATE: Final = 0.4  # rad/s, its limit
OFFSETS: Final = (
    "p_hx1", "p_vx1", "r_hx1", "p_hy1", "p_hy3", "p_vy1", "p_vy3", "p_dy3", "r_hy1", "r_vy1", "r_vy3"
)  # fmt: skip
SPEED, YAW_RATE, ROLL, PITCH = 3, 5, 6, 8  # places in its state


@pytest.fixture(scope="module")
def its() -> Any:
    from vehiclemodels.parameters_vehicle2 import parameters_vehicle2

    parameters = copy.deepcopy(parameters_vehicle2())
    for name in OFFSETS:
        setattr(parameters.tire, name, 0.0)
    parameters.D_f = parameters.D_r = parameters.K_lt = 0.0
    return parameters


def run_its(its: Any, speed: float, steering: float, accel: float) -> NDArray[np.float64]:
    from vehiclemodels.init_mb import init_mb

    def rates(t: float, x: NDArray[np.float64]) -> Any:
        turning = STEERING_RATE if t < steering / STEERING_RATE else 0.0
        return multi_body.vehicle_dynamics_mb(list(x), [turning, accel], its)

    start = init_mb([0.0, 0.0, 0.0, speed, 0.0, 0.0, 0.0], its)
    times = np.linspace(0.0, SECONDS, 301)
    found = solve_ivp(rates, (0.0, SECONDS), start, t_eval=times, rtol=1e-6, atol=1e-8, max_step=0.005)
    return np.asarray(found.y)


def set_its_parameters(car: Any, its: Any, speed: float, steering: bool) -> None:
    params, base = car.params, its.a + its.b
    whole = (its.m_s * its.a + its.m_ur * base) / its.m  # front axle to the whole car's centre of gravity
    front = its.a if steering else whole
    lever = its.m_s * its.h_s / its.m if steering else its.h_s
    law = ("y", its.tire.p_dy1) if steering else ("x", its.tire.p_dx1)
    nominal = 0.5 * its.m * G * np.repeat((base - front, front), 2) / base
    unsprung = 0.5 * np.repeat((its.m_uf, its.m_ur), 2)
    knots = np.linspace(-1.0, 1.0, 7)
    values = {
        "mass": its.m, "front_length": front, "rear_length": base - front, "yaw_inertia": its.I_z,
        "cog_height": lever, "track": 0.5 * (its.T_f + its.T_r), "drag_factor": 0.0,
        "rolling_resistance": 0.0, "wheel_inertia": its.I_y_w, "vertical_stiffness": its.K_zt,
        "nominal_load": nominal, "unsprung_mass": unsprung, "pitch_inertia": its.I_y_s,
        "roll_inertia": its.I_Phi_s, "spring_stiffness": np.repeat((its.K_sf, its.K_sr), 2),
        "spring_preload": nominal - G * unsprung, "stop_stiffness": 0.0,
        "anti_roll_stiffness": (-its.K_tsf / its.T_f**2, -its.K_tsr / its.T_r**2), "damper_speed": knots,
        "damper_force": np.outer(np.repeat((its.K_sdf, its.K_sdr), 2), knots),
        "magic_c": getattr(its.tire, f"p_c{law[0]}1"), "magic_e": getattr(its.tire, f"p_e{law[0]}1"),
        "slip_stiffness": its.tire.p_kx1, "stiffness_degression": 0.0, "friction_degression": 0.0,
        "longitudinal_stiffness": 1e9, "lateral_stiffness": 1e9, "push_out_pressure": 0.0,
        "cornering_stiffness": -its.tire.p_ky1
        * np.repeat(((base - whole) / (base - front), whole / front), 2),
    }  # fmt: skip
    for name, value in values.items():
        params[name] = value
    for wheel in range(4):  # rolls on its radius at the static load
        shrunk = its.R_w - rolling_radius(its.R_w, its.K_zt, nominal[wheel])
        params["free_radius"][0, wheel] = its.R_w + shrunk
    car.commands["road_friction"] = law[1]
    car.freeze_friction()
    car.state[:] = new_state(params, speed, (100.0, 100.0))


def run_ours(car: Any, its: Any, steering: float, accel: float) -> list[dict[str, float]]:
    torque = -its.m * its.R_w * accel * 0.5 * np.repeat((its.T_sb, 1.0 - its.T_sb), 2)
    lever = 2.0 * car.now["mu_b"] * car.params["piston_area"][0] * car.params["effective_radius"][0]
    for name in ("pressure", "turning_point"):
        car.state[name] = torque / lever
    car.commands["pressure_demand"] = car.state["demand_history"][0] = torque / lever
    rows = []
    for k in range(round(SECONDS / 1e-3)):
        car.commands["steering_angle"] = min(steering, STEERING_RATE * k * 1e-3)
        car.run(1e-3)
        rows.append({name: float(car.now[name]) for name in ("speed_x", "yaw_rate", "roll", "pitch")})
    return rows


@pytest.mark.parametrize("accel", [-4.0, -8.0])
def test_straight_braking(shipped: Callable[[str, float], Any], its: Any, accel: float) -> None:
    theirs = run_its(its, 30.0, 0.0, accel)
    car = shipped("suv14", 30.0)
    set_its_parameters(car, its, 30.0, steering=False)
    ours = run_ours(car, its, 0.0, accel)
    assert 30.0 - ours[-1]["speed_x"] == pytest.approx(30.0 - theirs[SPEED, -1], rel=3e-3)
    assert ours[-1]["pitch"] == pytest.approx(-theirs[PITCH, -1], rel=0.06)  # its z points down
    assert max(row["pitch"] for row in ours) == pytest.approx(-theirs[PITCH].min(), rel=0.02)


@pytest.mark.parametrize(("steering", "speed"), [(0.01, 20.0), (0.02, 20.0), (0.02, 30.0)])
def test_step_steer(shipped: Callable[[str, float], Any], its: Any, steering: float, speed: float) -> None:
    theirs = run_its(its, speed, steering, 0.0)
    car = shipped("suv14", speed)
    set_its_parameters(car, its, speed, steering=True)
    ours = run_ours(car, its, steering, 0.0)
    assert ours[-1]["yaw_rate"] == pytest.approx(abs(theirs[YAW_RATE, -1]), rel=0.02)
    assert ours[-1]["roll"] == pytest.approx(abs(theirs[ROLL, -1]), rel=0.02)
    assert max(row["yaw_rate"] for row in ours) == pytest.approx(np.abs(theirs[YAW_RATE]).max(), rel=0.02)
    assert math.isclose(ours[-1]["speed_x"], theirs[SPEED, -1], rel_tol=2e-3)
