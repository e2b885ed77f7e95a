"""`brake-ecu tune` as a user meets it: one short stop, a handful of tunings."""

import tomllib
from pathlib import Path

import pytest

from brakelab.identify.tuning import command
from brakelab.identify.tuning.recording import drive_errors, drive_once
from brakelab.identify.tuning.search import RANGES
from brakelab.simulation.scenario import load_scenario
from ecu.errors import UserError
from ecu.settings.config import load_config
from ecu.settings.resources import resource

SUV = resource("config/suv.toml")
BUDGET = command.Budget(generations=2, population=6, seed=1)


def tune(stop: Path, out: Path, budget: command.Budget = BUDGET) -> str:
    command.tune(SUV, [stop], [stop], 1, budget, out)
    return out.read_text(encoding="utf-8")


def test_a_tuning_that_a_config_includes(
    stop: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What the file promises for the car of seed 1 is what the ECU with that file measures in that car."""
    text = tune(stop, tmp_path / "out/tuned.toml")
    assert tomllib.loads(text).keys() == {"observer"}
    assert tomllib.loads(text)["observer"].keys() == {"kind", *RANGES}
    car = tmp_path / "out/car.toml"
    car.write_text('include = "tuned.toml"\n' + SUV.read_text(encoding="utf-8"), encoding="utf-8")
    after = drive_errors(drive_once(load_scenario(stop), load_config(car), 1)).nrmse
    promised = next(line for line in text.splitlines() if line.startswith("#   stop, other cars"))
    assert promised.endswith(f"-> {after[0]:.2f}, {after[1]:.2f}")
    printed = capsys.readouterr().out
    assert "12.7 to 7.6 %" in printed
    assert f"{after[0]:.2f}" in printed


def test_the_tuned_row_is_not_worse_than_the_manual_one(stop: Path, tmp_path: Path) -> None:
    line = next(line for line in tune(stop, tmp_path / "t.toml").splitlines() if "tuned on" in line)
    before, after = (sum(map(float, side.split(", "))) for side in line.split(": ")[1].split(" -> "))
    assert after < before


def test_the_same_seed_writes_the_same_file(stop: Path, tmp_path: Path) -> None:
    texts = {tune(stop, tmp_path / folder / "tuned.toml").partition("[observer]")[2] for folder in ("a", "b")}
    assert len(texts) == 1


@pytest.mark.parametrize(("after", "generations"), [(0, 0), (1, 1)])
def test_ctrl_c_writes_the_best_so_far(
    stop: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, after: int, generations: int
) -> None:
    def interrupted(*arguments):
        for count, best in enumerate(command_search(*arguments)):
            if count == after:
                raise KeyboardInterrupt
            last.append(best)
            yield best

    command_search, last = command.search, []
    monkeypatch.setattr(command, "search", interrupted)
    observer = tomllib.loads(tune(stop, tmp_path / "tuned.toml"))["observer"]
    shipped = load_config(SUV).observer
    expected = last[-1].config.observer if last else shipped
    assert len(last) == generations
    assert observer == {"kind": "observer2"} | {key: getattr(expected, key) for key in RANGES}


def test_an_interrupted_file_says_how_far_it_came(
    stop: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(command, "search", interrupted)
    text = tune(stop, tmp_path / "tuned.toml")
    assert "0 generations of 6" in text
    assert "other cars" not in text


@pytest.mark.parametrize(
    ("out", "line"),
    [
        ("tuned.txt", "is written as TOML"),
        ("stop.toml", "which this command reads"),
        ("folder.toml", "is a folder"),
    ],
)
def test_an_out_that_cannot_be_is_one_line_before_anything_is_driven(
    stop: Path, tmp_path: Path, out: str, line: str
) -> None:
    (tmp_path / "folder.toml").mkdir()
    with pytest.raises(UserError, match=line):
        command.tune(SUV, [stop], [], 1, BUDGET, tmp_path / out)


def test_a_scenario_that_never_brakes_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "cruise.toml"
    path.write_text(
        'plant = "suv"\ninitial_speed = 15.0\nphase = [{ kind = "cruise", speed = 15.0, seconds = 2.0 }]\n',
        encoding="utf-8",
    )
    with pytest.raises(UserError, match=r"cruise\.toml: has no brake application"):
        command.tune(SUV, [path], [], 1, BUDGET, tmp_path / "tuned.toml")
