"""`control.minimise` in the simulated car: equal deceleration, other axles; motors and grip go first."""

import numpy as np
import pytest

from brakelab.simulation.closed_loop import Drive, new_loop, run
from brakelab.simulation.scenario import Scenario
from ecu.contract.signals import CORNERS
from ecu.settings.config import Config, load_config
from ecu.settings.resources import resource

BEGINS, BUILT_UP = 4.0, 5.5  # s


def car(name: str, minimise: str, rear_wears: float = 1.0) -> Config:
    config = load_config(resource(f"config/{name}.toml"))
    pad = config.rear.pad.model_copy(update={"road_scale": rear_wears})
    control = config.control.model_copy(update={"minimise": minimise})
    return config.model_copy(update={"control": control, "rear": config.rear.model_copy(update={"pad": pad})})


def braked(config: Config, decel: float, speed: float = 22.0, **changes: object) -> Drive:
    """Return a drive that brakes from `speed` after 4 s, on discs of 60 degC."""
    phases = [
        {"kind": "cruise", "speed": speed, "seconds": BEGINS},
        {"kind": "brake", "decel": decel, "seconds": 4.0},
    ]
    content = {"plant": "suv", "draw": "nominal", "initial_speed": speed, "phase": phases}
    return run(
        new_loop(
            Scenario.model_validate(
                content | {"initial_disc_temperature": (60.0, 60.0)} | changes  # type: ignore[operator]
            ),
            config,
            3,
        )
    )


def front_share(drive: Drive, begin: float = BUILT_UP) -> float:
    """Return the front axle's share of the linings' work."""
    rows = drive.t >= begin
    work = [
        float(np.sum(drive.truth[f"brake_torque_{c}"][rows] * drive.truth[f"wheel_speed_{c}"][rows]))
        for c in CORNERS
    ]
    return sum(work[:2]) / sum(work)


def slowed(drive: Drive) -> float:
    """Return the mean deceleration [m/s^2] once it has built up."""
    rows = drive.t >= BUILT_UP
    return -float(np.mean(drive.truth["accel_x_road"][rows]))


@pytest.mark.parametrize(
    ("decel", "rear_wears", "low", "high"),
    [
        (0.6, 0.2, 0.0, 0.25),  # gentle: the rear may do most
        (1.0, 5.0, 0.80, 1.0),
        (2.5, 0.2, 0.50, 0.60),  # not that gentle: no more than as configured
        (2.5, 5.0, 0.75, 0.88),
    ],
)
def test_other_axles_brake_as_hard(decel: float, rear_wears: float, low: float, high: float) -> None:
    off = braked(car("suv", "off", rear_wears), decel)
    least = braked(car("suv", "wear", rear_wears), decel)
    print(f"{decel} m/s^2: front {front_share(off):.2f}, {front_share(least):.2f}")
    assert 0.50 <= front_share(off) <= 0.60
    assert low <= front_share(least) <= high
    assert slowed(least) == pytest.approx(slowed(off), rel=0.05)


def test_motors_take_what_they_can_and_the_car_slows_as_before() -> None:
    work, decel, regained = [], [], []
    for minimise in ("off", "wear"):
        drive = braked(car("suv-blended", minimise), 2.0, blending=True)
        rows = drive.t >= BUILT_UP
        omega = [drive.truth[f"wheel_speed_{c}"][rows] for c in CORNERS]
        work.append(
            sum(
                np.sum(drive.truth[f"brake_torque_{c}"][rows] * w)
                for c, w in zip(CORNERS, omega, strict=True)
            )
        )
        regained.append(
            sum(
                np.sum(drive.truth[f"motor_torque_{c}"][rows] * w)
                for c, w in zip(CORNERS, omega, strict=True)
            )
        )
        decel.append(slowed(drive))
    assert work[1] < 0.05 * work[0]
    assert regained[1] > 1.2 * regained[0]
    assert decel[1] == pytest.approx(decel[0], rel=0.05)


def test_in_a_hard_turn_the_configured_distribution_brakes() -> None:
    turned = {"steering": {"angle": [(0.0, 0.0), (2.0, 0.035)]}}
    off = braked(car("suv", "off", 5.0), 1.0, **turned)
    least = braked(car("suv", "wear", 5.0), 1.0, **turned)
    assert np.abs(off.truth["accel_y"][off.t > BEGINS]).min() > 3.0
    assert front_share(least) == pytest.approx(front_share(off), abs=0.01)
