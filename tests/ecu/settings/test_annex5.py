"""Annex 5 of ECE R13-H: utilisations against moments about the contact patches, who is refused and why."""

from pathlib import Path

import numpy as np
import pytest

from ecu.errors import UserError
from ecu.settings.annex5 import DEMANDED, Load, annex_5_violation, shares, utilisation
from ecu.settings.config import load_config, new_params

G = 9.81
CONFIGS = Path(__file__).parents[3] / "config"
SUV = (CONFIGS / "suv.toml").read_text(encoding="utf-8")
CARS = ["suv", "sedan", "lcv", "mustang"]


@pytest.mark.parametrize("name", CARS)
def test_utilisation_by_moments_about_the_contact_patches(name: str) -> None:
    config = load_config(CONFIGS / f"{name}.toml")
    p, vehicle = new_params(config)[0], config.vehicle
    share = shares(p)
    for load in vehicle.loads():
        for front, rear in ((1.0, 1.0), (0.7, 1.3), (1.3, 0.7)):
            curve = utilisation(p, share, load, front, rear)
            for k in (20, 50, 70):
                forces = vehicle.mass * G * DEMANDED[k] * share[k] * front
                forces = forces, vehicle.mass * G * DEMANDED[k] * (1 - share[k]) * rear
                inertia, weight = sum(forces), load.mass * G
                # About the rear contact: N_f L = P l_r + m a h; the same about the front one.
                rear_axle = vehicle.wheelbase - load.front_axle
                on_front = (weight * rear_axle + inertia * load.cog_height) / vehicle.wheelbase
                on_rear = (weight * load.front_axle - inertia * load.cog_height) / vehicle.wheelbase
                assert curve.z[k] == pytest.approx(inertia / weight)
                assert curve.front[k] == pytest.approx(forces[0] / on_front)
                assert curve.rear[k] == pytest.approx(forces[1] / on_rear)


@pytest.mark.parametrize("name", CARS)
def test_shipped_cars_unladen_use_grip_equally_and_laden_have_the_front_ahead(name: str) -> None:
    config = load_config(CONFIGS / f"{name}.toml")
    p = new_params(config)[0]
    for load, equal in zip(config.vehicle.loads(), (True, False), strict=True):
        curve = utilisation(p, shares(p), load)
        at = {
            z: (np.interp(z, curve.z, curve.front), np.interp(z, curve.z, curve.rear))
            for z in (0.15, 0.5, 0.8)
        }
        print(name, load.name, {z: f"{front:.3f} {rear:.3f}" for z, (front, rear) in at.items()})
        for z, (front, rear) in at.items():
            assert (front == pytest.approx(rear) == pytest.approx(z)) if equal else front > z > rear


def written(tmp_path: Path, control: str = "", **lines: str) -> Path:
    """Write the SUV with more in [control] and with other lines of the same key."""
    text = SUV.replace("[control]", f"[control]\n{control}")
    for key, value in lines.items():
        head, _, rest = text.partition(f"\n{key} = ")
        text = f"{head}\n{key} = {value}\n{rest.partition(chr(10))[2]}"
    path = tmp_path / "car.toml"
    path.write_text(text, encoding="utf-8")
    return path


REFUSED = [
    # case, lines of [control], other lines, what the line says; None: accepted
    ("fixed 0.72", 'distribution = "fixed"\nfront_share = 0.72', {}, None),
    (
        # 0.71 / 0.7148 * 0.8 and 0.29 / 0.2852 * 0.8; the ideal share is 0.520 + 0.244 z
        "fixed 0.71: the rear is ahead from z 0.78 on",
        'distribution = "fixed"\nfront_share = 0.71',
        {},
        "unladen, z = 0.80: f_front 0.795 < f_rear 0.814",
    ),
    (
        # friction x1.3 in front, x0.7 in the rear: f_front is more than (z + 0.04) / 0.7
        "fixed 0.93: the rear hardly brakes",
        'distribution = "fixed"\nfront_share = 0.93',
        {},
        "3.1 B",
    ),
    ("electronic 0.65", 'distribution = "electronic"\nfront_share = 0.65', {}, None),
    ("electronic 0.30: ideal throughout", 'distribution = "electronic"\nfront_share = 0.30', {}, None),
    (
        "laden with a high and forward load: the ideal share of the empty car is too small",
        "",
        {"laden_front_axle": "1.20", "laden_cog_height": "1.00"},
        "laden, z = 0.79: f_front 0.710 < f_rear 1.255",
    ),
    (
        "friction known to 35 %",
        "[observer]\nsigma_mu_initial = 0.35\n[control]",
        {},
        "unladen, friction 2 sigma off",
    ),
]


@pytest.mark.parametrize(("case", "control", "lines", "said"), REFUSED, ids=[row[0] for row in REFUSED])
def test_a_distribution_that_violates_annex_5_is_refused(tmp_path, case, control, lines, said) -> None:
    path = written(tmp_path, control, **lines).resolve()
    if control.startswith("[observer]"):
        path.write_text(path.read_text().replace("[control]\n[observer]", "[observer]"), encoding="utf-8")
    if said is None:
        load_config(path)
        return
    with pytest.raises(UserError) as caught:
        load_config(path)
    line = str(caught.value)
    print(line)
    assert line.startswith(f"{path}: control.distribution: ")
    assert said in line
    assert "\n" not in line
    assert "ECE R13-H Annex 5" in line


def test_the_first_violation_is_where_arithmetic_puts_it() -> None:
    """A front share of 0.65 is ideal at z = 0.534 and violates from there to 0.8, laden or not."""
    config = load_config(CONFIGS / "suv.toml")
    params = new_params(config)
    params["distribution"], params["front_share"] = 1, 0.65
    curve = utilisation(params[0], shares(params[0]), config.vehicle.loads()[0])
    ahead = curve.z[(curve.rear > curve.front) & (curve.z < 0.8)]
    assert ahead.min() == pytest.approx(0.54)
    assert "f_rear" in str(annex_5_violation(params[0], config.vehicle.loads()))
    heavy_behind = Load("loaded boot", 2400.0, 1.55, 0.65)
    assert annex_5_violation(params[0], (heavy_behind,)) is None
