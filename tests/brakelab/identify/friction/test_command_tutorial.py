"""The tutorial of docs/results/friction-lab.md, run as it stands on a stranger's CSV with damaged rows."""

import re
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from typer.testing import CliRunner

from brakelab.cli import app
from brakelab.identify.friction import choice
from brakelab.identify.friction.candidates import Candidate
from brakelab.identify.friction.recording import Recording
from brakelab.identify.friction.stops import Stops
from brakelab.plant.description import read_file
from brakelab.plant.friction.law import RigBrake
from brakelab.plant.linings import Linings
from ecu.settings.resources import resource

pytestmark = pytest.mark.study

PAGE = resource("docs/results/friction-lab.md")


def test_five_commands(
    tmp_path: Path,
    recording: Recording,
    strange: Callable[..., Path],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With the two quickest laws; all seven: `brake-ecu bench lab`."""
    every = choice.candidates

    def quick(stops: Stops, brake: RigBrake, own: Sequence[str]) -> list[Candidate]:
        return [candidate for candidate in every(stops, brake) if candidate.name in ("constant", "ilvo")]

    monkeypatch.setattr(choice, "candidates", quick)
    monkeypatch.setattr(choice, "as_completed", list)
    monkeypatch.chdir(tmp_path)
    text = PAGE.read_text("utf-8")
    columns = re.search(r"```toml\n(.*?)```", text, re.DOTALL)
    commands = re.search(r"```sh\n(.*?)```", text, re.DOTALL)
    assert columns is not None
    assert commands is not None
    strange(tmp_path, recording, damaged=True)
    Path("mine.toml").write_text(columns[1], "utf-8")
    lines = commands[1].strip().splitlines()
    assert len(lines) == 5
    said = ""
    for line in lines:
        program, *words = line.split()
        if program == "cp":
            shutil.copy(*words)
            continue
        done = CliRunner().invoke(app, words)
        assert done.exit_code == 0, f"{line}: {done.output} {done.exception}"
        said += done.output
    assert "3 rows left out, first: line 52" in " ".join(said.split())
    assert "J/K at 100 °C" in said
    assert set(read_file(Path("linings.toml"), Linings).lining) == {"mine"}
