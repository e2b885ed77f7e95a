"""Ceiling of grip by wheels that slip: what they say of the road, what they do not, and how it is forgotten.

The tyres here are not the observer's: shape 1.5, curvature 0.3.
"""

import math

import numpy as np
import pytest

from ecu.algorithm.estimation.joint.ceiling import KNOWN, PRIOR, follow_ceiling
from ecu.algorithm.estimation.joint.layout import JOINT_STATE, PEAK, V
from ecu.algorithm.estimation.joint.prior import set_prior

SPEED, WINDOW_S = 20.0, 0.05  # m/s, s
ROLLING = (0.0, 0.0, 0.0, 0.0)


def adhesion(slip: float, road: float, stiffness: float) -> float:
    """Return the adhesion at a slip on a road of this peak, by the Magic Formula."""
    x = stiffness * slip / (1.5 * road)
    return road * math.sin(1.5 * math.atan(x - 0.3 * (x - math.atan(x))))


class Road:
    """A car that brakes on a road of a peak adhesion; `params` is one `PARAMS`."""

    def __init__(self, params) -> None:
        self.params, self.state = params, np.zeros(1, JOINT_STATE)[0]
        set_prior(params, self.state)
        self.state["x"][V] = SPEED
        self.held = np.zeros(4, np.uint8)

    def brake(self, road: float, slips, windows: int = 10, rolls: float = 0.0, braking: bool = True) -> None:
        """Brake for some windows at these slips; wheels that roll brake with the adhesion `rolls`."""
        p, state, window = self.params, self.state, self.state["window"]
        load, slips = p["static_load"], np.array(slips)
        slides = slips > 0.03
        used = [adhesion(s, road, c) for s, c in zip(slips, p["slip_stiffness"], strict=True)]
        force = load * np.where(slides, used, rolls)
        window["omega"] = state["x"][V] * (1.0 - slips) / p["wheel_radius"]
        window["ground"], window["omega_samples"], window["time"] = state["x"][V], 5, WINDOW_S
        window["load"] = load
        drag = p["drag_area"] * state["x"][V] ** 2
        window["accel"] = -(force.sum() + drag) / p["mass"]
        state["force"], state["measured_slip"] = np.where(slides, 0.0, -force), slips
        for _ in range(windows):
            follow_ceiling(p, state, self.held, braking)

    @property
    def known(self) -> bool:
        """Whether the ceiling is certain enough to be published."""
        return 0.0 < self.state["ceiling_variance"] < KNOWN**2

    @property
    def sigma(self) -> float:
        return math.sqrt(self.state["ceiling_variance"])


@pytest.fixture
def road(params) -> Road:
    return Road(params[0])


@pytest.mark.parametrize(
    ("case", "peak", "slips", "rolls"),
    [
        ("all wheels slip on ice", 0.15, (0.2, 0.3, 0.2, 0.11), 0.0),
        ("the front slips on snow, the rear rolls", 0.25, (0.3, 0.2, 0.01, 0.01), 0.15),
        ("the front has locked on snow", 0.25, (1.0, 1.0, 0.01, 0.01), 0.15),
        ("the rear slips on a wet road", 0.6, (0.02, 0.02, 0.15, 0.12), 0.4),
        ("diagonally on a wet road", 0.6, (0.15, 0.03, 0.03, 0.12), 0.5),
        ("all wheels near their peak on a dry road", 1.0, (0.12, 0.12, 0.11, 0.11), 0.0),
        ("three wheels have locked on a dry road", 1.0, (1.0, 1.0, 1.0, 0.03), 0.7),
    ],
)
def test_wheels_that_slip_tell_the_road(road, case, peak, slips, rolls) -> None:
    """Within 2 s, however far beyond their peak they are."""
    road.brake(peak, slips, windows=40, rolls=rolls)
    off = math.log(road.state["ceiling"] / peak)
    print(f"{case}: {road.state['ceiling']:.3f} of {peak}, sigma {road.sigma:.3f}")
    assert road.known
    assert abs(off) < 2.0 * road.sigma


@pytest.mark.parametrize(
    ("case", "slips", "rolls", "keys"),
    [
        ("no wheel slips", ROLLING, 0.15, {}),
        ("wheels of one side alone", (0.3, 0.01, 0.3, 0.01), 0.15, {}),
        ("one wheel alone", (0.3, 0.01, 0.01, 0.01), 0.15, {}),
        ("nothing brakes", (0.3, 0.3, 0.3, 0.3), 0.0, {"braking": False}),
    ],
)
def test_nothing_is_said_of_the_road(road, case, slips, rolls, keys) -> None:
    road.brake(0.25, slips, rolls=rolls, **keys)
    assert road.state["ceiling_variance"] == 0.0, case


@pytest.mark.parametrize(("what", "value"), [("unmeasured_s", 0.1), ("speed", 3.0)])
def test_without_an_accelerometer_or_slow_nothing_is_said(road, what, value) -> None:
    if what == "speed":
        road.state["x"][V] = value
    else:
        road.state[what] = value
    road.brake(0.25, (0.3, 0.3, 0.3, 0.3))
    assert not road.known


def test_one_window_says_little_and_no_number_of_them_all(road) -> None:
    road.brake(0.25, (0.5, 0.5, 0.01, 0.01), windows=1, rolls=0.15)
    assert not road.known
    road.brake(0.25, (0.5, 0.5, 0.01, 0.01), windows=400, rolls=0.15)
    # The rear's friction is known to 22 % of its force, the same all the while.
    rear = 0.15 * road.params["static_load"][2:].sum()
    front = adhesion(0.5, 0.25, road.params["slip_stiffness"][0]) * road.params["static_load"][:2].sum()
    assert road.sigma > 0.2 * rear / front


def test_a_wheel_that_spins_up_is_no_grip_of_the_road(road) -> None:
    """Its slip falls from 0.05 to 0.01 in a window: the road turns the wheel, the brake does not feel it."""
    p, state = road.params, road.state
    road.brake(0.25, (0.3, 0.3, 0.01, 0.01), windows=40, rolls=0.15)
    before = float(state["ceiling"])
    turned = p["wheel_inertia"][2:] * SPEED * 0.04 / (WINDOW_S * p["wheel_radius"][2:] ** 2)
    state["measured_slip"][2:] = 0.05
    state["window"]["accel"] -= turned.sum() / p["mass"]
    follow_ceiling(p, state, road.held, True)
    assert state["ceiling"] == pytest.approx(before, rel=0.01)


def test_a_tyre_of_another_size_does_not_slip(road) -> None:
    """8 % smaller than configured: it reads a slip of 8 % less while it rolls, and while it brakes."""
    road.state["released"] = 1
    road.brake(0.9, (0.08,) * 4, windows=0)
    road.state["window"]["accel"] = 0.0
    for _ in range(100):
        follow_ceiling(road.params, road.state, road.held, False)
    road.state["released"] = 0
    road.brake(0.9, ROLLING, windows=1)  # the forces of wheels that roll
    road.state["window"]["omega"] = SPEED * 0.9 / road.params["wheel_radius"]
    for _ in range(20):
        follow_ceiling(road.params, road.state, road.held, True)
    assert road.state["ceiling_variance"] == 0.0
    assert road.state["measured_slip"] == pytest.approx(0.02, abs=0.002)


@pytest.mark.parametrize("held", [0, 1])
def test_wheels_that_the_slip_guard_holds_show_it_near_their_peak(road, held) -> None:
    road.held[:] = held
    road.brake(0.25, (0.05, 0.05, 0.05, 0.05), windows=40)
    assert road.known == bool(held)
    assert not held or road.state["ceiling"] == pytest.approx(0.25, rel=0.1)


def test_it_is_forgotten_with_distance(road) -> None:
    road.brake(0.25, (0.12, 0.12, 0.12, 0.12), windows=40)
    sigmas = []
    for _ in range(8):
        road.brake(0.25, ROLLING, windows=200, braking=False)  # 10 s
        sigmas.append(road.sigma)
    assert (np.diff(sigmas) > 0.0).all()
    assert road.known
    road.brake(0.25, ROLLING, windows=1200, braking=False)
    assert not road.known
    road.brake(0.25, ROLLING, windows=8000, braking=False)
    assert road.state["ceiling_variance"] == 0.0


def test_a_car_that_brakes_harder_on_wheels_that_roll_is_on_another_road(road) -> None:
    road.brake(0.25, (0.12, 0.12, 0.12, 0.12), windows=40)
    road.brake(0.8, ROLLING, windows=1, rolls=0.24)
    assert road.known
    road.brake(0.8, ROLLING, windows=1, rolls=0.5)
    assert road.state["ceiling"] == pytest.approx(0.5, rel=1e-6)
    assert not road.known
    assert road.sigma <= PRIOR


@pytest.mark.parametrize(("first", "then"), [(1.0, 0.2), (0.2, 1.0)])
def test_another_road_is_believed_within_half_a_second(road, first, then) -> None:
    road.brake(first, (0.12, 0.12, 0.12, 0.12), windows=40)
    road.brake(then, (0.12, 0.12, 0.12, 0.12))
    assert abs(math.log(road.state["ceiling"] / then)) < 2.0 * road.sigma


@pytest.mark.parametrize(("used", "known"), [(0.6, False), (0.8, True)])
def test_close_to_the_peak_that_slip_has_shown_no_wheel_needs_to_slide(road, used, known) -> None:
    """0.9 is the peak of the prior, here known to 5 %."""
    road.state["p"][PEAK, PEAK] = 0.05**2
    road.brake(0.9, ROLLING, rolls=used)
    assert road.known == known
    assert not known or road.state["ceiling"] == pytest.approx(0.9)
