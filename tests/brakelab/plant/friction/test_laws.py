"""Each friction law against its equations, written again and integrated by scipy; limits, tables, edges."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from brakelab.plant.description import Plant, PlantFileError, load_plant
from brakelab.plant.dynamometer import PRESSURE, STEP, new_stop, run_stop
from brakelab.plant.friction import ostermeyer_revised
from brakelab.plant.friction.constant import Constant
from brakelab.plant.friction.law import ROW, Law, RigBrake, linear_step
from brakelab.plant.friction.laws import LAWS, friction, law_row
from brakelab.plant.friction.network import WEIGHTS, Network
from brakelab.plant.friction.own import Own
from brakelab.plant.friction.quadratic import Quadratic
from brakelab.plant.friction.static_lugre import StaticLugre
from brakelab.plant.friction.table import Table
from brakelab.plant.linings import Lining, rig_with

CONFIG = Path(__file__).parents[4] / "config" / "plant"
BRAKE_A = RigBrake(piston_area=2.827e-3, pad_area=7.125e-3, effective_radius=0.1459, tyre_radius=0.36)
TABLE = Table(
    law="table",
    rig_mass=1000.0,
    temperature=(20.0, 50.0, 100.0, 200.0, 300.0, 400.0),
    pressure=(10.0, 40.0, 90.0),
    mu=(
        (0.30, 0.32, 0.36, 0.40, 0.35, 0.30),
        (0.33, 0.35, 0.40, 0.43, 0.38, 0.33),
        (0.36, 0.38, 0.42, 0.45, 0.40, 0.35),
    ),
)
CONSTANT = Constant(law="constant", rig_mass=1000.0, mu=0.42)
QUADRATIC = Quadratic(
    law="quadratic",
    rig_mass=1000.0,
    speed=(2.0, 12.0),
    pressure=(10.0, 90.0),
    factors=(0.4, -0.03, 0.05, 0.02, -0.01, -0.04),
)
LUGRE = StaticLugre(
    law="static_lugre",
    rig_mass=1000.0,
    coulomb=0.36,
    static=0.44,
    stribeck=3.0,
    viscous=-0.002,
    highest_speed=15.0,
)
NETWORK = Network(
    law="network",
    rig_mass=1000.0,
    low=(1.0, 5e5, 40.0),
    high=(15.0, 90e5, 300.0),
    middle=(7.0, 40e5, 150.0, 0.42),
    scale=(4.0, 20e5, 60.0, 0.03),
    weights=tuple(np.random.default_rng(5).standard_normal(WEIGHTS)),
)

Rate = Callable[[float, float, float, float, float], tuple[float, float]]
"""(memory, pressure, sliding speed, slowing per mu, temperature) -> (d memory/dt, mu)."""


def equations(name: str, lining: Lining) -> Rate:
    """Return the law's equations as the thesis (corrected) has them, from the file's numbers."""
    law = lining.friction[name].model_dump()
    area, pad = lining.brake.piston_area, lining.brake.pad_area

    def ilvo(x: float, p: float, v: float, slowing: float, tau: float) -> tuple[float, float]:
        kelvin = tau + 273.15
        mu = (law["kappa_0"] + law["kappa_1"] * kelvin) * x
        sigma = p * area / pad if law["stress"] == "pad" else p
        heat = law["heat_loss"] * sigma * (kelvin - law["heat_zero"])
        return law["speed_gain"] * mu * sigma * v + law["debris"] * slowing * mu - heat, mu

    def bounded(x: float, p: float, v: float, slowing: float, tau: float) -> tuple[float, float]:
        mu = x * float(np.interp(tau, law["temperature"], law["kappa"]))
        grow = law["debris"] * slowing * mu - law["speed_loss"] * p * v * mu
        grow -= p * law["heat_loss"] * (tau - 20.0) * x
        return grow, mu

    def ostermeyer(x: float, p: float, v: float, slowing: float, tau: float) -> tuple[float, float]:
        first, second, third = (
            np.dot(law[key], (1.0, p, v)) if isinstance(law[key], tuple) else law[key]
            for key in ("p_1", "p_2", "p_3")
        )
        return -first * ((p * area * v + second) * x - third * (tau + 273.15)), x

    def surface(x: float, p: float, v: float, slowing: float, tau: float) -> tuple[float, float]:
        exponents = np.mean(law["pressure"]), np.mean(law["speed"])
        curves = (max(p, 5e5) / 30e5) ** exponents[0] * (v / 5.0) ** exponents[1]
        heat = 1.0 - np.mean(law["fall"]) * ((tau - np.mean(law["best"])) / 100.0) ** 2
        mu = law["mu"] * curves * heat * (1.0 + np.mean(law["bite"]) * x)
        return (1.0 - x) * v / np.mean(law["way"]), mu

    return {"ilvo_bounded": bounded, "ilvo": ilvo, "surface": surface}.get(law["law"], ostermeyer)


@pytest.mark.parametrize("brake", ["A", "B", "C"])
@pytest.mark.parametrize("name", ["SIM", "R1", "R2", "printed", "Ost", "Ost_revised", "surface"])
def test_a_stop_is_the_solution_of_the_laws_equations(suv: Plant, brake: str, name: str) -> None:
    lining = suv.linings.lining[brake]
    rate, rig = equations(name, lining), rig_with(lining, name)
    geometry, disc = lining.brake, lining.disc
    inertia = lining.friction[name].rig_mass * geometry.tyre_radius**2
    lever = 2.0 * geometry.piston_area * geometry.effective_radius

    def right_side(t: float, y: NDArray[np.float64]) -> tuple[float, float, float]:
        omega, tau, x = y
        p = 30e5 * min(t / 0.15, 1.0)
        grow, mu = rate(x, p, geometry.effective_radius * omega, lever * p / inertia, tau)
        torque = lever * mu * p
        cooling = disc.cooling + disc.cooling_by_speed * omega * geometry.tyre_radius
        return -torque / inertia, disc.heating * torque * omega - cooling * (tau - 20.0), grow

    start = 100.0 / 3.6
    trace = run_stop(rig, new_stop(PRESSURE, start, 60.0 / 3.6, 100.0, pressure=30e5))
    memory = float(rig[0]["row"][0])
    solution = solve_ivp(
        right_side,
        (0.0, trace["t"][-1] + STEP),
        (start / geometry.tyre_radius, 100.0, memory),
        t_eval=np.append(trace["t"], trace["t"][-1] + STEP),
        rtol=1e-8,
        atol=1e-10,
        method="LSODA",
        max_step=0.05,
    )
    omega, tau = solution.y[:2, :-1]
    x = solution.y[2, 1:]  # the trace has the memory after the step
    print(brake, name, trace["mu_b"][-1])
    assert trace["speed"] == pytest.approx(omega * geometry.tyre_radius, rel=1e-3)
    assert trace["temperature"] == pytest.approx(tau, rel=1e-3)
    assert trace["memory"] == pytest.approx(x, rel=3e-3)


@pytest.mark.parametrize("brake", ["A", "B", "C"])
@pytest.mark.parametrize(("temperature", "as_at"), [(200.0, 200.0), (350.0, 350.0), (550.0, 350.0)])
def test_revised_ostermeyer_does_not_go_on_beyond_its_hottest_measurement(
    suv: Plant, brake: str, temperature: float, as_at: float
) -> None:
    lining = suv.linings.lining[brake]
    law = lining.friction["Ost_revised"].model_dump()
    row = np.array(lining.friction["Ost_revised"].row(lining.brake))
    pressure, speed = 30e5, 5.0
    first, second, third = (np.dot(law[key], (1.0, pressure, speed)) for key in ("p_1", "p_2", "p_3"))
    settled = third * (as_at + 273.15) / (pressure * lining.brake.piston_area * speed + second)
    _, mu = ostermeyer_revised.step(row, settled, pressure, speed, 0.0, temperature, 1.0 / first)
    assert mu == pytest.approx(settled, rel=1e-9)


@settings(max_examples=200, deadline=None)
@given(
    brake=st.sampled_from("ABC"),
    name=st.sampled_from(["SIM", "R1", "R2", "printed", "Ost", "Ost_revised", "surface"]),
    pressure=st.floats(0.0, 180e5),
    speed=st.floats(0.0, 40.0),
    slowing=st.floats(0.0, 80.0),
    temperature=st.floats(-40.0, 800.0),
    dt=st.sampled_from([0.0, 1e-4, 1e-3, 1e-2]),
)
def test_friction_is_finite_and_not_negative(
    suv: Plant,
    brake: str,
    name: str,
    pressure: float,
    speed: float,
    slowing: float,
    temperature: float,
    dt: float,
) -> None:
    rig = rig_with(suv.linings.lining[brake], name)[0]
    memory = float(rig["row"][0])
    for _ in range(200):
        memory, mu = friction(rig["law"], rig["row"], memory, pressure, speed, slowing, temperature, dt)
    assert math.isfinite(mu)
    assert mu >= 0.0
    if name == "SIM":
        assert 0.85 <= memory <= 1.20
        assert 0.2 < mu < 0.6


@pytest.mark.parametrize(
    ("name", "temperature", "speed", "vanishes"),
    [("R1", 220.0, 130.0, True), ("R2", 300.0, 130.0, True), ("SIM", 300.0, 130.0, False)],
)
def test_only_the_bounded_law_keeps_brake_a_when_it_is_hot(
    suv: Plant, name: str, temperature: float, speed: float, vanishes: bool
) -> None:
    rig = rig_with(suv.linings.lining["A"], name)
    rig["cooling_by_speed"] *= 10.0
    trace = run_stop(
        rig, new_stop(PRESSURE, speed / 3.6, 5.0 / 3.6, temperature, pressure=30e5), longest=60.0
    )
    assert (trace["memory"].min() < 0.05) == vanishes


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ('law = "ilvo_bounded"', 'law = "guess"', "lining.A.friction.SIM"),
        ("rig_mass = 1084.0", "", "lining.A.friction.R1.ilvo.rig_mass"),
        ('stress = "pad"', 'stress = "disc"', "lining.A.friction.R1.ilvo.stress"),
        ("[lining.A.friction.SIM]", "[lining.A.friction.MINE]", "brake_front.friction"),
    ],
)
def test_a_mistake_in_a_lining_file_is_one_line(tmp_path: Path, old: str, new: str, place: str) -> None:
    for name in ("suv.toml", "linings.toml"):
        text = (CONFIG / name).read_text()
        (tmp_path / name).write_text(text.replace(old, new, 1) if name == "linings.toml" else text)
    with pytest.raises(PlantFileError) as caught:
        load_plant(tmp_path / "suv.toml")
    assert caught.value.place == place
    assert "\n" not in str(caught.value)


def at(law: Law, speed: float, bar: float, temperature: float) -> float:
    number, row = law_row(law, BRAKE_A)
    memory, mu = friction(number, row, 0.7, 1e5 * bar, speed, 3.0, temperature, 1e-3)
    assert memory == 0.7
    return mu


@pytest.mark.parametrize(
    ("speed", "bar", "expected"),
    [
        (7.0, 50.0, 0.4),  # the middle of both
        (12.0, 50.0, 0.4 - 0.03 + 0.02),
        (7.0, 90.0, 0.4 + 0.05 - 0.04),
        (2.0, 10.0, 0.4 + 0.03 - 0.05 + 0.02 - 0.01 - 0.04),
        (1.0, 5.0, 0.4 + 0.03 - 0.05 + 0.02 - 0.01 - 0.04),  # held at the edge
        (30.0, 120.0, 0.4 - 0.03 + 0.05 + 0.02 - 0.01 - 0.04),
        (9.5, 50.0, 0.4 - 0.015 + 0.005),
    ],
)
def test_a_quadratic_surface_by_hand(speed: float, bar: float, expected: float) -> None:
    assert at(QUADRATIC, speed, bar, 100.0) == at(QUADRATIC, speed, bar, 400.0) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("speed", "expected"),
    [(0.0, 0.44), (3.0, 0.36 + 0.08 / math.e - 0.006), (15.0, 0.33), (40.0, 0.33)],
)
def test_static_lugre_by_hand(speed: float, expected: float) -> None:
    assert at(LUGRE, speed, 10.0, 20.0) == at(LUGRE, speed, 90.0, 300.0) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (NETWORK.model_dump() | {"weights": (0.1,) * 92}, "at least 93 items"),
        (NETWORK.model_dump() | {"scale": (1.0, 1.0, 0.0, 1.0)}, "scales above zero"),
        (NETWORK.model_dump() | {"low": (16.0, 5e5, 40.0)}, "low below high"),
        (QUADRATIC.model_dump() | {"speed": (12.0, 2.0)}, "give the lower bound first"),
    ],
)
def test_a_law_without_memory_that_is_none_is_refused(change: dict[str, object], line: str) -> None:
    with pytest.raises(ValueError, match=line):
        (Network if change["law"] == "network" else Quadratic).model_validate(change)


def test_constant_friction_depends_on_nothing() -> None:
    number, row = law_row(CONSTANT, BRAKE_A)
    found = {
        friction(number, np.array(row), 1.0, p, v, 3.0, tau, 1e-3)
        for p in (0.0, 9e6)
        for v in (0.0, 30.0)
        for tau in (-20.0, 500.0)
    }
    assert found == {(1.0, 0.42)}


def test_every_law_has_its_number_and_its_row(suv: Plant) -> None:
    entries = [*suv.linings.lining["A"].friction.values(), TABLE, CONSTANT, QUADRATIC, LUGRE, NETWORK]
    assert {type(entry) for entry in entries} == set(LAWS) - {Own}
    for entry in entries:
        number, row = law_row(entry, BRAKE_A)
        assert LAWS[number] is type(entry)
        assert len(row) == ROW


@pytest.mark.parametrize("rate", [-2000.0, -200.0, -3.0, 0.0, 0.5])
def test_the_linear_step_follows_the_exponential(rate: float) -> None:
    value, dt = 1.0, 1e-4
    for _ in range(1000):
        value = linear_step(value, rate, 7.0, dt)
    steady = -7.0 / rate if rate else 0.0
    expected = steady + (1.0 - steady) * math.exp(0.1 * rate) if rate else 1.7
    assert value == pytest.approx(expected, rel=1e-4)
