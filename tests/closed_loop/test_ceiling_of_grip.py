"""Linings that fade and roads that give no more, in closed loop: each is reported as what it is.

Cars of the wide draw: mass, tyres, brakes, linings and sensors differ from the configuration.
"""

from functools import cache
from itertools import product
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from brakelab.simulation.closed_loop import Drive, new_loop, run
from brakelab.simulation.scenario import Scenario
from ecu.contract.faults import BRAKE_FADE, FAULTS, GRIP_EXCEEDED, IMPLAUSIBLE, fault_mask, fault_names
from ecu.contract.params import GRAVITY
from ecu.contract.signals import CORNERS
from ecu.settings.config import load_config
from ecu.settings.resources import resource

CARS = {"suv": False, "suv-blended": True, "sedan": False}
"""Configurations, and whether their motors brake."""
SEEDS = (1, 2)
DRY = 1.0
ALARMS = sum(IMPLAUSIBLE.values())


class Braking(NamedTuple):
    """Last braking of a drive."""

    drive: Drive
    rows: NDArray[np.bool_]
    """Above 4 m/s."""
    ceiling: NDArray[np.float64]
    """True: what the tyres of all wheels give at their loads, over the mass [m/s^2]."""
    masks: NDArray[np.int64]

    def reported(self, bit: int) -> NDArray[np.bool_]:
        """Return the rows of the braking in which a fault is reported."""
        rows: NDArray[np.bool_] = (self.masks[self.rows] & bit) != 0
        return rows

    def friction(self, axle: str) -> NDArray[np.float64]:
        """Return the friction that the ECU believes of the left wheel."""
        believed: NDArray[np.float64] = self.drive.outputs[f"mu_b_{axle}l"][self.rows]
        return believed


def brake(car: str, seed: int, roads: object, phases: list[dict[str, object]], **keys: object) -> Braking:
    """Drive phases, the last of which brakes."""
    config = load_config(resource(f"config/{car}.toml"))
    scenario = {"plant": car.partition("-")[0], "blending": CARS[car], "initial_speed": phases[0]["speed"]}
    scenario |= {"road_friction": roads, "phase": phases, **keys}
    loop = new_loop(Scenario.model_validate(scenario), config, seed)
    drive = run(loop)
    asked = drive.truth["decel_demand"] > 0.0
    begin = np.flatnonzero(asked[1:] & ~asked[:-1])[-1] + 1
    rows = (np.arange(len(drive.t)) >= begin) & (drive.truth["vehicle_speed"] > 4.0)
    plant = loop.sides.vehicle.params[0]
    load = np.array([drive.truth[f"wheel_force_z_{corner}"] for corner in CORNERS])
    less = plant["friction_degression"] * (load / plant["nominal_load"][:, None] - 1.0)
    force = (drive.truth["road_friction"] * load * (1.0 - less)).sum(axis=0)
    return Braking(drive, rows, GRAVITY * force / load.sum(axis=0), np.asarray(fault_mask(drive.outputs)))


DRY_BRAKINGS = [
    {"kind": "cruise", "speed": 25.0, "accel": 3.0, "seconds": 12.0},
    {"kind": "brake", "decel": 4.0, "until_speed": 8.0},
] * 2


@cache
def begins(car: str, seed: int) -> float:
    """Return when a car has braked on the dry road [s]."""
    last = brake(car, seed, DRY, DRY_BRAKINGS)
    return float(last.drive.t[-1])


def on_another_road(car: str, seed: int, road: float, decel: float) -> Braking:
    """Brake twice on a dry road, by which friction is learned, then on another one."""
    since = begins(car, seed) + 11.0
    phases = [*DRY_BRAKINGS, DRY_BRAKINGS[0], {"kind": "brake", "decel": decel, "until_speed": 0.0}]
    return brake(car, seed, [[0.0, DRY], [since, DRY], [since + 0.1, road]], phases)


@pytest.mark.parametrize(
    ("road", "decel", "beyond"),
    [
        (0.25, 3.0, True),
        (0.25, 7.0, True),
        (0.4, 3.0, False),
        (0.4, 5.0, True),
        (0.4, 7.0, True),
        (0.6, 5.0, False),
        (0.6, 7.0, True),
    ],
)
def test_a_road_that_gives_less_is_reported_as_that_and_friction_is_held(road, decel, beyond) -> None:
    inside = []
    for car, seed in product(CARS, SEEDS):
        last = on_another_road(car, seed, road, decel)
        reported, settled = last.reported(GRIP_EXCEEDED), slice(50, None)
        names = fault_names(int(np.bitwise_or.reduce(last.masks)))
        moved = {axle: last.friction(axle)[settled] / last.friction(axle)[0] - 1.0 for axle in "fr"}
        print(f"{car}, car {seed}: reported for {reported.mean():.2f}, {names}")
        print("  friction moved by", {axle: f"{100 * np.abs(by).max():.1f} %" for axle, by in moved.items()})
        assert not (last.masks & (BRAKE_FADE | ALARMS)).any()
        assert not last.masks[: np.argmax(last.rows)].any(), "dry: nothing is reported"
        if not beyond:
            assert not reported.any()
            continue
        assert reported.mean() > 0.7
        assert max(np.abs(by).max() for by in moved.values()) < 0.08
        known = np.isfinite(last.drive.outputs["grip_limit"]) & last.rows
        limit = last.drive.outputs["grip_limit"][known]
        sigma = last.drive.outputs["sigma_grip_limit"][known]
        error = limit - last.ceiling[known]
        off, doubt = 100 * (error / limit).mean(), 100 * (sigma / limit).mean()
        print(f"  ceiling off by {off:.1f} %, sigma {doubt:.1f} %")
        assert known.sum() > 0.7 * last.rows.sum()
        assert np.abs((error / limit).mean()) < 0.1
        inside.append((np.abs(error) < 2.0 * sigma).mean())
        assert (sigma / limit).mean() < 0.17
    assert not beyond or np.mean(inside) > 0.9, "of all cars: the error of one hardly changes while it brakes"


@pytest.mark.parametrize(
    ("car", "seed", "disc", "decel", "lost", "reported"),
    [  # greatest loss of the front linings' friction below the configured one, and whether that is reported
        ("suv", 1, 200.0, 3.0, 0.25, False),
        ("suv", 1, 300.0, 4.0, 0.38, True),
        ("suv", 2, 300.0, 4.0, 0.0, False),
        ("sedan", 1, 300.0, 4.0, 0.41, True),
        ("sedan", 4, 300.0, 4.0, 0.06, False),
    ],
)
def test_linings_that_fade_on_a_road_with_grip_are_followed_and_reported_where_it_is_true(
    car, seed, disc, decel, lost, reported
) -> None:
    """Down a slope of 15 %, from 40 m/s to rest."""
    phases = [
        {"kind": "cruise", "speed": 40.0, "seconds": 3.0},
        {"kind": "brake", "decel": decel, "until_speed": 0.0},
    ]
    last = brake(car, seed, 1.2, phases, grade=-0.15, initial_disc_temperature=[disc, disc - 50.0])
    truth, settled = last.drive.truth["mu_b_fl"][last.rows], slice(150, None)
    error = last.friction("f")[settled] / truth[settled] - 1.0
    least = float(truth.min())
    names = fault_names(int(np.bitwise_or.reduce(last.masks)))
    off = 100 * np.abs(error).max()
    print(f"{car}, car {seed}: true {truth[60]:.3f} to {least:.3f}, off by {off:.1f} %, {names}")
    assert 1.0 - least / 0.45 == pytest.approx(lost, abs=0.04) if lost else least > 0.45
    assert np.abs(error).max() < 0.12
    assert not last.reported(GRIP_EXCEEDED).any()
    fade = last.reported(BRAKE_FADE)
    assert fade.any() == reported
    if reported:
        assert truth[np.argmax(fade)] < 0.7 * 0.45 * 1.05


def test_the_ceiling_has_a_bit_of_its_own() -> None:
    assert [fault.name for fault in FAULTS if fault.bit in (BRAKE_FADE, GRIP_EXCEEDED)] == [
        "compensation at its limit",
        "demand beyond grip",
    ]
