"""One cycle of the slip guard: what slip, its growth and the pressure show, and what the brake is left.

The shipped SUV at 20 m/s. A front wheel: 63.6 bar at nominal friction use the whole of its load, 1 m/s^2 of
its rim takes 0.135 bar, and by its slip stiffness of 22 it slides wholly beyond 0.155 of the adhesion used.
"""

import math

import numpy as np
import pytest

from ecu.algorithm.control.rear_guard import select_low
from ecu.contract.signals import INPUT, WHEEL_SPEED

from .test_slip_guard import BAR, DT, Wheels

SPEED, INERTIA = 20.0, 0.1346  # m/s; bar for 1 m/s^2
SIGMA = DT / 0.45  # m/s of noise that make a growth of 1 m/s^2
BEFORE = {"rolls": (0, 0), "returns": (1, 0), "slides": (1, 1)}


@pytest.fixture
def wheels(params, feed) -> Wheels:
    wheels = Wheels(params, feed, SPEED)
    wheels.cycle(0.0)
    wheels.inputs[0]["new"][WHEEL_SPEED : WHEEL_SPEED + 4] = 0
    wheels.wanted[:] = wheels.sent[:] = 150.0 * BAR
    return wheels


def known(wheels: Wheels, before: str, slip: float, growth: float, pressed: float, corner: int = 0, **row):
    """Run a cycle in which no frame comes of a wheel of which all is known; `row`: its state, in bar and SI.

    Returns cap and grip [bar] after it."""
    state = wheels.state
    pressures = {"grip": pressed, "cap": pressed, "pressed": pressed}
    for name in pressures.keys() & row.keys():
        pressures[name] = row.pop(name)
    lag = {"lag": slip * SPEED, "growth": growth, "rolled": (1.0 - slip) * SPEED}
    capped, slides = BEFORE[before]
    flags = {"capped": capped, "slides": slides}
    for name, value in (lag | flags | row | {k: v * BAR for k, v in pressures.items()}).items():
        state[name][corner] = value
    wheels.sent[corner] = pressures["pressed"] * BAR
    wheels.guard(SPEED)
    return state["cap"][corner] / BAR, state["grip"][corner] / BAR


CUTS = [
    # case, before, slip, growth [m/s^2], its sigma, pressed, grip [bar], cut
    ("ice: it will be beyond 3 % in 0.06 s", "returns", 0.025, 7.0, 0.0, 5.0, 5.0, True),
    ("it hardly falls behind", "returns", 0.029, 4.0, 0.0, 5.0, 5.0, False),
    ("noise, beyond by 3 sigma", "returns", 0.025, 28.0, 10.0, 5.0, 5.0, True),
    ("noise, beyond by 2 sigma", "returns", 0.005, 31.0, 10.0, 5.0, 5.0, False),
    ("far, growth is no more than noise", "returns", 0.125, 15.0, 10.0, 5.0, 5.0, False),
    ("far, growth is more than noise", "returns", 0.125, 29.0, 10.0, 5.0, 5.0, True),
    ("a slip that begins, for all its noise", "rolls", 0.1025, 10.5, 5.0, 60.0, 0.0, True),
    ("ice, by the brush model", "slides", 0.025, 0.0, 0.0, 5.0, 5.0, False),
    ("ice, slides", "slides", 0.035, 0.0, 0.0, 5.0, 5.0, True),
    ("half the load carried: slips", "slides", 0.070, 0.0, 0.0, 31.8, 31.8, False),
    ("half the load carried: slides", "slides", 0.085, 0.0, 0.0, 31.8, 31.8, True),
    ("a dry road: slips", "slides", 0.095, 0.0, 0.0, 60.0, 60.0, False),
    ("a dry road: slides", "slides", 0.105, 0.0, 0.0, 60.0, 60.0, True),
    ("a road that has become ice", "slides", 0.050, 0.0, 0.0, 5.0, 31.8, True),
    ("eased on a road that carried more", "returns", 0.050, 7.0, 0.0, 5.0, 31.8, False),
]


@pytest.mark.parametrize(
    ("case", "before", "slip", "growth", "sigma", "pressed", "grip", "cut"), CUTS, ids=[c[0] for c in CUTS]
)
def test_when_a_wheel_is_cut(wheels, case, before, slip, growth, sigma, pressed, grip, cut) -> None:
    cap, _ = known(wheels, before, slip, growth, pressed, grip=grip, noise=sigma * SIGMA)
    assert (cap < pressed) == cut, case


AMOUNTS = [
    # case, slip, growth [m/s^2], braking of the car [m/s^2], lag to lose in 0.15 s at least at 6 m/s^2
    ("a little beyond", 0.085, 0.0, 0.0, 6.0),
    ("the car brakes: the wheel's inertia helps the brake", 0.085, 0.0, 6.0, 6.0),
    ("far beyond", 0.185, 0.0, 0.0, (0.185 - 0.0773) * SPEED / 0.15),
]


@pytest.mark.parametrize(("case", "slip", "growth", "braking", "back"), AMOUNTS, ids=[a[0] for a in AMOUNTS])
def test_how_far_a_wheel_is_cut(wheels, case, slip, growth, braking, back) -> None:
    wheels.estimate["accel_x"] = -braking
    cap, _ = known(wheels, "slides", slip, growth, 31.8)
    assert cap == pytest.approx(0.9 * (31.8 - INERTIA * (growth + braking)) - INERTIA * back, rel=0.01), case


@pytest.mark.parametrize(("slip", "cap"), [(0.99, 0.5), (0.97, 0.9 * 60.0 - INERTIA * 0.87 * SPEED / 0.15)])
def test_only_a_wheel_that_stands_has_nothing_left(wheels, slip, cap) -> None:
    assert known(wheels, "slides", slip, 0.0, 60.0)[0] == pytest.approx(cap, rel=0.01)


GRIPS = [
    # case, before, slip, growth [m/s^2], pressed, grip before, grip after [bar]
    ("falls behind: no more than before", "slides", 0.3, 20.0, 10.0, 5.0, 5.0),
    ("falls behind: the least", "slides", 0.3, 0.5, 4.0, 5.0, 4.0 - INERTIA * 0.5),
    ("comes back: the greatest", "slides", 0.3, -3.0, 6.0, 5.0, 6.0 + INERTIA * 3.0),
    ("stands: as it was", "slides", 0.99, -3.0, 30.0, 5.0, 5.0),
    ("stands from the first: unknown", "rolls", 0.99, 20.0, 30.0, 0.0, 0.0),
    ("hardly turns", "rolls", 0.97, 20.0, 30.0, 0.0, 30.0 - INERTIA * 20.0),
    ("begins to slip", "rolls", 0.3, 20.0, 30.0, 0.0, 30.0 - INERTIA * 20.0),
    ("returns and gains speed", "returns", 0.02, -7.0, 10.0, 5.0, 10.0 + INERTIA * 7.0),
    ("returns and gains little", "returns", 0.02, -4.0, 10.0, 5.0, 5.0),
]


@pytest.mark.parametrize(
    ("case", "before", "slip", "growth", "pressed", "grip", "after"), GRIPS, ids=[g[0] for g in GRIPS]
)
def test_what_a_slip_shows_of_the_road(wheels, case, before, slip, growth, pressed, grip, after) -> None:
    found = known(wheels, before, slip, growth, pressed, grip=grip)[1]
    assert found == pytest.approx(after, rel=0.01), case


@pytest.mark.parametrize(("corner", "share"), [(0, 0.97), (1, 0.97), (2, 0.9), (3, 0.9)])
def test_a_wheel_that_has_come_back_has_most_of_what_the_road_carried(wheels, corner, share) -> None:
    """A rear wheel has less of it: the heading depends on it."""
    wheels.wanted[[2, 3]] = 40.0 * BAR, 40.0 * BAR
    cap, _ = known(wheels, "slides", 0.0, 0.0, 5.0, corner, grip=20.0)
    assert cap == pytest.approx(share * 20.0 + 0.25 * 20.0 * DT)


@pytest.mark.parametrize(
    ("case", "cap", "row", "rate"),
    [
        ("below what the road carried", 4.0, {}, 0.25 * 5.0),
        ("beyond it, ever faster", 10.0, {}, 0.25 * 5.0 + 7.0 * 5.0),
        ("its sensor lies", 10.0, {"denied": 1}, 400.0),
    ],
)
def test_how_fast_pressure_is_given_back(wheels, case, cap, row, rate) -> None:
    slip = 0.2 if row else 0.0
    now, _ = known(wheels, "returns", slip, 0.0, 4.0, cap=cap, grip=5.0, **row)
    assert (now - cap) / DT == pytest.approx(rate), case


DENIALS = [
    # case, slip, growth [m/s^2], pressed [bar], seconds, denied
    ("without torque, does not spin up", 0.3, -4.0, 0.5, 0.35, 1),
    ("not yet", 0.3, -4.0, 0.5, 0.25, 0),
    ("spins up", 0.3, -6.0, 0.5, 0.35, 0),
    ("ice: 6 % is slip there, and it does not spin up", 0.06, -4.0, 0.5, 0.35, 1),
    ("steady: stable, or a scaled sensor", 0.3, 1.5, 5.0, 0.15, 1),
    ("not steady", 0.3, 3.0, 5.0, 0.15, 0),
    ("steady, within the range of tyres on dry roads", 0.06, 0.0, 5.0, 0.35, 0),
    ("stands", 0.6, 0.0, 5.0, 0.15, 0),
]


@pytest.mark.parametrize(
    ("case", "slip", "growth", "pressed", "seconds", "denied"), DENIALS, ids=[d[0] for d in DENIALS]
)
def test_which_wheel_does_not_behave_as_one_that_locks(
    wheels, case, slip, growth, pressed, seconds, denied
) -> None:
    known(wheels, "slides", slip, growth, pressed)
    for _ in range(round(seconds / DT) - 1):
        wheels.guard(SPEED)
    assert wheels.state["denied"][0] == denied, case


@pytest.mark.parametrize(
    ("slip", "growth", "denied"),
    [(0.3, 20.0, 0), (0.0, 0.0, 0), (0.3, 5.0, 1)],
    ids=["grows", "rolls", "stays"],
)
def test_a_sensor_is_believed_again_once_its_slip_grows_or_is_gone(wheels, slip, growth, denied) -> None:
    cap, _ = known(wheels, "returns", slip, growth, 10.0, denied=1)
    assert wheels.state["denied"][0] == denied
    assert (cap < 10.0) == (growth == 20.0)


def test_a_wheel_speed_that_is_scaled_does_not_hide_that_the_wheel_locks(params, feed) -> None:
    """It reads 15 % less for three seconds, then the wheel locks at 60 m/s^2."""
    wheels = Wheels(params, feed, SPEED)
    scaled = [wheels.cycle(-0.15 * min(k / 200, 1.0)) for k in range(500)]
    assert all(map(math.isinf, scaled))
    assert min(wheels.cycle(-0.15 - 0.85 * 60.0 * k * DT / SPEED) for k in range(25)) < 1.0


def test_motors_brake_a_wheel_as_their_pressure_would(wheels) -> None:
    """100 N m at the front are 7.2 bar at nominal friction."""
    p = wheels.params
    per_bar = 2.0 * p["piston_area"][0] * p["effective_radius"][0] * p["mu_nominal"][0] * BAR
    wheels.sent[:], wheels.motor[0] = 10.0 * BAR, 100.0
    for _ in range(100):
        wheels.guard(SPEED)
    assert wheels.state["pressed"][0] / BAR == pytest.approx(10.0 + 100.0 / per_bar)
    assert wheels.state["pressed"][1] / BAR == pytest.approx(10.0)


@pytest.mark.parametrize(("share", "grip"), [(1.5, 8.8), (0.5, 7.2), (1.05, 8.4)])
def test_a_load_that_jumps_is_followed_by_a_tenth_a_cycle(wheels, share, grip) -> None:
    wheels.estimate["load"][0] *= share
    assert known(wheels, "returns", 0.0, 0.0, 6.0, grip=8.0)[1] == pytest.approx(grip)


def test_noise_is_known_after_half_a_second(params, feed) -> None:
    """Speeds that go up and down by 0.1 m/s have second differences of 0.4 m/s, 1.95 sigma of white noise."""
    wheels = Wheels(params, feed, SPEED)
    for k in range(53):
        wheels.cycle(0.005 * (-1.0) ** k)
    assert wheels.state["noise"][0] == pytest.approx((1.0 - math.exp(-1.0)) * 0.4 / 1.95, rel=0.03)


def test_growth_has_no_more_noise_than_is_counted_on(params, feed) -> None:
    """0.45 of the wheel speed's over a cycle, by the low-pass; the median before it takes some more."""
    wheels, found = Wheels(params, feed, SPEED), []
    random = np.random.default_rng(0)
    for _ in range(2000):
        wheels.cycle(0.05 * random.standard_normal() / SPEED)
        found.append((wheels.state["growth"][0], wheels.state["noise"][0]))
    growth, noise = np.array(found[200:]).T
    print(f"growth {growth.std():.2f} m/s^2, noise {noise.mean():.4f} m/s")
    assert noise.mean() == pytest.approx(0.05, rel=0.05)
    assert 0.75 < growth.std() / (0.45 * 0.05 / DT) < 1.0


def test_of_a_wheel_that_rolls_or_is_let_go_nothing_is_kept(wheels) -> None:
    names = ("slides", "follows", "denied", "freed_s", "steady_s", "grip")
    kept = {"follows": 1, "freed_s": 0.2, "steady_s": 0.05}
    wheels.wanted[0] = 4.0 * BAR
    known(wheels, "returns", 0.0, 0.0, 5.0, **kept)
    known(wheels, "rolls", 0.0, 0.0, 5.0, denied=1)
    assert {name: float(wheels.state[name][0]) for name in names} == dict.fromkeys(names, 0.0)
    known(wheels, "returns", 0.2, 0.0, 5.0, follows=1)
    assert [wheels.state[name][0] for name in ("capped", "slides", "follows")] == [0, 0, 0], "it slips"


@pytest.mark.parametrize(
    ("case", "speed", "flags", "held"),
    [("alone", 20.0, {}, 1), ("walking pace", 2.0, {}, 0), ("beside an ABS", 20.0, {"abs_active": 1.0}, 0)],
)
def test_when_a_rear_wheel_is_held_for_the_other_one(params, feed, case, speed, flags, held) -> None:
    wheels = Wheels(params, feed, speed, **flags)
    wheels.cycle(0.0)
    wheels.wanted[:] = 150.0 * BAR
    wheels.state["capped"][2], wheels.state["cap"][2], wheels.state["grip"][2] = 1, 5.0 * BAR, 5.0 * BAR
    wheels.guard(speed)
    assert wheels.state["capped"].tolist() == [0, 0, 1, held], case


@pytest.mark.parametrize(("seen", "follows"), [(True, 1), (False, 0)])
def test_a_rear_wheel_that_is_not_seen_does_not_return_with_the_other_one(wheels, seen, follows) -> None:
    """It is given back as slowly as one that has slipped itself."""
    wheels.state["capped"][2], wheels.state["cap"][2], wheels.state["grip"][2] = 1, 5.0 * BAR, 5.0 * BAR
    wheels.inputs[0]["verdict"][INPUT["wheel_speed_rr"]] *= seen
    select_low(wheels.state, wheels.inputs[0], wheels.sent, wheels.wanted)
    assert wheels.state["capped"][3] == 1
    assert wheels.state["follows"][3] == follows
