"""The README: it is short, its commands run as they stand, its accuracy is that of the page."""

import re
from pathlib import Path

import pytest

from ecu.cli import main

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text("utf-8")
BLOCKS = re.findall(r"```(\w+)\n(.*?)```", README, re.DOTALL)


def _commands(*names: str) -> list[list[str]]:
    lines = [line.split() for kind, block in BLOCKS if kind == "sh" for line in block.splitlines()]
    return [words[1:] for words in lines if words[:1] == ["brake-ecu"] and words[1] in names]


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder with the drives of the tests, so that `out/` is not the developer's."""
    (tmp_path / "tests").symlink_to(ROOT / "tests")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_replay_report_and_compare(checkout: Path) -> None:
    commands = _commands("replay", "report", "compare")
    assert [words[0] for words in commands] == ["replay", "report", "replay", "compare"]
    for words in commands:
        code = main(words)
        assert code == 0 or (words[0] == "compare" and code == 1), words
    assert (checkout / "out/drive.html").stat().st_size > 100_000


def test_it_is_read_in_one_sitting() -> None:
    assert len(README.splitlines()) <= 150


def test_every_command_is_in_the_table(capsys: pytest.CaptureFixture[str]) -> None:
    main(["--help"])
    listed = re.findall(r"^  (\w+)  +[A-Z]", capsys.readouterr().out.partition("Commands:")[2], re.MULTILINE)
    rows = "\n".join(re.findall(r"^\| (`.*?) \| ", README, re.MULTILINE))
    assert len(listed) > 15
    assert [name for name in listed if not re.search(rf"`{name}\b", rows)] == []


def test_accuracy_is_that_of_the_page() -> None:
    """Figures front/rear of each row of the README's table are in the rows of that case."""
    page = (ROOT / "docs/results/observers.md").read_text("utf-8")
    rows = re.findall(r"^\| ((?:stop #\d|blending [\d.]+).*)\|$", README, re.MULTILINE)
    assert len(rows) == 5
    for row in rows:
        case = re.split(r"[:|]", row)[0].strip()
        (line,) = [line for line in page.splitlines() if line.startswith(f"| {case} | ")][:1]
        figures = re.findall(r"[\d.]+/[\d.]+", row)
        assert len(figures) == 4
        assert set(figures) <= set(re.findall(r"[\d.]+/[\d.]+", line)), case
