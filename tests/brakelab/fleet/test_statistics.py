"""What a fleet's drives say together, on fleets that are small enough to reckon by hand."""

from typing import Any

import numpy as np

from brakelab.fleet.statistics import by_week, notes, outliers, per_vehicle

MONDAY_NS = 1_767_571_200_000_000_000  # 5 January 2026, 00:00 UTC
DAY_NS = 86_400_000_000_000


def drive(vehicle: str, mu_b: float | None = 0.4, **more: Any) -> dict[str, Any]:
    row: dict[str, Any] = dict.fromkeys(("mu_b_rear", "prediction_bias", "start_time"))
    row |= {"vehicle": vehicle, "drive": "1.log", "logs": "/d/1.log", "notes": "", "config_hash": "suv"}
    return row | {"mu_b_front": mu_b, "brake_energy": 500e3, "distance": 1000.0} | more


def test_a_vehicle_is_the_median_of_its_drives() -> None:
    vehicles = per_vehicle([drive("a", 0.3), drive("b", None), drive("a", 0.4), drive("a", 0.8)])
    assert vehicles.names == ["a", "b"]
    assert list(vehicles.drives) == [3, 1]
    np.testing.assert_array_equal(vehicles.values["mu_b_front"], [0.4, np.nan])
    np.testing.assert_array_equal(vehicles.values["energy_per_distance"], [500.0, 500.0])  # J/m = kJ/km


def test_the_farthest_stand_out_first_and_only_against_their_own_kind() -> None:
    usual = [0.38, 0.39, 0.40, 0.41, 0.42]
    fleet = [drive(f"suv-{k}", mu_b) for k, mu_b in enumerate(usual)]
    fleet += [drive("low", 0.28), drive("high", 0.55)]
    fleet += [drive(f"lcv-{k}", mu_b + 0.2, config_hash="lcv") for k, mu_b in enumerate(usual)]
    fleet += [drive(f"rare-{k}", 0.1 + k, config_hash="rare") for k in range(4)]
    # SUVs: median 0.40, distances 0.02 0.01 0 0.01 0.02 0.12 0.15, whose median is 0.02.
    found = outliers(per_vehicle(fleet))
    assert [one.vehicle for one in found] == ["high", "low"]
    np.testing.assert_allclose([one.score for one in found], [0.15 / 0.029652, -0.12 / 0.029652], rtol=1e-9)
    assert (found[0].value, found[0].usual, found[0].quantity.name) == (0.55, 0.40, "mu_b_front")


def test_weeks_begin_on_monday() -> None:
    starts = {0.0: 0.30, 6.9: 0.40, 7.0: 0.50, 20.9: 0.60}
    fleet = [drive("a", mu_b, start_time=MONDAY_NS + int(day * DAY_NS)) for day, mu_b in starts.items()]
    weeks = by_week([*fleet, drive("a", 9.9)], "mu_b_front")
    np.testing.assert_array_equal(weeks.start_ms, (MONDAY_NS + np.array([0, 7, 14]) * DAY_NS) / 1e6)
    np.testing.assert_array_equal(weeks.drives, [2, 1, 1])
    np.testing.assert_allclose(weeks.quantiles[:, 2], [0.35, 0.50, 0.60])


def test_what_most_drives_of_a_vehicle_have_is_no_news() -> None:
    fleet = [drive("a", notes="/d/1.log: never received: X") for _ in range(3)]
    fleet[1]["notes"] += "\n/d/1.log: 7 CRC errors"
    assert [note.lines for note in notes(fleet)] == [["7 CRC errors"]]
