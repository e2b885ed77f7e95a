"""Slip (A.6) and the tyre model against forms that are worked out here."""

import math

import numpy as np
import pytest

from ecu.algorithm.estimation.thesis.tyre import (
    initial_stiffness,
    longitudinal_slip,
    slip_stiffness,
    tyre_force,
)


@pytest.mark.parametrize(
    ("manoeuvre", "rolling", "ground", "slip"),
    [
        ("free rolling", 20.0, 20.0, 0.0),
        ("braked by 2 %: related to the ground", 19.6, 20.0, -0.02),
        ("driven by 2 %: related to the wheel", 20.0, 19.6, 0.02),
        ("locked", 0.0, 20.0, -1.0),
        ("spinning on the spot", 20.0, 0.0, 1.0),
        ("standing", 0.0, 0.0, 0.0),
        ("creeping: not defined", 0.4, 0.5, 0.0),
    ],
)
def test_slip(manoeuvre: str, rolling: float, ground: float, slip: float) -> None:
    assert longitudinal_slip(rolling, ground) == pytest.approx(slip, abs=1e-12), manoeuvre


def test_slip_stiffness_is_the_configured_one_at_static_load_and_grows_less_than_load(params) -> None:
    p = params[0]
    for corner in range(4):
        static = p["static_load"][corner]
        at_static = slip_stiffness(p, corner, static, 0.0)
        assert at_static == pytest.approx(p["slip_stiffness"][corner] * static)
        assert at_static < slip_stiffness(p, corner, 1.5 * static, 0.0) <= 1.5 * at_static
        p["stiffness_degression"][corner] = 0.0  # load proportionality principle (4.35)
        assert slip_stiffness(p, corner, 1.5 * static, 0.0) == pytest.approx(1.5 * at_static)


def magic_formula(load: float, stiffness: float, slip: float) -> float:
    peak, shape = 1.0 * load, 1.6
    return peak * math.sin(shape * math.atan(stiffness * load / (shape * peak) * slip))


def brush(load: float, stiffness: float, slip: float) -> float:
    whole = stiffness * slip / 3.0
    return load * (3 * whole - 3 * whole**2 + whole**3)


@pytest.mark.parametrize("slip", [0.005, 0.01, 0.02, 0.03])
def test_the_secant_lies_between_a_brush_tyre_and_a_magic_formula(params, slip: float) -> None:
    p = params[0]
    load = p["static_load"][0]
    start = slip_stiffness(p, 0, load, 0.0)
    secants = []
    for tyre in (brush, magic_formula):
        force = tyre(load, start / load, slip)
        secants.append((force / slip, slip_stiffness(p, 0, load, -force)))
    (brush_secant, in_brush), (magic_secant, in_magic) = secants
    assert brush_secant < in_brush
    assert in_magic < magic_secant


@pytest.mark.parametrize("corner", [0, 2])
@pytest.mark.parametrize("load", [2000.0, 5000.0, 8000.0])
def test_small_slip_has_the_stiffness_and_the_secant_of_the_linear_tyre(params, corner, load) -> None:
    start = initial_stiffness(params[0], corner, load)
    step = 1e-7
    slope = (tyre_force(start, load, step, 0.0) - tyre_force(start, load, -step, 0.0)) / (2 * step)
    assert slope == pytest.approx(start, rel=1e-5)
    for slip in (-0.03, -0.01, 0.02):
        force = tyre_force(start, load, slip, 0.0)
        assert force / slip == pytest.approx(slip_stiffness(params[0], corner, load, force), rel=1e-9)


@pytest.mark.parametrize(
    ("slip", "adhesion"),
    [(-0.10, -1.112), (-0.17, -1.170), (-0.30, -1.123), (-0.50, -1.020), (-1.0, -0.760), (1.0, 0.760)],
)
def test_large_slip_is_that_of_dry_asphalt(params, slip: float, adhesion: float) -> None:
    """Burckhardt's curve for dry asphalt, read off its table: peak 1.17 at 17 % of slip, locked 0.76."""
    start = initial_stiffness(params[0], 0, 5000.0)
    assert tyre_force(start, 5000.0, slip, 0.0) == pytest.approx(5000.0 * adhesion, rel=2e-3)


def test_force_is_continuous_where_the_curves_meet(params) -> None:
    start = initial_stiffness(params[0], 0, 5000.0)
    force = np.array([tyre_force(start, 5000.0, -s, 0.0) for s in np.arange(0.0, 1.0, 1e-4)])
    assert np.abs(np.diff(force)).max() <= start * 1e-4


@pytest.mark.parametrize("accel_y", [-4.0, 2.0, 4.0])
@pytest.mark.parametrize("slip", [-0.01, -0.02, -0.1, -1.0])
def test_a_tyre_that_corners_holds_less_along(params, slip: float, accel_y: float) -> None:
    """The force of the total slip, in its direction: along and across are the legs of a triangle."""
    load = 5000.0
    start = initial_stiffness(params[0], 0, load)
    across = accel_y / 9.81 * load / start
    both = tyre_force(start, load, math.sqrt(slip**2 + across**2), 0.0)
    along = tyre_force(start, load, slip, accel_y)
    assert along == pytest.approx(both * math.cos(math.atan2(abs(across), abs(slip))) * np.sign(slip))
    assert 0 < along / tyre_force(start, load, slip, 0.0) < 1 or slip < -0.05


def test_it_holds_the_side_force_that_the_slip_across_stands_for(params) -> None:
    """Little braking in a curve of 1 m/s^2: the force across is m a_y but for the curve of the tyre."""
    load = 5000.0
    start = initial_stiffness(params[0], 0, load)
    along = tyre_force(start, load, -1e-4, 1.0)
    across = along / -1e-4 * (load / start / 9.81)
    assert across == pytest.approx(load / 9.81, rel=0.03)
