"""Completion as the shells ask for it: `brake-ecu` in a process, with `_BRAKE_ECU_COMPLETE` set."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from ecu.completion import fitting, shipped

ROOT = Path(__file__).parents[2]


def _ask(
    shell: str, line: str, script: str = "from ecu.cli import main; raise SystemExit(main())"
) -> list[str]:
    words = line.split(" ")
    done = subprocess.run(
        [sys.executable, "-c", script],
        env={
            **os.environ,
            "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "tools")]),
            "_BRAKE_ECU_COMPLETE": f"complete_{shell}",
            "COMP_WORDS": line,
            "COMP_CWORD": str(len(words) - 1),
            "_TYPER_COMPLETE_ARGS": line,
            "_TYPER_COMPLETE_FISH_ACTION": "get-args",
        },
        cwd=ROOT / "docs",
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stderr == ""
    return done.stdout.split()


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
        ("brake-ecu config ", {"check", "new", "schema"}),
        ("brake-ecu replay a", set()),
    ],
)
def test_known_names_are_offered(line: str, offered: set[str]) -> None:
    assert set(_ask("bash", line)) == offered


def test_every_shell_is_answered() -> None:
    assert _ask("zsh", "brake-ecu compare --q")[:2] == ["_arguments", "'*:"]
    assert _ask("zsh", "brake-ecu compare a") == ["_files"]
    assert _ask("fish", "brake-ecu compare --qu")[0] == "--quiet"


def test_nothing_slow_is_imported() -> None:
    script = (
        "import sys\nfrom ecu.cli import main\n"
        "try:\n    main()\nfinally:\n"
        "    print(*{name.partition('.')[0] for name in sys.modules} & {'numba', 'numpy', 'scipy', 'bokeh'})"
    )
    assert _ask("bash", "brake-ecu simulate wltp", script) == ["wltp-brake"]


def test_files_beside_are_offered_with_the_shipped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "sports.toml").write_text("")
    (tmp_path / "sports.log").write_text("")
    monkeypatch.chdir(tmp_path)
    assert shipped("config")("s") == ["sedan", "suv-blended", "suv", "sports.toml"]
    assert shipped("config")("/") == []


def test_names_fit_by_their_beginning() -> None:
    assert fitting(["suv", "sedan", "lcv"], "s") == ["suv", "sedan"]
