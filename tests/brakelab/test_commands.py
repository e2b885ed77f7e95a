"""Commands as functions: what they give is what the command line writes, and nothing is printed."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brakelab.api import (
    Result,
    Simulation,
    UserError,
    check_map,
    compare,
    identify,
    replay,
    simulate,
    suggest_map,
)
from ecu import cli

ROOT = Path(__file__).parents[2]


def said(words: list[str], capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    assert cli.main([*words, "--json"]) in (0, 1)
    given: dict[str, Any] = json.loads(capsys.readouterr().out)
    return given


def test_a_comparison_is_that_of_the_command(
    drive: Simulation, result: Result, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = replay(drive.log, config="suv", changes={"front.mu_nominal": 0.35})
    page = tmp_path / "both.html"
    found = compare(result, other.path, out=page)
    assert page.is_file()
    assert capsys.readouterr() == ("", "")
    given = said(["compare", str(result.path), str(other.path)], capsys)
    assert found.matter == given["matter"] > 10
    assert (found.verdicts, found.provenance) == (given["verdicts"], given["provenance"])
    assert found["name"].tolist() == [row["name"] for row in given["differences"]]
    mu_b = found["name"] == "mu_b_fl"
    assert found["unit"][mu_b].tolist() == ["-"]
    assert found["weight"][0] == found["weight"].max() > 1.0
    assert "<th>of</th><th>name</th>" in found._repr_html_()
    same = compare(result, result)
    assert (len(same), same.matter) == (0, 0)


def test_a_map_is_suggested_as_by_the_command_and_taken_as_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, dbc = ROOT / "tests/data/mustang.log", ROOT / "dbc/cars/mustang.dbc"
    found = suggest_map(log, dbc=dbc)
    assert capsys.readouterr() == ("", "")
    given = said(["map", "suggest", str(log), "--dbc", str(dbc)], capsys)
    assert found.text == given["map"]
    assert found.others["target"].tolist() == [row["target"] for row in given["others"]]
    assert found.others["signal"][0] in found.text
    assert found["target"].tolist()[:2] == ["wheel_speed_fl", "wheel_speed_fr"]
    assert found.where(found["target"] == "wheel_speed_fl")["evidence"].tolist() == ["by their names"]
    assert len(replay(log, config="mustang", map=found.map)) == 200
    out = tmp_path / "map.toml"
    suggest_map(log, dbc=dbc, out=out)
    assert out.is_file()


def test_a_table_s_columns_are_suggested(drive: Simulation) -> None:
    found = suggest_map(drive.inputs.to_pandas())
    assert found.map["inputs"]["accel_x"] == {"column": "accel_x"}
    assert np.all(found["factor"] == 1.0)


@pytest.mark.study
def test_identify_gives_figures_and_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    trip = simulate("fixed-pedal", config="suv").inputs
    given = identify("vehicle", trip, config="suv", out=tmp_path / "car.toml", closed=True)
    assert capsys.readouterr() == ("", "")
    assert given["written"][0] == tmp_path / "car.toml"
    radii = [one.value for one in given["parameters"] if one.key.endswith("wheel_radius")]
    assert all(0.2 < radius < 0.5 for radius in radii)
    assert len(replay(trip, config=given["written"][0])) == len(trip)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: identify("tyre", [], out="x.toml"), "identify tyre: No such command 'tyre'"),
        (lambda: identify("wear", __file__, out="x.toml"), "identify wear: Missing option '--config'"),
        (lambda: identify("dust", "x.csv", out="x.toml", foo=1), "identify dust: No such option: --foo"),
        (lambda: suggest_map("no.log"), "no.log: no such file"),
        (lambda: compare("a.parquet", "b.parquet"), "a.parquet: no such file"),
    ],
)
def test_a_mistake_is_the_command_s(call: Any, says: str) -> None:
    with pytest.raises(UserError) as error:
        call()
    assert says in str(error.value)


def test_a_map_is_checked_as_by_the_command(drive: Simulation, capsys: pytest.CaptureFixture[str]) -> None:
    log = ROOT / "tests/data/mustang.log"
    found = check_map(log, "mustang")
    assert found == said(["map", "check", str(log), "--map", "mustang"], capsys)
    assert [row["name"] for row in found["inputs"]][:2] == ["wheel_speed_fl", "wheel_speed_fr"]
    inputs: dict[str, Any] = {name: {"column": name} for name in drive.inputs.columns if name != "t"}
    turned = {"inputs": inputs | {"accel_x": {"column": "accel_x", "factor": -1.0}}}
    wrong = check_map(drive.inputs.to_pandas(), turned, config="suv")["wrong"]
    assert [line for line in wrong if line.startswith("accel_x: turned")]


@pytest.mark.parametrize("name", ["lab look", "lab report", "identify friction"])
def test_a_command_says_that_it_works_while_what_it_needs_is_imported(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SciPy takes a second; where a drive is read there is a bar of its own."""
    said: list[str] = []

    @contextmanager
    def bar(text: str, total: float | None) -> Iterator[None]:
        said.append(text)
        yield

    monkeypatch.setattr("brakelab.results.progress.progress_bar", bar)
    (tmp_path / "data.csv").write_text("t\n")
    options = ["--out", str(tmp_path / "out.toml")] if "identify" in name else []
    assert cli.main([*name.split(), str(tmp_path / "data.csv"), *options]) == 2
    assert said == [name]
