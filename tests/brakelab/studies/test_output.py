"""Pages that benches write: what a person wrote on one stays."""

from pathlib import Path

import pytest

from brakelab.results.text_table import Table
from brakelab.studies import output
from brakelab.studies.output import CAUSES, MOVED, write_page


def table(value: str) -> Table:
    return Table("Goals", ("goal", "found"), [("a", value)], "")


def test_causes_stay_and_are_marked_once_the_figures_moved(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(output, "resource", lambda name: tmp_path / name)
    page = tmp_path / "docs/results/lab.md"
    page.parent.mkdir(parents=True)
    write_page("lab.md", "Lab", "Text.", [table("1")])
    page.write_text(page.read_text("utf-8") + f"\n## {CAUSES}\n\nAnother pad.\n", "utf-8")
    for value, marks in [("1", 0), ("2", 1), ("2", 1), ("3", 1)]:
        write_page("lab.md", "Lab", "Text.", [table(value)])
        text = page.read_text("utf-8")
        assert f"| a | {value} |" in text
        assert text.count(MOVED) == marks
        assert text.index(f"## {CAUSES}") < text.index("Another pad.")
        assert text.count("Another pad.") == text.count(f"## {CAUSES}") == 1
