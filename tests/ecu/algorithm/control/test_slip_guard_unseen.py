"""The slip guard on wheels whose speed is lost: by what the road shows at the others."""

import numpy as np
import pytest

from ecu.algorithm.control.rear_guard import BESIDE, EASED, EMPTIES_S, SLIDING, hold_unseen
from ecu.algorithm.control.slip_guard import guard_slip
from ecu.algorithm.estimate import ESTIMATE
from ecu.contract.signals import CORNERS, INPUT

from .test_slip_guard import BAR, DT, SENT, Wheels, new_guard

LOCKS = [*np.linspace(0.0, 0.5, 12), *np.linspace(0.5, 0.02, 20), *[0.02] * 200]
"""Slips of a wheel that begins to lock, is let go and comes back, one a cycle."""


def unseen(params, feed, slides: str, lost: str, wanted: np.ndarray = SENT, **flags: float) -> np.ndarray:
    """Return the guard after each cycle while some wheels go through `LOCKS` and others' speeds are lost."""
    guards = []
    state, estimate, inputs = new_guard(), np.zeros(1, ESTIMATE)[0], feed()
    estimate["load"], state["pressed"] = params[0]["static_load"], wanted
    sent = wanted.copy()
    for slip in LOCKS:
        omega = 20.0 / params[0]["wheel_radius"]
        omega[[CORNERS.index(corner) for corner in slides.split()]] *= 1.0 - slip
        feed(inputs, wheel_speed=omega, **flags)
        for corner in lost.split():
            inputs[0]["new"][INPUT[f"wheel_speed_{corner}"]] = 0
            inputs[0]["verdict"][INPUT[f"wheel_speed_{corner}"]] = 0
        pressures = sent, sent / BAR, np.zeros(4), wanted, wanted
        guard_slip(params[0], state, inputs[0], estimate, 20.0, *pressures, DT)
        sent = np.where(state["capped"], np.minimum(state["cap"], wanted), wanted)
        guards.append(state.copy())
    return np.array(guards)


@pytest.mark.parametrize(
    ("case", "slides", "lost", "capped"),
    [
        ("the road's left is slippery", "fl", "rl", "fl rl"),
        ("its right is", "fr", "rr", "fr rr"),
        ("the wheel ahead does not slip", "fr", "rl", "fr"),
        ("both rear ones", "fl fr", "rl rr", "fl fr rl rr"),
        ("both rear ones, the left is slippery", "fl", "rl rr", "fl rl"),
        ("an even road, the other rear one slips", "fl fr rr", "rl", "fl fr rr rl"),
        ("an even road, the other rear one does not slip", "fl fr", "rl", "fl fr"),
        ("the wheel ahead is lost, too", "fl fr", "fl rl rr", "fr rr"),
        ("front ones", "rl rr", "fl fr", "rl rr"),
    ],
)
def test_a_rear_wheel_whose_speed_is_lost_is_capped_by_what_the_road_shows(
    params, feed, case, slides, lost, capped
) -> None:
    ever = unseen(params, feed, slides, lost)["capped"].any(axis=0)
    assert {corner for corner, is_capped in zip(CORNERS, ever, strict=True) if is_capped} == set(
        capped.split()
    ), case


@pytest.mark.parametrize("flag", ["abs_active", "esp_active"])
def test_beside_an_abs_no_wheel_is_capped_by_another(params, feed, flag) -> None:
    assert not unseen(params, feed, "fl", "rl", **{flag: 1.0})["capped"][:, 2].any()


@pytest.mark.parametrize(("slides", "share"), [("fl", SLIDING), ("fl fr rr", BESIDE)])
def test_it_is_eased_until_it_has_spun_up_and_then_has_its_share(params, feed, slides, share) -> None:
    """It may stand: what a sliding tyre carries turns it, half of that is left to its brake."""
    p, guards = params[0], unseen(params, feed, slides, "rl")
    eased, cap, grip = guards["let_go_s"][:, 2] > 0.0, guards["cap"][:, 2], guards["grip"][:, 2]
    first = int(np.argmax(eased))
    last = first + int(np.argmin(eased[first:]))
    force = 2.0 * p["piston_area"][2] * p["effective_radius"][2] * p["mu_nominal"][2] / p["wheel_radius"][2]
    spins_up = 20.0 * p["wheel_inertia"][2] / p["wheel_radius"][2] ** 2
    spins_up /= (1.0 - EASED) * SLIDING * force * grip[first]
    print(f"eased to {cap[first] / BAR:.1f} bar for {(last - first) * DT:.2f} s, then {cap[last] / BAR:.1f}")
    assert (cap[eased] <= 1.001 * EASED * SLIDING * grip[eased]).all()
    assert (last - first) * DT == pytest.approx(EMPTIES_S + spins_up, abs=1.01 * DT)
    assert cap[last] == pytest.approx(share * grip[last], rel=0.01)
    assert not eased[last:].any()


@pytest.mark.parametrize(("slides", "share"), [("fl", SLIDING), ("fl fr rr", BESIDE)])
def test_a_wheel_that_presses_less_than_the_road_carries_is_not_eased(params, feed, slides, share) -> None:
    guards = unseen(params, feed, slides, "rl", np.array([60.0, 60.0, 0.5, 40.0]) * BAR)
    assert not guards["let_go_s"].any()
    first = guards[np.argmax(guards["capped"][:, 2])]
    assert first["cap"][2] == pytest.approx(share * first["grip"][2])


# A front wheel: 63.6 bar at nominal friction use the whole of its load, a rear one: 171.4 bar.
SHOWN = [
    # case, front left: slides, grip, cap [bar]; mu there, at the rear left; what that is at the front
    ("it slides", 1, 20.0, 30.0, 0.0, 0.0, 20.0),
    ("it has climbed, not by more than 1.3", 0, 20.0, 22.0, 0.0, 0.0, 20.0),
    ("it has climbed by half", 0, 20.0, 30.0, 0.0, 0.0, 30.0 / 1.3),
    ("it has climbed to three times that", 0, 20.0, 60.0, 0.0, 0.0, 60.0 / 1.3),
    ("all linings rough", 1, 20.0, 30.0, 0.6, 0.6, 20.0),
    ("the rear lining twice as rough", 1, 20.0, 30.0, 0.3, 0.6, 10.0),
    ("nothing left", 1, 0.0, 0.5, 0.0, 0.0, 1.0),
]


def held(params, feed, front: dict[int, tuple[int, float, float]], lost: tuple[int, ...], **rows):
    """Return the guard after it has held the rear left wheel; `front`: slides, grip, cap [bar] of wheels."""
    state, estimate, inputs = new_guard(), np.zeros(1, ESTIMATE)[0], feed()
    estimate["load"] = params[0]["static_load"]
    estimate["mu"] = rows.pop("mu", 0.0)
    for i, (slides, grip, cap) in front.items():
        state["capped"][i], state["slides"][i] = 1, slides
        state["grip"][i], state["cap"][i] = grip * BAR, cap * BAR
    for name, (i, value) in rows.items():
        state[name][i] = value
    for i in lost:
        inputs[0]["verdict"][INPUT["wheel_speed_fl"] + i] = 0
    hold_unseen(params[0], state, inputs[0], estimate, 20.0, 2, DT)
    return state


@pytest.mark.parametrize(
    ("case", "slides", "grip", "cap", "mu", "rear", "carried"), SHOWN, ids=[row[0] for row in SHOWN]
)
def test_equal_adhesion_at_both_wheels_of_a_side(
    params, feed, case, slides, grip, cap, mu, rear, carried
) -> None:
    state = held(params, feed, {0: (slides, grip, cap)}, (2,), mu=[mu, mu, rear, mu])
    assert state["grip"][2] / BAR == pytest.approx(carried * 171.45 / 63.58, rel=1e-3), case
    assert state["cap"][2] == pytest.approx(SLIDING * state["grip"][2])


@pytest.mark.parametrize(
    ("case", "lost", "rows", "capped"),
    [
        ("the wheel ahead shows it", (2,), {}, 1),
        ("its speed is lost since it was capped", (0, 2), {}, 0),
        ("its sensor lies", (2,), {"denied": (0, 1)}, 0),
    ],
)
def test_which_wheel_ahead_shows_what_the_road_carries(params, feed, case, lost, rows, capped) -> None:
    assert held(params, feed, {0: (1, 20.0, 20.0)}, lost, **rows)["capped"][2] == capped, case


@pytest.mark.parametrize(
    ("case", "capped", "pressed", "eased"),
    [
        ("it may stand: it had more than the road carries", 0, 1.2, True),
        ("it had less", 0, 0.9, False),
        ("it was given nine tenths of it: the hydraulics are as late", 1, 1.2, False),
        ("it has more than that", 1, 1.6, True),
    ],
)
def test_when_a_wheel_that_is_not_seen_is_eased(params, feed, case, capped, pressed, eased) -> None:
    """An even road: both front wheels slip alike, the other rear one carries 40 bar."""
    slips = {0: (1, 20.0, 20.0), 1: (1, 20.0, 20.0), 3: (1, 40.0, 40.0)}
    rows = {"capped": (2, capped), "pressed": (2, pressed * 40.0 * BAR)}
    assert bool(held(params, feed, slips, (2,), **rows)["let_go_s"][2]) == eased, case


def test_a_speed_that_is_back_ends_that(params, feed) -> None:
    wheels = Wheels(params, feed)
    wheels.state["let_go_s"] = 0.3
    wheels.cycle(0.0)
    assert not wheels.state["let_go_s"][2:].any()
