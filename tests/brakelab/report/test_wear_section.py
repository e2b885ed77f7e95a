"""Wear and dust on the report: what a made-up drive wore, per road and braking, and what it cannot tell."""

import html
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from brakelab.report.command import report
from brakelab.report.drive import read_drive
from brakelab.report.wear_section import wear_section
from brakelab.results.files import brakes_path
from brakelab.results.pads import PadState, packed
from ecu.contract.signals import CORNERS
from ecu.errors import UserError

from .conftest import write

pytestmark = pytest.mark.study

DT, TOWN, MOTORWAY = 0.1, 36.0 / 3.6, 108.0 / 3.6  # s, m/s
HALF = 1000.0  # s in town, as many on the motorway
STOPS = tuple(50.0 + 100.0 * k for k in range(20))
MODEL_GRAMS = {"town": 0.02, "motorway": 0.05}  # a braking and front calliper
PAD_MASS = 36.0  # g/mm of both pads
NAN = float("nan")


AIRBORNE = {"particle_mass": 500.0, "particle_mass_low": 20.0, "particle_mass_high": 700.0}
"""mg/g, as CONFIG has it where nobody measured."""


def pad(corner: str, **changes: Any) -> PadState:
    known = PadState(
        corner, 10.5, 0.2, 54.0, 20000.0, 80000.0, 60000.0, 101000.0, 1.1, 2, True, 12.0, 3.0, True, True
    )
    return known._replace(**changes)


def made_up(folder: Path, change: dict[str, Any] | None = None, pads: list[PadState] | None = None) -> Path:
    """Write 10 km of town and 30 km of motorway with ten brakings each, with the columns of `change`."""
    t = np.arange(0.0, 2 * HALF, DT)
    speed = np.where(t < HALF, TOWN, MOTORWAY)
    columns: dict[str, Any] = {"t": t, "vehicle_speed": speed, "braking": np.zeros_like(t)}
    lost, particles = np.zeros_like(t), np.full_like(t, NAN)
    rows: dict[str, list[Any]] = {}
    for k, start in enumerate(STOPS):
        road = "town" if start < HALF else "motorway"
        columns["braking"][(t >= start) & (t < start + 4.0)] = 1.0
        lost[t >= start + 4.0] += MODEL_GRAMS[road] / PAD_MASS
        particles[t >= start + 4.0] = 1e9 * (k + 1)
        for corner in CORNERS:
            front = corner.startswith("f")
            row = {
                "brake": k, "corner": corner, "t_start": start, "duration": 4.0,
                "v_in": TOWN if road == "town" else MOTORWAY, "v_end": 5.0, "decel_mean": 2.0,
                "decel_predicted": 2.0, "mu_b_mean": 0.4, "brake_energy": 1e5, "disc_temperature_in": 80.0,
                "disc_temperature_mean": 100.0 + k, "pad_wear_mass": MODEL_GRAMS[road] if front else 0.0,
                **{name: share * MODEL_GRAMS[road] * front for name, share in AIRBORNE.items()},
                "emission_factor": 9.0 if front else NAN, "emission_factor_low": 8.5 if front else NAN,
                "emission_factor_high": 9.4 if front else NAN,
            }  # fmt: skip
            for name, value in row.items():
                rows.setdefault(name, []).append(value)
    for corner in CORNERS:
        front = corner.startswith("f")
        columns[f"mu_b_{corner}"], columns[f"sigma_mu_b_{corner}"] = (
            np.full_like(t, 0.4),
            np.full_like(t, 0.01),
        )
        columns[f"pad_wear_{corner}"] = 1.5 + lost * front
        columns[f"sigma_pad_wear_{corner}"] = np.full_like(t, 0.2)
        columns[f"brake_torque_{corner}"] = 300.0 * columns["braking"]
        columns[f"motor_torque_{corner}"] = 100.0 * columns["braking"]
        columns[f"disc_temperature_{corner}"] = np.full_like(t, 90.0)
        columns[f"calliper_pressure_{corner}"] = 20.0 * columns["braking"]
    columns |= {"particles_last_brake": particles, "particles_last_brake_low": 0.4 * particles,
                "particles_last_brake_high": 2.0 * particles, "particles_per_km": np.full_like(t, 3e9),
                "particle_mass_per_km": np.full_like(t, 6.5)}  # fmt: skip
    for name, values in (change or {}).items():
        columns[name] = np.full_like(t, values) if np.isscalar(values) else values
    own = [pad(corner) for corner in CORNERS] if pads is None else pads
    result = write(folder / "drive.parquet", columns, {"pads": json.dumps(packed(own))})
    write(brakes_path(result), rows)
    return result


def page_of(result: Path) -> str:
    out = result.with_name("report.html")
    report(result, None, out)
    page = re.sub(r"<(script|style).*?</\1>", "", out.read_text("utf-8"), flags=re.DOTALL)
    section = page[page.index("<h2>Wear and dust") :].partition("</section>")[0]
    return html.unescape(re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", section)))


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> str:
    return page_of(made_up(tmp_path_factory.mktemp("wear")))


# Ten brakings of 20 mg over 10 km in town: 0.2 g / 36 g/mm / 10 km = 0.556 mm per 1,000 km. A minute before
# the motorway begins the road counts as motorway: 0.6 km of town, in which the braking at 950 s is.
TOWN_KM, MOTORWAY_KM = 9.4, 30.6
TOWN_WEAR = 1e3 * 9 * 0.02 / PAD_MASS / TOWN_KM
MOTORWAY_WEAR = 1e3 * (10 * 0.05 + 0.02) / PAD_MASS / MOTORWAY_KM
TOWN_MG = 9 * 2 * 500 * 0.02 / TOWN_KM


@pytest.mark.parametrize(
    "text",
    [
        "fl 10.50 ± 0.39 54.0 20000 80000 60000 to 101000 measured 2 times, 1.10 of the law",
        f"town up to 60 km/h 9.4 9 383 {TOWN_WEAR:.3f} 0.000 {TOWN_MG:.1f}",
        f"motorway above 90 km/h 30.6 11 144 {MOTORWAY_WEAR:.3f}",
        "[mg/km] 17.5 (0.7 to 24.5) 6.5 7, battery electric 3; heavier vans 11, battery electric 5",
        "Particles [10⁹/km] 5.25 (2.10 to 10.50) 3.00 none yet",
        "brakes did 75 % of the work of brakes and motors or engine",
        "The 10 dirtiest brake applications, by particles",
        "1950.0 4.0 108 → 18 400 119 100.0 50.00 20.00 8.00 to 40.00",
        "A drive is not that cycle",
    ],
)
def test_section_says(page: str, text: str) -> None:
    """17.5 mg/km: 2 brakes x 500 mg/g x 0.7 g over 40 km."""
    assert text in page


@pytest.mark.parametrize(("least", "marked"), [(20.0, False), (300.0, False), (400.0, True)])
def test_above_euro_7_is_marked_once_the_whole_band_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, least: float, marked: bool
) -> None:
    """11 mg/km, the highest limit, are 314 mg/g here."""
    monkeypatch.setitem(AIRBORNE, "particle_mass_low", least)
    result = made_up(tmp_path)
    section, _ = wear_section(read_drive(result, (), ""), None, result, None, False)
    assert section.amounts[0].above == marked


def test_tables_and_plots_have_what_the_drive_has(page: str, tmp_path: Path) -> None:
    result = made_up(tmp_path)
    section, plots = wear_section(read_drive(result, (), ""), None, result, None, False)
    assert set(plots["wear_plots"]) == {"wear-drive", "lining-front", "lining-rear"}
    assert set(plots["emission_plots"]) == {"emission-energy", "emission-heat"}
    assert [row.name for row in section.roads] == ["town", "motorway"]
    assert section.missing == []
    assert len(section.dirtiest) == 10


NOTHING = dict.fromkeys([f"pad_wear_{corner}" for corner in CORNERS], NAN)
CANNOT = {
    "no wheel speeds": ({"vehicle_speed": NAN}, None, "Wear and dust : no wheel speed came"),
    "no pressures": (NOTHING, None, "Wear and dust : no calliper pressure came"),
    "no rear pressures": (
        {"pad_wear_rl": NAN, "pad_wear_rr": NAN}, None,
        "Wear of rl, rr : their calliper pressure is not in this log.",
    ),
    "no motors": (
        {f"motor_torque_{corner}": NAN for corner in CORNERS}, None,
        "Share of motors in braking : no motor torque is in this log",
    ),
    "no temperature": (
        {f"disc_temperature_{corner}": NAN for corner in CORNERS}, None,
        "Wear and dust against temperature : no disc temperature",
    ),
    "no pads stated": ({}, [], "Thickness and remaining distance : the result does not state the pads"),
    "pads never registered": (
        {}, [pad(corner, told=False, measurements=0) for corner in CORNERS],
        "Thickness of fl, fr, rl, rr to better than their life : nobody said what is fitted",
    ),
    "driven too little": (
        {}, [pad(corner, remaining=NAN, driven=12.0) for corner in CORNERS],
        "Remaining distance : these pads were driven 12.0 km and 50 km are needed",
    ),
    "no wear law of its own": (
        {}, [pad(corner, configured=False) for corner in CORNERS],
        "Wear of this car's own linings : CONFIG names no [front.pad]",
    ),
    "no emission model": (
        {"particles_last_brake": NAN}, [pad(corner, emission_model=False) for corner in CORNERS],
        "Particles : CONFIG has no emission model for them",
    ),
    "outside the model": (
        {"particles_last_brake": NAN}, None,
        "Particles per km in this drive : 100 % of the work was outside",
    ),
}  # fmt: skip


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(("change", "pads", "said"), CANNOT.values(), ids=CANNOT)
def test_what_is_missing_is_a_sentence(
    tmp_path: Path, change: dict[str, Any], pads: list[PadState] | None, said: str
) -> None:
    page = page_of(made_up(tmp_path, change, pads))
    assert said in page
    assert "nan" not in page


@pytest.mark.usefixtures("undrawn")
def test_without_its_table_of_brakings(tmp_path: Path) -> None:
    result = made_up(tmp_path)
    brakes_path(result).unlink()
    page = page_of(result)
    assert "RESULT.brakes.parquet is not beside the result" in page
    assert "dirtiest" not in page


@pytest.mark.usefixtures("undrawn")
def test_a_drive_without_braking_says_so(tmp_path: Path) -> None:
    result = made_up(tmp_path, {"braking": 0.0, "particles_last_brake": NAN})
    brakes = brakes_path(result)
    pq.write_table(pq.read_table(brakes).slice(0, 0), brakes)
    page = page_of(result)
    assert "dirtiest" not in page
    assert "No brake application was found in this" in result.with_name("report.html").read_text("utf-8")
    assert "mg/km] – 6.5" in page
    assert "nan" not in page


@pytest.mark.parametrize("text", ["{", "[3]", '[{"corner": "fl"}]'])
def test_damaged_metadata_are_one_line(tmp_path: Path, text: str) -> None:
    result = made_up(tmp_path)
    table = pq.read_table(result)
    pq.write_table(table.replace_schema_metadata({"pads": text}), result)
    with pytest.raises(UserError, match="metadata pads: not readable"):
        report(result, None, tmp_path / "report.html")
