"""Completion as the shells ask for it: `brake-ecu` with `_BRAKE_ECU_COMPLETE` set."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from ecu.cli import main
from ecu.completion import fitting, shipped

ROOT = Path(__file__).parents[2]
Ask = Callable[[str, str], list[str]]


def _asked(shell: str, line: str) -> dict[str, str]:
    """Return what a shell sets to complete a line."""
    return {
        "_BRAKE_ECU_COMPLETE": f"complete_{shell}",
        "COMP_WORDS": line,
        "COMP_CWORD": str(len(line.split(" ")) - 1),
        "_TYPER_COMPLETE_ARGS": line,
        "_TYPER_COMPLETE_FISH_ACTION": "get-args",
    }


@pytest.fixture
def ask(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Ask:
    """Complete a line in a shell."""
    monkeypatch.chdir(ROOT / "docs")

    def answer(shell: str, line: str) -> list[str]:
        for name, value in _asked(shell, line).items():
            monkeypatch.setenv(name, value)
        with pytest.raises(SystemExit):
            main(["completed"])
        said = capsys.readouterr()
        assert said.err == ""
        return said.out.split()

    return answer


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("brake-ecu r", {"run", "rig", "replay", "report"}),
        ("brake-ecu run --config s", {"suv", "sedan", "suv-blended"}),
        ("brake-ecu run --log-format ", {"console", "json"}),
        ("brake-ecu replay a.log --map ", {"kona", "mustang", "rav4", "van"}),
        ("brake-ecu replay a.log --observer o", {"observer1", "observer2"}),
        ("brake-ecu replay a.log --config nosuch --observer j", {"joint"}),
        ("brake-ecu simulate stop-", {"stop-1", "stop-2", "stop-3", "stop-4"}),
        ("brake-ecu rig fau", {"faults"}),
        ("brake-ecu bench ent", {"entries"}),
        ("brake-ecu lab run a", {"ams", "ak-master"}),
        ("brake-ecu lab run cpc --law S", {"SIM"}),
        ("brake-ecu config ", {"check", "new", "schema", "plant"}),
        ("brake-ecu replay a", set()),
    ],
)
def test_known_names_are_offered(ask: Ask, line: str, offered: set[str]) -> None:
    assert set(ask("bash", line)) == offered


def test_every_shell_is_answered(ask: Ask) -> None:
    assert ask("zsh", "brake-ecu compare --q")[:2] == ["_arguments", "'*:"]
    assert ask("zsh", "brake-ecu compare a") == ["_files"]
    assert ask("fish", "brake-ecu compare --qu")[0] == "--quiet"


def test_a_process_answers_and_imports_nothing_slow() -> None:
    script = (
        "import sys\nfrom ecu.cli import main\n"
        "try:\n    main()\nfinally:\n"
        "    print(*{name.partition('.')[0] for name in sys.modules} & {'numba', 'numpy', 'scipy', 'bokeh'})"
    )
    path = os.pathsep.join([str(ROOT), str(ROOT / "tools")])
    environment = {**os.environ, "PYTHONPATH": path, **_asked("bash", "brake-ecu simulate wltp")}
    done = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True)
    assert (done.stdout.split(), done.stderr) == (["wltp-brake"], "")


def test_files_beside_are_offered_with_the_shipped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "sports.toml").write_text("")
    (tmp_path / "sports.log").write_text("")
    monkeypatch.chdir(tmp_path)
    assert shipped("config")("s") == ["sedan", "suv-blended", "suv", "sports.toml"]
    assert shipped("config")("/") == []


def test_names_fit_by_their_beginning() -> None:
    assert fitting(["suv", "sedan", "lcv"], "s") == ["suv", "sedan"]
