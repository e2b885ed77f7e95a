"""Tables of `control.minimise`: closed form of the least, heat unknown to the models, Annex 5 by moments."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ecu.algorithm.control.cleaner_share import admitted, wanted_share
from ecu.algorithm.control.distribution import LEAST_TRAILING, front_share
from ecu.contract.dust import FEATURES, LAW_TERMS
from ecu.contract.params import HEAT_NODES, HEAT_STEP, RATE_NODES, RATE_STEP
from ecu.errors import UserError
from ecu.settings.config import Config, load_config, new_params
from ecu.settings.dust import Dust
from ecu.settings.lining_share import DECEL, FLAT, LEAST_EACH, worn_mass

G = 9.81
CONFIGS = Path(__file__).parents[3] / "config"
CARS = ["suv", "sedan", "lcv", "mustang", "suv-blended"]


def law(level: float, power: float, by_heat: float = 0.0, hottest: float = 1000.0) -> Dust:
    """Return a model of 10^level (T v d)^power 10^(by_heat t / 100 K), trained up to `hottest` [degC]."""
    numbers = [level, power, 0.0, 0.0, by_heat, *[0.0] * (LAW_TERMS - 4)]
    low, high = [1e-3] * len(FEATURES), [1e6] * len(FEATURES)
    high[FEATURES.index("temperature")] = hottest
    return Dust(model="law", numbers=numbers, low=low, high=high, below=-0.5, above=0.5)


def car(name: str, minimise: str, front: Dust | None = None, rear: Dust | None = None) -> Config:
    config = load_config(CONFIGS / f"{name}.toml")
    return config.model_copy(
        update={
            "front": config.front.model_copy(update={"dust": front}),
            "rear": config.rear.model_copy(update={"dust": rear}),
            "control": config.control.model_copy(update={"minimise": minimise}),
        }
    )


@pytest.mark.parametrize("ratio", [0.5, 0.8, 1.0, 1.1, 1.25, 2.0])
@pytest.mark.parametrize("power", [1.15, 1.25, 1.4])
def test_dust_that_grows_with_a_power_of_the_torque_is_least_by_its_closed_form(ratio, power) -> None:
    """k y^n + (1 - y)^n is least where y / (1 - y) = k^(-1 / (n - 1)); the wheels' radii are equal."""
    p = new_params(car("suv", "dust", law(4.0 + np.log10(ratio), power), law(4.0, power)))[0]
    odds = ratio ** (-1.0 / (power - 1.0))
    best = min(max(odds / (1.0 + odds), LEAST_EACH), 1.0 - LEAST_EACH)
    found = p["wanted_share"]

    def cost(y):
        return ratio * y**power + (1.0 - y) ** power

    assert (found.max() - found.min()) < 1e-9
    y, base = found[0, 0], front_share(p, DECEL)
    assert cost(y) <= (1.0 + 1.2 * FLAT) * cost(best)
    assert min(best, base) - 0.01 <= y <= max(best, base) + 0.01  # between the least and what is configured


def test_the_hotter_axle_gets_less_where_heat_emits_and_where_the_model_does_not_know() -> None:
    alike = law(4.0, 1.25, 0.4)
    table = new_params(car("suv", "dust", alike, alike))[0]["wanted_share"]
    assert (np.diff(table, axis=0) <= 1e-9).all()
    assert (np.diff(table, axis=1) >= -1e-9).all()
    assert table[0, 8] > 0.8 > 0.3 > table[8, 0]
    blind = law(4.0, 1.25, 0.0, hottest=120.0)
    table = new_params(car("suv", "dust", blind, blind))[0]["wanted_share"]
    cold, hot = int(50 / HEAT_STEP), int(200 / HEAT_STEP)
    assert table[cold, cold] == pytest.approx(front_share(new_params(car("suv", "off"))[0], DECEL), abs=0.02)
    assert table[hot, cold] < 0.2
    assert table[cold, hot] > 0.8


@pytest.mark.parametrize("scale", [0.3, 0.8, 1.0, 1.3, 4.0])
def test_wear_moves_the_share_where_its_laws_are_sure_that_it_saves(scale: float) -> None:
    """By brute force: the least of mass and 2 sigma of what is moved; rear linings wear `scale` as fast."""
    config = car("suv", "wear")
    rear = config.rear.model_copy(update={"pad": config.rear.pad.model_copy(update={"road_scale": scale})})
    p = new_params(config.model_copy(update={"rear": rear}))[0]
    base = front_share(p, DECEL)
    torque = 0.5 * p["mass"] * DECEL * p["wheel_radius"][0]

    def axles(y, front: float, rear: float):
        y = np.atleast_1d(y)
        return np.array([worn_mass(p, 0, torque * y, front), worn_mass(p, 2, torque * (1.0 - y), rear)])

    y = np.linspace(LEAST_EACH, 1.0 - LEAST_EACH, 801)
    for heat in ((50.0, 50.0), (100.0, 50.0), (50.0, 150.0)):
        found = wanted_share(p, np.repeat(heat, 2))
        before = axles(base, *heat)
        doubt = 2.0 * np.linalg.norm(p["wear_sigma"][[0, 2], None] * (axles(y, *heat) - before), axis=0)
        counted = axles(y, *heat).sum(axis=0) + doubt
        assert np.interp(found, y, counted) <= (1.0 + FLAT) * counted.min() * (1.0 + 1e-3)
        moved = axles(found, *heat) - before
        assert (
            moved.sum() <= -2.0 * np.linalg.norm(p["wear_sigma"][[0, 2], None] * moved) + FLAT * before.sum()
        )
    alike = 0.8 <= scale <= 1.3
    assert (abs(wanted_share(p, np.full(4, 50.0)) - base) < 0.01) == alike


@pytest.mark.parametrize("ratio", [0.38, 0.5, 0.8, 1.0, 1.25, 2.0, 2.6])
@pytest.mark.parametrize("power", [1.15, 1.25, 1.4])
def test_no_share_saves_more_than_the_bound_of_the_docs(ratio: float, power: float) -> None:
    """docs/control.md, "What can be saved at most": emission is convex, so it lies above its tangent."""
    p = new_params(car("suv", "dust", law(4.0 + np.log10(ratio), power), law(4.0, power)))[0]
    base, y = front_share(p, DECEL), p["wanted_share"][0, 0]
    before = ratio * base**power + (1.0 - base) ** power
    saved = 1.0 - (ratio * y**power + (1.0 - y) ** power) / before
    share = ratio * base**power / before
    assert -1e-3 <= saved <= power * abs(y - base) * abs(share - base) / (base * (1.0 - base)) + 1e-9


def test_worn_mass_is_table_7_1_by_hand() -> None:
    """1000 N m at 9 m/s and 100 degC, wheel 0.36 m: 0.1016 + 0.3984e-6 1e4 g/MJ, 0.4887 g/MW, 0.66e-2 / K."""
    p = new_params(car("suv", "wear"))[0]
    r = p["wheel_radius"][0]
    power, slowing = 1e-6 * 1000.0 * 9.0 / r, 1e-6 * 1000.0 * DECEL / r
    expected = (0.1016 + 0.3984e-2) * power + 0.4887 * slowing + 0.66 * power**2
    assert worn_mass(p, 0, np.array([1000.0]), 100.0)[0] == pytest.approx(expected)


@pytest.mark.parametrize("name", CARS)
def test_what_is_configured_is_admitted_and_least_rises_no_faster_than_pressure_follows(name: str) -> None:
    p = new_params(car(name, "wear"))[0]
    base = np.array([front_share(p, max(k, 1) * RATE_STEP * G) for k in range(RATE_NODES)])
    assert (p["least_share"] <= base + 1e-9).all()
    assert (p["most_share"] >= base - 1e-9).all()
    assert np.diff(p["least_share"]).max() <= 8.0 * RATE_STEP + 1e-9
    ordered = slice(round(0.15 / RATE_STEP), None)
    assert p["least_share"][ordered] == pytest.approx(base[ordered], abs=0.01)
    assert p["least_share"][: round(0.05 / RATE_STEP)].max() < 0.2  # gentle brakings: the rear alone may do


@pytest.mark.parametrize("name", CARS)
def test_every_share_that_is_admitted_is_within_annex_5_by_moments(name: str) -> None:
    config = car(name, "wear")
    p, vehicle = new_params(config)[0], config.vehicle
    doubt = 2.0 * config.observer.sigma_mu_initial
    frictions = st.floats(1.0 - doubt, 1.0 + doubt)

    def used(share: float, z: float, load, front: float, rear: float) -> tuple[float, float, float]:
        """Return the braking rate and the grip that each axle uses."""
        force = vehicle.mass * G * z
        forces, weight = (force * share * front, force * (1.0 - share) * rear), load.mass * G
        inertia, length = sum(forces), vehicle.wheelbase
        on_front = (weight * (length - load.front_axle) + inertia * load.cog_height) / length
        on_rear = (weight * load.front_axle - inertia * load.cog_height) / length
        return inertia / weight, forces[0] / on_front, forces[1] / max(on_rear, 1e-9)

    @given(st.floats(0.0, 1.0), st.floats(0.005, 0.8), st.sampled_from(vehicle.loads()), frictions, frictions)
    @settings(max_examples=300, deadline=None)
    def holds(wanted: float, z: float, load, front: float, rear: float) -> None:
        share = admitted(p, wanted, z)
        rate, k_front, k_rear = used(share, z, load, 1.0, 1.0)
        if 0.15 <= rate <= 0.8:  # (A) as counted on
            assert k_rear <= k_front + 2e-3
        rate, k_front, k_rear = used(share, z, load, 1.0 - doubt, LEAST_TRAILING * (1.0 + doubt))
        if 0.15 <= rate <= 0.8:  # (A) with the worst linings, taken back
            assert k_rear <= k_front + 2e-3
        for pair in ((front, rear), (1.0 + doubt, 1.0 - doubt), (1.0 - doubt, 1.0 + doubt)):
            rate, k_front, k_rear = used(share, z, load, *pair)
            k = max(k_front, k_rear)
            if 0.2 <= k <= 0.8:  # (B)
                assert rate >= 0.1 + 0.7 * (k - 0.2) - 3e-3

    holds()


@pytest.mark.parametrize(("minimise", "f"), [("off", 0.7), ("wear", 1.0)])
def test_motors_that_may_brake_take_all_they_can(minimise: str, f: float) -> None:
    assert new_params(car("suv-blended", minimise))["blending"][0] == pytest.approx([f] * 4)
    assert new_params(car("suv", minimise))["blending"][0] == pytest.approx([0.0] * 4)


def test_off_leaves_no_tables_behind() -> None:
    p = new_params(car("suv", "off"))[0]
    assert p["minimised"] == 0
    assert p["wanted_share"].shape == (HEAT_NODES, HEAT_NODES)
    assert not p["wanted_share"].any()
    assert not p["most_share"].any()


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ('minimise = "dust"', "needs front.dust and rear.dust; find them by `identify dust`"),
        ('minimise = "noise"', "control.minimise: "),
    ],
)
def test_what_cannot_be_minimised_is_one_line(tmp_path: Path, key: str, said: str) -> None:
    path = tmp_path / "mine.toml"
    text = (CONFIGS / "suv.toml").read_text(encoding="utf-8").replace("[control]\n", f"[control]\n{key}\n")
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UserError) as caught:
        load_config(path)
    assert said in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
