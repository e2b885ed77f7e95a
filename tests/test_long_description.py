"""The README on a package index: nothing in it leads nowhere, and its commands are as they were."""

import email
import re
import zipfile
from pathlib import Path

import pytest

pytest.importorskip("hatchling", reason="hatchling is not installed")
from hatchling.builders.wheel import WheelBuilder

from long_description import for_an_index

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text("utf-8")
BROKEN = re.compile(r"\]\((?!https?:)[^)]*\)")
FENCED = re.compile(r"```.*?```", re.DOTALL)

CASES = {
    "a link becomes its text": ("T\nsee [the page](docs/a.md#b).\n", "see the page."),
    "one that is wrapped": ("T\nsee [the\npage](docs/a.md).\n", "see the\npage."),
    "an address stays": ("T\n[x](https://example.org/a)\n", "[x](https://example.org/a)"),
    "a picture goes": ("T\n![of the\nreport](docs/r.png)\n\nnext\n", "next"),
    "code stays": ("T\n```python\na[0](1)\n```\n", "```python\na[0](1)\n```"),
}


@pytest.mark.parametrize(("text", "shown"), CASES.values(), ids=CASES)
def test_what_would_break_is_text(text: str, shown: str) -> None:
    assert for_an_index(text).partition("\n\n")[2].partition("\n")[2].strip() == shown


def test_the_readme_leads_nowhere_and_keeps_its_commands() -> None:
    shown = for_an_index(README)
    assert len(BROKEN.findall(README)) > 20, "nothing to do"
    assert BROKEN.findall(FENCED.sub("", shown)) == []
    assert FENCED.findall(shown) == FENCED.findall(README)
    assert re.findall("^#+ .*", shown, re.M) == re.findall("^#+ .*", README, re.M)


def test_the_wheel_has_it(tmp_path: Path) -> None:
    built = Path(next(WheelBuilder(str(ROOT)).build(directory=str(tmp_path), versions=["standard"])))
    with zipfile.ZipFile(built) as archive:
        (name,) = [name for name in archive.namelist() if name.endswith(".dist-info/METADATA")]
        metadata = email.message_from_bytes(archive.read(name))
    assert metadata["Description-Content-Type"] == "text/markdown"
    assert metadata.get_payload(decode=True).decode("utf-8").strip() == for_an_index(README).strip()
    assert metadata["Requires-Python"] == "<3.15,>=3.11"
