"""Pedal to deceleration and the ideal distribution, against the equal use of grip at both axles."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ecu.config import load_config, new_params
from ecu.control.demand import front_share, pedal_to_decel, requested_decel, wheel_torque_demand
from ecu.signals import (
    ALIVE,
    DECEL_DEMAND,
    DECEL_DEMAND_VALID,
    PEDAL_POSITION,
    VALID,
)

G = 9.81
CONFIGS = Path(__file__).parents[3] / "config"
MAP = [(0, 0), (5, 0), (20, 0.8), (40, 2.1), (60, 4.0), (80, 6.6), (100, 10.0)]  # config/suv.toml


@pytest.mark.parametrize(("position", "decel"), MAP)
def test_the_points_of_the_map(params, position: float, decel: float) -> None:
    assert pedal_to_decel(params[0], float(position)) == pytest.approx(decel)


@pytest.mark.parametrize(
    ("position", "decel"), [(12.5, 0.4), (50.0, 3.05), (90.0, 8.3), (-5.0, 0.0), (130.0, 10.0)]
)
def test_between_and_beyond_the_points(params, position: float, decel: float) -> None:
    assert pedal_to_decel(params[0], position) == pytest.approx(decel)


@pytest.fixture(scope="module")
def suv():
    return new_params(load_config(CONFIGS / "suv.toml"))[0]


@given(st.floats(-20, 150), st.floats(0, 50))
def test_pushing_further_never_asks_for_less(suv, position: float, further: float) -> None:
    assert pedal_to_decel(suv, position + further) >= pedal_to_decel(suv, position)


@given(st.lists(st.tuples(st.floats(0, 100), st.floats(0, 12)), min_size=2, max_size=8))
def test_any_rising_map_gives_what_numpy_interpolates(suv, points: list[tuple[float, float]]) -> None:
    xs, ys = sorted({round(x, 3) for x, _ in points}), sorted(y for _, y in points)
    ys = ys[: len(xs)]
    params = suv.copy()
    params["pedal_position"] = xs + xs[-1:] * (8 - len(xs))
    params["pedal_decel"] = ys + ys[-1:] * (8 - len(ys))
    for position in np.linspace(-10, 110, 25):
        expected = np.interp(position, xs, ys)
        assert pedal_to_decel(params, position) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("case", "pedal", "demand", "valid", "decel"),
    [
        ("pedal alone", 60.0, 0.0, 0.0, 4.0),
        ("automated demand alone", 0.0, 3.0, 1.0, 3.0),
        ("pedal is the larger", 80.0, 3.0, 1.0, 6.6),
        ("demand is the larger", 40.0, 3.0, 1.0, 3.0),
        ("demand not valid", 40.0, 9.0, 0.0, 2.1),
        ("nobody brakes", 0.0, 0.0, 1.0, 0.0),
    ],
)
def test_the_larger_of_pedal_and_valid_demand_counts(params, feed, case, pedal, demand, valid, decel) -> None:
    inputs = feed(pedal_position=pedal, decel_demand=demand, decel_demand_valid=valid)
    assert requested_decel(params[0], inputs[0]) == pytest.approx(decel), case


@pytest.mark.parametrize("verdict", [0, ALIVE, VALID])
@pytest.mark.parametrize(
    ("case", "lost", "decel_valid", "expected"),
    [
        ("pedal lost, demand valid", (PEDAL_POSITION,), 1.0, 3.0),
        ("pedal lost, demand not valid: nobody asks", (PEDAL_POSITION,), 0.0, math.nan),
        ("demand lost", (DECEL_DEMAND,), 1.0, 2.1),
        ("both lost", (PEDAL_POSITION, DECEL_DEMAND), 1.0, math.nan),
        ("validity of the demand lost", (DECEL_DEMAND_VALID,), 1.0, 2.1),
    ],
)
def test_a_lost_request_is_not_a_request_for_nothing(
    params, feed, verdict, case, lost, decel_valid, expected
) -> None:
    inputs = feed(pedal_position=40.0, decel_demand=3.0, decel_demand_valid=decel_valid)
    for place in lost:
        inputs[0]["verdict"][place] = verdict
    assert requested_decel(params[0], inputs[0]) == pytest.approx(expected, nan_ok=True), case


@pytest.mark.parametrize("asked", [-1.0, 15.0, 1e9])
def test_an_absurd_demand_is_cut_to_what_a_road_holds(params, feed, asked: float) -> None:
    inputs = feed(decel_demand=asked, decel_demand_valid=1.0)
    assert 0.0 <= requested_decel(params[0], inputs[0]) <= 12.0


@pytest.mark.parametrize("z", [0.0, 0.1, 0.15, 0.3, 0.5, 0.8, 1.0])
def test_both_axles_use_the_same_share_of_their_grip(params, z: float) -> None:
    p = params[0]
    share = front_share(p, z * G)
    weight, length, h = p["mass"] * G, p["wheelbase"], p["cog_height"]
    front_load = weight * (p["rear_axle"] + z * h) / length
    rear_load = weight * (p["front_axle"] - z * h) / length
    front, rear = share * z * weight / front_load, (1 - share) * z * weight / rear_load
    assert front == pytest.approx(z)
    assert rear == pytest.approx(z)


@pytest.mark.parametrize("name", ["suv", "sedan", "lcv", "mustang"])
def test_ece_r13h_the_rear_axle_never_locks_first(name: str) -> None:
    """Annex 5: between z 0.15 and 0.8 the front axle uses at least as much grip as the rear one, at nominal
    friction (equal, for the ideal distribution), and both need no more than (z + 0.04) / 0.7."""
    p = new_params(load_config(CONFIGS / f"{name}.toml"))[0]
    for z in np.linspace(0.15, 0.8, 66):
        share = front_share(p, z * G)
        front = share * z / ((p["rear_axle"] + z * p["cog_height"]) / p["wheelbase"])
        rear = (1 - share) * z / ((p["front_axle"] - z * p["cog_height"]) / p["wheelbase"])
        assert front >= rear - 1e-12
        assert front <= (z + 0.04) / 0.7


@pytest.mark.parametrize("decel", [0.5, 2.0, 4.0, 8.0, 12.0])
def test_torques_add_up_to_the_force_that_is_asked_for(params, decel: float) -> None:
    """(5.1): sum T_b / r = m a; nothing on either side of the car is larger than the other."""
    p = params[0]
    torques = [wheel_torque_demand(p, decel, i) for i in range(4)]
    assert sum(t / r for t, r in zip(torques, p["wheel_radius"], strict=True)) == pytest.approx(
        p["mass"] * decel
    )
    assert torques[0] == torques[1] > torques[2] == torques[3] >= 0


def test_no_request_is_no_torque_and_an_unknown_one_is_unknown(params) -> None:
    for corner in range(4):
        assert wheel_torque_demand(params[0], 0.0, corner) == 0.0
        assert not wheel_torque_demand(params[0], math.nan, corner) > 0.0
