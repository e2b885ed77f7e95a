"""Words that were retired: one for each meaning took their place (docs/glossary.md)."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
FOLDERS = ("config", "docs", "ecu", "examples", "tests", "tools")
RETIRED = {
    "told": "reported (a fault), identified (a parameter), known, measured or counted (a value)",
    "untold": "missing, not available",
    "way": "distance, method, direction; under way: in progress",
    "ways": "methods, directions",
    "course": "series (of samples), trajectory (of states), profile (of a road)",
    "courses": "series, trajectories, profiles",
}


def _spellings(word: str) -> str:
    return f"{word}|{word.capitalize()}|{word.upper()}(?![A-Z])"


PATTERN = re.compile(rf"(?<![A-Za-z])({'|'.join(map(_spellings, RETIRED))})(?![a-z])")

BARE = re.compile(r"_?([A-Z]+EST|LEAST|MOST|WORST)")
"""A superlative of nothing: the quantity belongs to the name (FEWEST_BLOCKS, LOWEST_SPEED)."""
NO_SUPERLATIVES = {"DIGEST", "HONEST", "MANIFEST", "REQUEST", "REST", "TEST"}
OWN_NAME = {
    "told": {  # of the stored wear and of pads.parquet: these pads were registered as new
        "ecu/algorithm/monitoring/dust.py",
        "ecu/algorithm/monitoring/wear_belief.py",
        "ecu/contract/records.py",
        "ecu/pads.py",
        "ecu/recording/learned_range.py",
        "tests/brakelab/fleet/test_wear.py",
        "tests/brakelab/report/test_wear_section.py",
        "tests/brakelab/results/test_pads.py",
        "tests/ecu/algorithm/monitoring/test_dust.py",
        "tests/ecu/algorithm/test_publish.py",
        "tests/ecu/algorithm/test_step.py",
        "tests/ecu/diagnostics/test_workshop.py",
        "tests/ecu/recording/test_store.py",
        "tests/ecu/runtime/test_calibration.py",
        "tests/ecu/runtime/test_follow_first.py",
        "tests/ecu/test_pads.py",
        "tests/ecu/test_workshop.py",
        "tests/system/test_workshop_udp.py",
        "tools/brakelab/fleet/fleet.html.j2",
        "tools/brakelab/fleet/wear.py",
        "tools/brakelab/report/wear_missing.py",
        "tools/brakelab/report/wear_section.py",
        "tools/brakelab/results/pads.py",
        "tools/brakelab/studies/dust/study.py",
        "tools/brakelab/studies/wear/study.py",
    },
    "way": {  # of the stored dust, and a number of the law `surface` in files of linings
        "config/plant/linings.toml",
        "ecu/algorithm/monitoring/dust.py",
        "ecu/contract/records.py",
        "ecu/recording/learned_range.py",
        "ecu/recording/store.py",
        "tests/brakelab/plant/friction/test_laws.py",
        "tests/ecu/algorithm/monitoring/test_dust.py",
        "tests/ecu/recording/test_store.py",
        "tools/brakelab/identify/friction/candidates.py",
        "tools/brakelab/plant/friction/surface.py",
    },
    "course": {  # ISO 8855: the direction of the car's motion
        "tools/brakelab/plant/steering.py",
    },
}
"""Files in which a word is a name that users' files or standards have."""
DRIVES = {"tools/brakelab/api.py", "tools/brakelab/simulation/closed_loop.py"}
"""Where a class is called Drive: the api's, and that of a drive in memory."""


def _name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def _files(*suffixes: str) -> list[Path]:
    files = (path for folder in FOLDERS for path in (ROOT / folder).rglob("*") if path.suffix in suffixes)
    return sorted(path for path in files if path != Path(__file__))


def _retired(name: str, text: str) -> Iterator[str]:
    """Yield a line for each retired word of a file."""
    for number, line in enumerate(text.splitlines(), 1):
        for word in {word.lower() for word in PATTERN.findall(line)}:
            if name not in OWN_NAME.get(word, ()):
                yield f"{name}:{number}: {word}; say {RETIRED[word]}"


def _assigned(tree: ast.Module) -> Iterator[ast.Name]:
    """Yield the names that a module and its classes assign alone."""
    bodies = [tree.body, *(node.body for node in tree.body if isinstance(node, ast.ClassDef))]
    for node in (node for body in bodies for node in body):
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        yield from (target for target in targets if isinstance(target, ast.Name))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a fault is told", ["told"]),
        ("only_told(drive)", ["told"]),
        ("toldText, Untold", ["told", "untold"]),
        ("on the way, of course", ["course", "way"]),
        ("away, always, a motorway, motorways", []),
    ],
)
def test_a_retired_word_is_found_wherever_it_stands(text: str, words: list[str]) -> None:
    assert sorted(line.split(": ")[1].partition(";")[0] for line in _retired("a.py", text)) == words


def test_no_text_has_a_retired_word() -> None:
    files = [ROOT / "README.md", ROOT / "CHANGELOG.md"]
    files += _files(".css", ".html", ".j2", ".md", ".py", ".sh", ".toml")
    assert [line for path in files for line in _retired(_name(path), path.read_text("utf-8"))] == []


def test_no_constant_is_a_superlative_of_nothing() -> None:
    found = [
        f"{_name(path)}:{name.lineno}: {name.id}"
        for path in _files(".py")
        for name in _assigned(ast.parse(path.read_text("utf-8")))
        if BARE.fullmatch(name.id) and name.id.lstrip("_") not in NO_SUPERLATIVES
    ]
    assert found == []


def test_a_drive_is_one_class() -> None:
    found = {
        _name(path) for path in _files(".py") if re.search(r"^class Drive\b", path.read_text("utf-8"), re.M)
    }
    assert found == DRIVES


def test_what_is_excepted_is_there() -> None:
    """An exception that nothing needs any more is to be taken out."""
    assert [name for names in OWN_NAME.values() for name in names if not (ROOT / name).exists()] == []
    for word, names in OWN_NAME.items():
        for name in names:
            assert word in {each.lower() for each in PATTERN.findall((ROOT / name).read_text("utf-8"))}, name
