"""What `replay`, `report` and `identify` write and print, as committed.

Made-up drives, blocks and trips of fixed seeds, as small as the commands take. See `reference.py`.
"""

import re
import shutil
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from brakelab.results.files import brakes_path, read_result
from brakelab.simulation.campaigns.dust_trips import campaign, write_campaign
from brakelab.simulation.campaigns.wear_blocks import drawn_car, programme, write_programme
from brakelab.simulation.closed_loop import Drive, new_loop, run
from brakelab.simulation.scenario import load_scenario
from brakelab.simulation.simulate import write_columns
from ecu import cli
from ecu.contract.signals import CORNERS
from ecu.settings.config import load_config
from ecu.settings.resources import resource

from .reference import ROUNDED, check
from .report_page import parts_of

SEED = 3
REPLAYED_IN = re.compile(r"(demo\.parquet \d+ \d+) [\d.]+ \d+ \d+")
"""Time that replay took, rows a second and times real time."""


@cache
def driven(scenario: str, config: str, seconds: float) -> Drive:
    loop = new_loop(
        load_scenario(resource(f"config/scenarios/{scenario}.toml")),
        load_config(resource(f"config/{config}.toml")),
        SEED,
    )
    return run(loop, seconds=seconds)


def test_a_replay_and_its_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Four brakings of the demonstration, replayed from its signals, beside the truth."""
    monkeypatch.chdir(tmp_path)
    drive = driven("demo", "suv", 60.0)
    write_columns(Path("demo.parquet"), drive.t, drive.inputs, {})
    write_columns(Path("truth.parquet"), drive.t, drive.truth, {})
    result = Path("result.parquet")
    assert cli.main(["replay", "demo.parquet", "--config", "suv", "--out", str(result)]) == 0
    check("replay, brakes", read_result(brakes_path(result)).columns, 1e-6)
    assert cli.main(["report", str(result), "--truth", "truth.parquet", "--out", "report.html"]) == 0
    report = parts_of(Path("report.html").read_text("utf-8"))
    report["Data quality"] = REPLAYED_IN.sub(r"\1", report["Data quality"])
    check("report", report, ROUNDED)


def vehicle() -> list[str]:
    drive = driven("identify", "suv", 400.0)
    write_columns(Path("drive.parquet"), drive.t, drive.inputs, {})
    return ["vehicle", "drive.parquet", "--closed"]


def thermal() -> list[str]:
    """Thermocouples at three of the discs."""
    drive = driven("identify", "suv", 400.0)
    random, columns = np.random.default_rng(1), dict(drive.inputs)
    for corner in CORNERS[:3]:
        read = drive.truth[f"disc_temperature_{corner}"] + random.normal(0.0, 1.0, len(drive.t))
        often = np.arange(len(read)) % 20 == 0
        columns[f"disc_temperature_measured_{corner}"] = np.where(often, read, np.nan)
    write_columns(Path("drive.parquet"), drive.t, columns, {})
    return ["thermal", "drive.parquet"]


def wear() -> list[str]:
    car = drawn_car(1)
    write_programme(car, 0, 1, Path(), programme(car, 0, 1, ("town", "country", "motorway")))
    return ["wear", "manifest.csv"]


def dust() -> list[str]:
    pytest.importorskip("sklearn", reason="needs scikit-learn (extra learn)")
    write_campaign(campaign(SEED, trips=4), Path())
    return ["dust", "manifest.csv"]


@pytest.mark.parametrize(
    "campaign",
    [
        pytest.param(vehicle, marks=pytest.mark.study),
        thermal,
        pytest.param(wear, marks=pytest.mark.study),
        dust,
    ],
)
def test_what_identify_writes(
    campaign: Callable[[], list[str]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(time, "process_time", lambda: 0.0)  # the page on dust has times of training
    shutil.copy(resource("config/suv.toml"), "start.toml")
    words = campaign()
    capsys.readouterr()
    assert cli.main(["identify", *words, "--config", "start.toml", "--out", "car.toml"]) == 0
    printed = capsys.readouterr()
    parts, written = {"printed": printed.out}, sorted(Path().glob("car*"))
    assert all(path.name in printed.err.splitlines()[-1] for path in written)
    for path in written:
        head, *sections = path.read_text("utf-8").split("\n## ")
        parts[path.name] = head
        parts |= {f"{path.name}, {section.splitlines()[0]}": section for section in sections}
    check(f"identify {words[0]}", parts, ROUNDED)
