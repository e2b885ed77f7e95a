"""Who needs pads when: order, bands and what is not known, on a fleet small enough to reckon by hand."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brakelab.fleet.manifest import find_drives
from brakelab.fleet.page import write_page
from brakelab.fleet.wear import pads_due, pads_table, register_pads
from brakelab.results.pads import PadState, packed
from ecu.algorithm.step import new_state
from ecu.contract.signals import CORNERS
from ecu.errors import UserError
from ecu.settings.config import load_config, new_params
from ecu.settings.resources import resource

SUV = load_config(resource("config/suv.toml"))
NAN = float("nan")


def drive(vehicle: str, name: str, remaining: tuple[float, ...], **more: Any) -> dict[str, Any]:
    """A drive after which the corners have 9 mm, and so many km to 3 mm, ± 20 %."""
    pads = [
        PadState(c, 9.0, 0.1, 50.0, 1e4, far, 0.8 * far, 1.2 * far, 1.0, 1, True, 12.0, 3.0, True, False)
        for c, far in zip(CORNERS, remaining, strict=True)
    ]
    row: dict[str, Any] = dict.fromkeys(
        ("mu_b_front", "mu_b_rear", "prediction_error", "prediction_bias", "start_time")
    )
    row |= {"vehicle": vehicle, "drive": name, "logs": name, "notes": "", "fault": "", "config_hash": "suv",
            "brake_energy": 5e5, "degraded": 0.0, "distance": 1e3, "duration": 60.0,
            "brakings": 4, "learned": 4,
            "pads": packed(pads), "particle_mass_per_km": 5.0, "particles_per_km": None}  # fmt: skip
    return row | more


FLEET = [
    drive("slow", "1", (9e4, 9e4, 8e4, 9e4)),
    drive("hasty", "1", (5e4, 5e4, 9e4, 9e4)),
    drive("new", "1", (NAN,) * 4, particle_mass_per_km=None),
    drive("hasty", "2", (2.1e4, 2e4, 9e4, 9e4), particle_mass_per_km=11.2, particles_per_km=4e9),
    drive("silent", "1", (1e3,) * 4, pads=[]),
]


def test_the_pads_that_are_worn_first_are_the_first():
    due = pads_due(FLEET)
    assert [(each.vehicle, each.pad.corner) for each in due] == [
        ("hasty", "fr"), ("slow", "rl"), ("new", "fl"),
    ]  # fmt: skip
    assert due[0].per_distance == pytest.approx(1e3 * 6.0 / 2e4)
    np.testing.assert_array_equal([each.particles for each in due], [4e9, NAN, NAN])


def test_the_table_has_all_corners_after_the_last_drive():
    table = pads_table(FLEET)
    assert table.column("vehicle").to_pylist() == ["slow"] * 4 + ["hasty"] * 4 + ["new"] * 4
    assert table.column("drive").to_pylist()[4] == "2"
    assert table.column("remaining").to_pylist()[4:9] == [2.1e4, 2e4, 9e4, 9e4, None]
    assert table.schema.field("thickness").metadata == {b"unit": b"mm"}


def test_the_page_has_the_order_and_the_next_one(tmp_path: Path):
    write_page(FLEET, tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text("utf-8")
    section = page[page.index("Who needs pads when") :].partition("</section>")[0]
    assert section.index(">hasty<") < section.index(">slow<") < section.index(">new<")
    assert "16000 to 24000" in section
    assert "<td>11.2</td>" in section
    assert "nan" not in section
    assert "Next pads in" in page


def test_a_fleet_that_states_no_pads_has_no_such_section(tmp_path: Path):
    write_page([FLEET[-1]], tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text("utf-8")
    assert "Who needs pads when" not in page
    assert "Next pads in" not in page


def test_new_and_measured_pads_go_into_what_a_vehicle_knows():
    learned = new_state(new_params(SUV))["learned"].copy()
    register_pads(learned, SUV, "front", "car-7")
    register_pads(learned, SUV, "fl=9.8,rr=8.0", "car-7")
    wear = learned[0]["wear"]
    assert wear["told"].tolist() == [1, 1, 0, 0]
    assert wear["measurements"].tolist() == [1, 0, 0, 1]
    assert wear["measured_wear"][0].tolist() == pytest.approx([2.2, 0.0, 0.0, 4.0])
    with pytest.raises(UserError, match=r"^car-7: pads fl=11: thicker than the 9.80 mm.*pads front first"):
        register_pads(learned, SUV, "fl=11", "car-7")


WRONG = ["old", "fl", "fl=thin", "xy=9.8"]


@pytest.mark.parametrize("text", WRONG)
def test_pads_of_a_manifest_are_checked_before_anything_runs(tmp_path: Path, text: str):
    manifest = tmp_path / "fleet.csv"
    manifest.write_text(f"vehicle,log,pads\ncar-7,1.log,new\ncar-7,2.log,fl=9.8;fr=9.7\ncar-7,3.log,{text}\n")
    with pytest.raises(UserError, match=r"fleet.csv: line 4, pads: .* is none of new, front, rear"):
        find_drives([str(manifest)], Path("suv.toml"), None, tmp_path / "out")
    manifest.write_text(manifest.read_text().rpartition("car-7")[0])
    drives = find_drives([str(manifest)], Path("suv.toml"), None, tmp_path / "out")
    assert [each.pads for each in drives] == ["new", "fl=9.8,fr=9.7"]
