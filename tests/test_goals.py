"""Goals of the laboratory's pages: what is said to be measured is what the page of results has."""

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parent.parent / "docs"
PLACED = re.compile(r"^Of \[.*?\]\((results/[\w-]+\.md)\).*?(?=^## |\Z)", re.MULTILINE | re.DOTALL)
FIGURE = re.compile(r"\d+\.\d+")
FOUND = [
    (path, one) for path in sorted(DOCS.glob("*.md")) for one in PLACED.finditer(path.read_text("utf-8"))
]


def test_pages_have_goals() -> None:
    assert {path.stem for path, _ in FOUND} == {"brake-dust", "disc-temperature", "pad-wear"}


@pytest.mark.parametrize(("path", "found"), FOUND, ids=[path.stem for path, _ in FOUND])
def test_goals_are_those_of_the_page(path: Path, found: re.Match[str]) -> None:
    """In the tables of the section; its text says more than the page."""
    page = set(FIGURE.findall((DOCS / found[1]).read_text("utf-8")))
    rows = [line for line in found[0].splitlines() if line.startswith("| ")]
    said = {figure for row in rows for figure in FIGURE.findall(row)}
    assert len(said) > 2
    assert said - page == set()
