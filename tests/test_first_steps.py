"""The pages of first steps: their commands run as they stand and print what the pages show."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from ecu.cli import main

ROOT = Path(__file__).parent.parent
PAGES = sorted((ROOT / "docs").glob("first-steps-*.md"))
MACHINE = {"doctor"}
"""Commands whose exit code is about this machine."""
EXACT = re.compile(r"\d+(\.\d+)?")


def steps(block: str) -> list[str]:
    """Return the commands of a block; what stands between two of `brake-ecu` is one script of the shell."""
    found: list[str] = []
    for line in block.replace("\\\n", " ").splitlines(keepends=True):
        if line.startswith("brake-ecu") or not found or found[-1].startswith("brake-ecu"):
            found.append(line)
        else:
            found[-1] += line
    return found


def shape(text: str) -> str:
    """Return a text with single spaces and `#` for every number: figures may differ in the last digit."""
    return EXACT.sub("#", " ".join(text.split()))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_its_commands_run_and_print_what_it_shows(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    for name in ("config", "dbc"):
        (tmp_path / name).symlink_to(ROOT / name)
    monkeypatch.chdir(tmp_path)
    environment = os.environ | {"PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    blocks = re.findall(r"```(sh|text)\n(.*?)```", page.read_text("utf-8"), re.DOTALL)
    said = ""
    commands = 0
    for kind, block in blocks:
        if kind == "text":
            for line in block.splitlines():
                assert shape(line) in shape(said), line
            continue
        for step in steps(block):
            if step.startswith("brake-ecu"):
                words = shlex.split(step)[1:]
                code = main(words)
                assert code == 0 or words[0] in MACHINE, step
                commands += words[0] not in MACHINE
            else:
                subprocess.run(["bash", "-ec", step], check=True, env=environment)
        captured = capfd.readouterr()
        said = captured.out + captured.err
    assert commands >= 3


def test_every_page_is_linked_where_a_newcomer_looks() -> None:
    readme = (ROOT / "README.md").read_text("utf-8")
    top = readme[: readme.index("## Try it")]
    assert len(PAGES) == 3
    for page in PAGES:
        assert f"docs/{page.name}" in top
