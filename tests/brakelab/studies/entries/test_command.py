"""Options of `bench entries`: every mistake is one line; a run of one car in whole."""

import json
from pathlib import Path

import pytest

from brakelab.bench.command import bench
from brakelab.studies.entries.command import measure_entries
from brakelab.studies.entries.ours import OURS
from brakelab.studies.study import Asked, Entered
from ecu.cli import main
from ecu.errors import UserError

ROOT = Path(__file__).parents[4]


@pytest.mark.parametrize(
    ("entered", "remedy"),
    [
        (Entered(("nothing",)), "give module:Class"),
        (Entered(drive="mustang"), "give CAR:LOG"),
        (Entered(drive="mustang:nothing.log"), "no such log"),
        (Entered(drive=f"mustang:{ROOT}/README.md"), "unknown kind of log"),
        (Entered(drive=f"mustang:{ROOT}/tests/data/exports/aim.csv"), "give a log of frames"),
        (Entered(drive=f"mustang:{ROOT}/tests/data/kona.log"), "no brake application of mustang to predict"),
    ],
)
def test_a_mistake_is_reported_before_anything_is_driven(entered: Entered, remedy: str) -> None:
    with pytest.raises(UserError, match=remedy):
        measure_entries(Asked(1, entered=entered))


@pytest.mark.parametrize("name", ["stops", "step", None])
def test_other_benches_have_no_entries(name: str | None) -> None:
    with pytest.raises(UserError, match="bench entries"):
        bench(name, Asked(entered=Entered(("a:B",))))


@pytest.mark.study
def test_a_car_is_heard_by_all(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    own = tmp_path / "own.py"
    own.write_text("class Fails:\n    def reset(self, config): ...\n    def step(self, inputs): 1 / 0\n")
    assert main(["bench", "entries", "--json", "--seeds", "1", "--observer", f"{own}:Fails"]) == 0
    entries = json.loads(capsys.readouterr().out)["entries"]
    assert {entry["name"] for entry in entries} == {*OURS, f"{own}:Fails"}
    errors = {entry["name"]: entry["rank_error"] for entry in entries}
    assert errors["joint observer"] < 0.3 * errors["configured"]
    assert entries[-1]["failure"].startswith("step raised ZeroDivisionError")
    assert all(entry["prediction"]["counted"] == 1 for entry in entries[:-1])
