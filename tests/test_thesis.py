"""docs/thesis.md: its rows are counted, and what each names is there."""

import importlib.util
import re
from pathlib import Path

import pytest

from ecu.cli import main

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / "docs/thesis.md").read_text("utf-8")
ROWS = [[cell.strip() for cell in row.split("|")[1:-1]] for row in re.findall(r"^\| \d+ \|.*$", PAGE, re.M)]
FOLDERS = ("ecu/algorithm", "ecu", "tools/brakelab", "config")


def test_the_rows_are_counted() -> None:
    assert [int(row[0]) for row in ROWS] == list(range(1, 100))
    states = [row[-1] for row in ROWS]
    counts = [states.count(state) for state in ("works", "in part", "not built")]
    assert sum(counts) == len(ROWS)
    said = re.search(r"(\d+) rows.*?(\d+) work, (\d+) in\s+part, (\d+) are not built", PAGE, re.S)
    assert said is not None
    assert list(map(int, said.groups())) == [len(ROWS), *counts]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_what_a_row_names_is_there(row: list[str]) -> None:
    files = re.findall(r"`([\w/.-]+\.(?:py|toml))`", row[2])
    for name in files:
        assert any((ROOT / folder / name).is_file() for folder in FOLDERS), name
    for module in re.findall(r"`python -m ([\w.]+)", row[3]):
        assert importlib.util.find_spec(module) is not None, module
    if row[-1] == "works":
        assert files or row[2] == "–"
        assert re.search(r"\]\(|`", row[3]), "a row that works is shown by a page or a command"


def test_its_commands_are_commands(capsys: pytest.CaptureFixture[str]) -> None:
    for words, options in sorted(set(re.findall(r"`brake-ecu ((?:[a-z]+\d* ?)+)(--[\w-]+)?", PAGE))):
        asked = words.split()
        if asked[:2] == ["lab", "run"]:
            assert all((ROOT / "config/rig" / f"{name}.toml").is_file() for name in asked[2:])
            asked = asked[:2]
        assert main([*asked, "--help"]) == 0, words
        assert options in re.sub(r"\s+", " ", capsys.readouterr().out), (words, options)
