"""The table of benches: each has its study, and its page where there is one says so."""

import re
import sys
from pathlib import Path

import pytest

from brakelab.bench.command import study_of
from brakelab.bench.registry import MODULES
from ecu.errors import UserError

ROOT = Path(__file__).parents[3]
RESULTS = ROOT / "docs/results"


@pytest.mark.parametrize("name", MODULES)
def test_a_study_is_where_the_table_says_and_its_page_has_its_title_and_text(name: str) -> None:
    study = study_of(name)
    page = RESULTS / f"{study.file or name}.md"
    assert study.text.rstrip().endswith((".", ")", "**"))
    if page.exists():
        text = page.read_text("utf-8")
        assert text.startswith(f"# {study.title}\n")
        assert f"`brake-ecu bench {name}`" in text
        assert study.text.rstrip() in text


def test_a_missing_package_is_named_with_its_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "asammdf", None)
    monkeypatch.delitem(sys.modules, "brakelab.bench.replay", raising=False)
    with pytest.raises(
        UserError, match=r"replay: asammdf not installed: in the repository pip install '\.\[dev\]'"
    ):
        study_of("replay")


def test_every_page_is_of_a_bench() -> None:
    files = {study_of(name).file or name for name in MODULES} | {"benchmarks"}
    assert {page.stem for page in RESULTS.glob("*.md")} <= files


@pytest.mark.parametrize("folder", ["bench", "studies"])
def test_no_cause_is_typed_into_a_study(folder: str) -> None:
    """Nobody knows one before it is measured; causes stand on the page, by a person, under "Causes"."""
    for path in (ROOT / "tools/brakelab" / folder).rglob("*.py"):
        assert not re.search(r"\bbecause\b|\bby chance\b", path.read_text("utf-8")), path
