"""The rig's exit code, words and files, in memory."""

import json
from pathlib import Path
from xml.etree import ElementTree

import pyarrow.parquet as pq
import pytest

from ecu import cli
from ecu.settings.resources import resource

STOP = """
plant = "suv"
initial_speed = 8.0
draw = "nominal"
[[phase]]
kind = "brake"
decel = 4.0
until_speed = 0.0
"""


@pytest.mark.parametrize(
    ("config", "plant", "code", "message"),
    [
        ("suv", (), 0, ""),
        ("lcv", (), 1, "brake-ecu: plant suv is another car than lcv (mass +11 %"),
        ("lcv", ("--plant", "lcv"), 0, ""),
        ("lcv", ("--plant", "as-config"), 0, ""),
    ],
)
@pytest.mark.usefixtures("undrawn")
def test_a_rig_with_another_car_than_the_configured_one_has_failed(
    config: str,
    plant: tuple[str, ...],
    code: int,
    message: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "stop.toml").write_text(STOP)
    arguments = ["rig", str(tmp_path / "stop.toml"), "--config", config, "--lock-step", *plant]
    assert cli.main([*arguments, "--out", str(tmp_path / "out")]) == code
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("brake-ecu:")]
    assert len(lines) == bool(message)
    assert all(line.startswith(message) for line in lines)


EXPECTED = """
[[expect]]
what = "stopping_distance"
at_most = 10.0
[[expect]]
what = "no_bit"
bit = "wheel slips"
"""
LONG, KEPT = "stopping distance at most 10 m", "never wheel slips"
OWN = "every fault bit accounted for, replay to the bit, the configured car"


@pytest.mark.parametrize(("limit", "code"), [pytest.param("10.0", 0, marks=pytest.mark.study), ("1.0", 1)])
def test_a_rig_fails_by_a_limit_that_is_not_kept(
    limit: str, code: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, junit = tmp_path / "out", tmp_path / "new" / "verdicts.xml"
    (tmp_path / "stop.toml").write_text(STOP + EXPECTED.replace("10.0", limit))
    arguments = ["rig", str(tmp_path / "stop.toml"), "--config", "suv", "--lock-step", "--out", str(out)]
    assert cli.main([*arguments, "--junit", str(junit), "--json"]) == code
    given = json.loads(capsys.readouterr().out)
    found = {one["expected"]: one["passed"] for one in given["scenarios"][0]["verdicts"]}
    assert found == {LONG.replace("10", limit.removesuffix(".0")): not code, KEPT: True}
    assert str(junit) in given["written"]

    (suite,) = ElementTree.parse(junit).getroot()
    assert suite.attrib == {"name": "stop", "tests": "3", "failures": str(code), "errors": "0"}
    cases = {case.get("name"): [one.tag for one in case] for case in suite}
    assert cases == {OWN: []} | {name: [] if passed else ["failure"] for name, passed in found.items()}

    (row,) = pq.read_table(out / "scenarios.parquet", columns=["expected", "failed"]).to_pylist()
    assert row["expected"] == 2
    assert ("FAILED: stopping distance at most 1 m (found: " in row["failed"]) == bool(code)
    assert (out / "stop" / "report.html").exists()
    page = (out / "rig.html").read_text("utf-8")
    assert "<script" not in page
    assert page.count("<b>failed</b>") == code
    assert ("1 of 2 failed" in page) == bool(code)


@pytest.mark.parametrize(("limit", "verdict", "code"), [("10.0", "passed", 0), ("1.0", "FAILED", 1)])
def test_simulate_fails_by_a_limit_that_is_not_kept(
    limit: str, verdict: str, code: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "stop.toml").write_text(STOP + EXPECTED.replace("10.0", limit))
    arguments = ["simulate", str(tmp_path / "stop.toml"), "--config", "suv", "--out", str(tmp_path / "drive")]
    assert cli.main(arguments) == code
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith(f"{verdict}: stopping distance at most {limit[:-2]} m (found: ")
    assert lines[1] == f"passed: {KEPT} (found: never)"


def test_an_expectation_counts_from_when_the_fault_began(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lost = 'kind = "lost"\nt = 0.0\nwhen = "vehicle_speed < {}"\nduration = 0.5\nmessage = ["Imu"]'
    expected = '[[expect]]\nwhat = "bit"\nbit = "IMU lost"\nwithin = 0.15'
    codes = {}
    for speed in ("5", "-5"):  # the second never
        path = tmp_path / f"below{speed}.toml"
        path.write_text(f"{STOP}\n[[fault]]\n{lost.format(speed)}\n{expected}\n")
        codes[speed] = cli.main(["simulate", str(path), "--config", "suv", "--out", str(tmp_path / "drive")])
    assert codes == {"5": 0, "-5": 1}
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("passed: IMU lost within 0.15 s of fault 1 (found: after 0.")
    assert lines[1] == "FAILED: IMU lost within 0.15 s of fault 1 (found: never)"


@pytest.mark.usefixtures("undrawn")
def test_a_shipped_scenario_passes_and_fails_by_a_time_out_that_is_shorter_than_the_ecu_has(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = resource("config/scenarios/faults/lost.toml").read_text("utf-8")
    (tmp_path / "strict.toml").write_text(text.replace("within = 0.15 ", "within = 0.05 "))
    arguments = ["rig", "--config", "suv", "--lock-step", "--seed", "1", "--out", str(tmp_path / "out")]
    assert cli.main([*arguments, "lost", "calliper-dead", "killed-standby", "snow", "fade-descent"]) == 0
    assert "FAILED" not in capsys.readouterr().out
    assert cli.main([*arguments, str(tmp_path / "strict.toml")]) == 1
    failed = [line for line in capsys.readouterr().out.splitlines() if "FAILED" in line]
    assert failed == ["strict: FAILED: IMU lost within 0.05 s of fault 1 (found: after 0.09 s)"]


def test_the_verdicts_never_replace_what_is_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "stop.toml"
    path.write_text(STOP)
    arguments = ["rig", str(path), "--config", "suv", "--lock-step", "--out", str(tmp_path / "out")]
    assert cli.main([*arguments, "--junit", str(path)]) == 2
    assert f"--junit: {path}: would overwrite {path}" in capsys.readouterr().err
    assert path.read_text() == STOP
