"""How `--observer` names a class, and every mistake in it."""

from pathlib import Path

import pytest

from brakelab.studies.entries.observer import load_class
from ecu.errors import UserError

GOOD = """
class Good:
    def reset(self, config): ...
    def step(self, inputs): ...

class Deaf:
    def reset(self, config): ...

number = 3
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "an_entry.py").write_text(GOOD)
    (tmp_path / "broken_entry.py").write_text("import nothing_of_that_name\n")
    (tmp_path / "unfinished_entry.py").write_text("class Half(\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path


def test_a_class_is_found_by_module_and_by_file(folder: Path) -> None:
    assert load_class("an_entry:Good").__name__ == "Good"
    assert load_class(f"{folder}/an_entry.py:Good").__name__ == "Good"


@pytest.mark.parametrize(
    ("name", "remedy"),
    [
        ("Good", "give module:Class"),
        ("an_entry:", "give module:Class"),
        ("an_entry:Goods", "no class Goods there; it has Good, Deaf"),
        ("an_entry:number", "no class number there"),
        ("an_entry:Deaf", "has no method step"),
        ("nosuch_entry:Good", "cannot be imported (ModuleNotFoundError"),
        ("nosuch.py:Good", "no such file"),
        ("broken_entry:Good", "cannot be imported (ModuleNotFoundError"),
        ("unfinished_entry.py:Half", "cannot be imported (SyntaxError"),
    ],
)
def test_a_mistake_is_one_line(folder: Path, name: str, remedy: str) -> None:
    with pytest.raises(UserError) as error:
        load_class(name)
    assert remedy in str(error.value)
    assert "\n" not in str(error.value)
