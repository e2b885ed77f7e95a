"""The pages of first steps: their commands run as they stand and print what the pages show."""

import re
import shlex
import subprocess
from pathlib import Path

import pytest

from ecu.cli import main
from first_steps import CHECKOUT, ENDS_WITH, PAGES, blocks, commands, is_about_this_machine, prepare

EXACT = re.compile(r"\d+(\.\d+)?")


def shape(text: str) -> str:
    """Return a text with single spaces and `#` for every number: figures may differ in the last digit."""
    return EXACT.sub("#", " ".join(text.split()))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_its_commands_run_and_print_what_it_shows(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    environment = prepare(tmp_path)
    monkeypatch.chdir(tmp_path)
    said = ""
    succeeded = 0
    for block in blocks(page):
        if block.kind == "text":
            for line in block.text.splitlines():
                assert shape(line) in shape(said), line
            continue
        for command in commands(block):
            if command.startswith("brake-ecu"):
                code = main(shlex.split(command)[1:])
                assert code == 0 or is_about_this_machine(command), command
                succeeded += not is_about_this_machine(command)
            else:
                subprocess.run(["bash", "-ec", command], check=True, env=environment)
        captured = capfd.readouterr()
        said = captured.out + captured.err
    assert succeeded >= 3
    assert (tmp_path / ENDS_WITH[page.stem][0]).is_file()


def test_every_page_is_linked_where_a_newcomer_looks() -> None:
    readme = (CHECKOUT / "README.md").read_text("utf-8")
    top = readme[: readme.index("## Try it")]
    assert len(PAGES) == 3
    for page in PAGES:
        assert f"docs/{page.name}" in top
