"""Brakings found in made-up signals, and what a configured car expects of them."""

import numpy as np
import pytest

from .brakings import PERIOD, find, lining_decel, read, rest_decel
from .config import Nominal
from .route import G, Values

NOMINAL = Nominal(
    mass=1200.0, wheelbase=2.6, front_axle=1.3, cog_height=0.5, track=1.6, drag_coefficient=0.4,
    frontal_area=2.0, rolling_resistance=0.01, pitch_gradient=0.002, unloaded_radius=(0.3, 0.3),
    vertical_stiffness=1e12,
    wheel_inertia=1.2, slip_stiffness=24.0, pistons=2, piston_diameter=(0.04, 0.03), effective_radius=0.13,
    mu_nominal=(0.4, 0.5), push_out_pressure=0.5, disc_heating=(2e-4, 2e-4), sensors={}, electric=False,
)  # fmt: skip


def signals(pressure: Values, **others: float) -> dict[str, Values]:
    """Signals at 100 Hz: a pressure on all wheels beside constants."""
    count = len(pressure)
    constant = {"vehicle_speed": 30.0, "accel_x": -4.0, "accel_y": 0.0} | others
    columns = {name: np.full(count, value) for name, value in constant.items()}
    columns |= {f"calliper_pressure_{corner}": pressure + 0.7 for corner in ("fl", "fr", "rl", "rr")}
    columns["accelerator_position"] = np.where(pressure > 0.0, 0.0, 50.0)
    return columns | {"t": 5.0 + PERIOD * np.arange(count)}


def pulse(rows: int = 200, bar: float = 20.0) -> Values:
    pressure = np.zeros(1000)
    pressure[300 : 300 + rows] = bar
    return pressure


@pytest.mark.parametrize(
    ("pressure", "others", "found"),
    [
        (pulse(), {}, 1),
        (pulse(8), {}, 0),  # shorter than 0.1 s
        (pulse(30), {}, 0),  # too short to judge
        (pulse(bar=0.8), {}, 0),  # below 1 bar
        (pulse(), {"vehicle_speed": 4.0}, 0),
        (pulse(), {"accel_y": 5.0}, 0),
        (pulse() * (np.arange(1000) != 400), {}, 1),  # let go for one row
        (pulse() * ((np.arange(1000) < 380) | (np.arange(1000) > 400)), {}, 2),  # for 0.2 s
    ],
)
def test_brakings_are_found(pressure: Values, others: dict[str, float], found: int) -> None:
    brakings = find(read(signals(pressure, **others), NOMINAL), NOMINAL)
    assert len(brakings) == found
    if found:
        assert brakings[0].start == 300


def test_a_braking_has_what_was_measured_and_what_was_expected() -> None:
    """By hand: 2 A r mu (p - p_0) of four wheels over radius and mass, wheels' inertia included."""
    (braking,) = find(read(signals(pulse()), NOMINAL), NOMINAL)
    assert braking.measured == pytest.approx(4.0 / (1.0 + G * 0.002))
    heavy = 1200.0 + 4 * 1.2 / 0.3**2
    area = 2 * np.pi / 4 * np.array([0.04, 0.03]) ** 2
    torque = 2 * np.sum(2 * area * 0.13 * np.array([0.4, 0.5]) * 19.5e5)
    assert braking.lining == pytest.approx(np.full(len(braking.rows), torque / 0.3 / heavy), rel=1e-4)
    drag = 0.6 * 0.4 * 2.0 * 30.0**2 + 0.01 * 1200.0 * G
    assert braking.rest == pytest.approx(drag / heavy, rel=1e-4)


@pytest.mark.parametrize(("electric", "adds"), [(True, True), (False, False)])
def test_a_motor_is_believed_and_an_engine_is_not(electric: bool, adds: bool) -> None:
    nominal = NOMINAL._replace(electric=electric)
    plain, reported = (
        find(read(signals(pulse(), **torque), nominal), nominal)[0].rest
        for torque in ({}, {"motor_torque_rl": 300.0})
    )
    assert reported - plain == pytest.approx(
        300.0 / 0.3 / (1200.0 + 4 * 1.2 / 0.09) * adds, rel=1e-3, abs=1e-9
    )


def test_other_frictions_and_masses_scale_as_they_should() -> None:
    known = read(signals(pulse()), NOMINAL)
    rows = np.arange(350, 400)
    mu = np.repeat(NOMINAL.mu_nominal, 2)
    once = lining_decel(known, rows, NOMINAL, mu, 1200.0)
    assert lining_decel(known, rows, NOMINAL, 2 * mu, 1200.0) == pytest.approx(2 * once)
    heavier = lining_decel(known, rows, NOMINAL, mu, 1200.0 + (1200.0 + NOMINAL.inertia))
    assert heavier == pytest.approx(once / 2)
    assert rest_decel(known, rows, NOMINAL, 1e9) == pytest.approx(0.01 * G, rel=1e-3)


def test_samples_are_joined_but_not_across_a_gap() -> None:
    columns = signals(pulse())
    columns["accel_x"][np.arange(1000) % 20 != 0] = np.nan
    assert not np.any(np.isnan(read(columns, NOMINAL).decel[:-30]))
    columns["accel_x"][350:450] = np.nan
    lost = read(columns, NOMINAL)
    assert np.all(np.isnan(lost.decel[350:440]))
    assert len(find(lost, NOMINAL)[0].rows) < 120
