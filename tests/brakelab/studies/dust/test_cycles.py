"""`bench cycles`: its rows by hand, brakes of a level trip by arithmetic, models that a laboratory finds."""

import numpy as np
import pytest

pytest.importorskip("sklearn", reason="needs scikit-learn (extra learn)")

from brakelab.studies.dust.cycle_cars import SHIPPED, drawn, share_of_energy, with_models
from brakelab.studies.dust.cycle_drives import CYCLES, CycleDrive
from brakelab.studies.dust.cycle_open import OpenDrive, drive_open, profile, wltp_brake_profile
from brakelab.studies.dust.cycles import Drawn, Driven, draw_rows, limit_rows, open_rows, saving_rows
from ecu.contract.dust import FEATURES, LAW_TERMS
from ecu.settings.config import new_params
from ecu.settings.dust import Dust

pytestmark = pytest.mark.study


def driven(particles: float, work: float = 4e6, mass: float = 2e9) -> CycleDrive:
    """Return 100 km with 8 g worn off, of which half stays in the air."""
    every = np.full(4, 0.25)
    return CycleDrive(
        1e5, particles * every, 8.0 * every, work * every, 2e6, 1.6e6,
        np.array([90.0, 95.0, 110.0, 105.0]), -0.01,
        (0.012, 0.008), 0.0, 0.07, mass, 30.0, 1e6 * 0.5 * 8.0 / 1e5,
    )  # fmt: skip


def cars(blended_work: float = 1e6) -> list[Driven]:
    found = []
    for car in SHIPPED:
        blended = car.config != car.plant
        work = blended_work if blended else 4e6
        drives = {
            (cycle, policy): driven(1e12 if policy == "off" else 8e11, work, np.nan)
            for cycle in CYCLES
            for policy in ("off", "dust")
        }
        opened = OpenDrive(np.full(4, 2e11), np.full(4, 2.2), np.full(4, 1e6), np.full(4, 100.0))
        found.append(Driven(car, drives, {} if blended else {"off": opened}))
    return found


def test_a_row_beside_the_limits_has_mass_by_law_and_by_coefficient() -> None:
    rows = {(row[0], row[1]): row[2:] for row in limit_rows(cars())}
    assert rows["suv", "real-driving"] == (
        "40.0", "30.0", "7", "40.0", "10.00", "not known", "0.040", "1.00"
    )  # fmt: skip
    assert rows["lcv", "wltp-brake"][2] == "11"
    assert rows["suv-blended", "wltp-brake"][2:4] == ("3", "6.8")  # 0.17 of 40
    assert rows["suv-blended", "wltp-brake"][-1] == "0.25"


def test_a_row_of_savings_is_against_the_policy_off() -> None:
    rows = {row[:3]: row[3:] for row in saving_rows(cars())}
    assert rows["suv", "real-driving", "off"][0] == "+0.0"
    assert rows["suv", "real-driving", "dust"][:2] == ("+20.0", "+0.0")
    assert rows["suv", "real-driving", "dust"][3] == "95, 110"
    assert rows["suv", "real-driving", "dust"][5:8] == ("2.00", "1.60", "1.2, 0.8")


def test_draws_are_stated_by_median_and_ends() -> None:
    saved = [
        Drawn(
            lots,
            {(w, c, p): 0.01 * lots for w in ("particles", "worn") for c in CYCLES for p in ("dust", "wear")},
        )
        for lots in (0.5, 1.0, 3.0)
    ]
    row = draw_rows({"suv": saved})[0]
    assert row == ("suv", "real-driving", "dust", *["+1.0 (+0.5 to +3.0)"] * 2, "0.50 to 3.00")


def test_open_is_set_beside_closed() -> None:
    rows = open_rows(cars())
    assert [row[0] for row in rows] == ["suv", "sedan", "lcv"]
    assert rows[0][2:5] == ("+0.0", "-20.0", "+10.0")


def law() -> Dust:
    numbers = [4.0, 1.25, *[0.0] * (LAW_TERMS - 1)]
    return Dust(
        model="law",
        numbers=numbers,
        low=[1e-3] * len(FEATURES),
        high=[1e3] * len(FEATURES),
        below=-0.5,
        above=0.5,
    )


def test_the_work_of_a_braking_on_the_level_is_what_resistances_leave_of_the_motion() -> None:
    """20 m/s to 10 m/s within 8 s: m/2 (v1^2 - v2^2) less drag and rolling over that distance."""
    t, v = np.array([0.0, 5.0, 13.0, 20.0]), np.array([20.0, 20.0, 10.0, 10.0])
    car = drawn("suv", 3)
    params = new_params(with_models("suv", (law(), law())))
    done = drive_open(car, params, [(20.0, profile(t, v, np.zeros(4)))])
    metres = 8.0 * 15.0
    drag = float(car["drag_factor"][0]) * metres * 250.0  # mean of v^2 by distance: (v1^2 + v2^2) / 2
    rolling = 9.81 * float(car["rolling_resistance"][0]) * float(params["mass"][0]) * metres
    motion = 0.5 * float(params["mass"][0]) * (20.0**2 - 10.0**2)
    assert done.work.sum() == pytest.approx(motion - drag - rolling, rel=0.03)  # radii
    assert share_of_energy(done.work) == pytest.approx(0.55, abs=0.02)
    assert (done.hottest > 20.0).all()
    assert (done.particles > 0.0).all()


def test_a_trip_of_the_cycle_begins_with_its_disc() -> None:
    trips = wltp_brake_profile()
    assert [begins for begins, _ in trips] == [23.0] + 9 * [40.0]
    assert sum(len(drive) for _, drive in trips) == pytest.approx(158_260, abs=20)
