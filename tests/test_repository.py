"""What holds for the repository as a whole."""

import ast
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from ecu import __version__
from ecu.cli import COMPILER, FLEET, LABORATORY, LEARN

ROOT = Path(__file__).parent.parent
LOCKS = sorted((ROOT / "requirements").glob("*.txt"))
SOURCES = sorted([*(ROOT / "ecu").rglob("*.py"), *(ROOT / "tools").rglob("*.py")])
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
IGNORED = {
    ".git",
    ".venv",
    "out",
    "build",
    "dist",
    "__pycache__",
    ".mypy_cache",
    ".ruff_cache",
    ".pytest_cache",
    ".hypothesis",
}
TEXTS = {".cfg", ".json", ".lock", ".md", ".sh", ".toml", ".txt", ""}
INDEX_ADDRESS = re.compile(
    r"https?://\S*/(simple|packages|-)/|--(extra-)?index-url|--find-links|files\.pythonhosted"
)


def _texts() -> Iterator[Path]:
    for path in ROOT.rglob("*"):
        if not IGNORED.intersection(path.relative_to(ROOT).parts) and path.suffix in TEXTS and path.is_file():
            yield path


def _imports(path: Path) -> Iterator[tuple[str, bool]]:
    """Names that a module imports, and whether only inside a function."""
    tree = ast.parse(path.read_text("utf-8"))
    inside = {
        id(node)
        for function in ast.walk(tree)
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef)
        for node in ast.walk(function)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, id(node) in inside
        elif isinstance(node, ast.ImportFrom):
            yield node.module or "", id(node) in inside


def _requirements(lock: Path) -> dict[str, set[str]]:
    """Pinned versions by name; a version may hold for some Pythons or systems only."""
    versions: dict[str, set[str]] = {}
    for name, version in re.findall(r"^([\w.\-]+)==([^\\\n;]+)", lock.read_text("utf-8"), re.MULTILINE):
        versions.setdefault(name, set()).add(version.strip())
    return versions


def test_no_file_names_a_package_index() -> None:
    found = [str(path) for path in _texts() if INDEX_ADDRESS.search(path.read_text("utf-8", errors="ignore"))]
    assert found == []


@pytest.mark.parametrize("lock", LOCKS, ids=lambda path: path.name)
def test_every_requirement_is_pinned_with_a_hash(lock: Path) -> None:
    entries = re.sub(r"\\\n", " ", lock.read_text("utf-8")).splitlines()
    assert entries
    for entry in entries:
        assert re.match(r"[\w.\-]+==\S+ .*--hash=sha256:[0-9a-f]{64}", entry), entry[:80]


def test_the_locks_agree() -> None:
    """The development set holds the others at the same versions: `make test` after `make demo` only adds."""
    everything = _requirements(ROOT / "requirements/dev.txt")
    for lock in ("onboard", "lab", "metrics"):
        for name, versions in _requirements(ROOT / f"requirements/{lock}.txt").items():
            assert versions <= everything.get(name, set()), f"{lock}.txt: {name}"


def test_the_locks_hold_what_the_project_asks_for() -> None:
    def names(requirements: list[str]) -> set[str]:
        return {re.split(r"[\[>=<]", requirement)[0] for requirement in requirements}

    project, extras = PROJECT["project"], PROJECT["project"]["optional-dependencies"]
    onboard = names(project["dependencies"])
    laboratory = names(extras["lab"])
    assert laboratory == {*LABORATORY, *COMPILER}
    assert names(extras["compiler"]) == set(COMPILER)
    assert names(extras["compiler"]) <= _requirements(ROOT / "requirements/compiler.txt").keys()
    assert names(extras["fleet"]) == set(FLEET)
    assert names(extras["learn"]) == {"scikit-learn"}, "installs sklearn"
    assert not names(extras["metrics"]) & _requirements(ROOT / "requirements/onboard.txt").keys()
    assert names(extras["metrics"]) == _requirements(ROOT / "requirements/metrics.txt").keys()
    assert onboard <= _requirements(ROOT / "requirements/onboard.txt").keys()
    assert onboard | laboratory <= _requirements(ROOT / "requirements/lab.txt").keys()
    assert names(extras["dev"]) - {"brake-ecu"} <= _requirements(ROOT / "requirements/dev.txt").keys()
    assert not laboratory & _requirements(ROOT / "requirements/onboard.txt").keys()


def test_the_version_is_stated_once_for_package_and_program() -> None:
    assert PROJECT["project"]["version"] == __version__
    laboratory = tomllib.loads((ROOT / "tools/pyproject.toml").read_text("utf-8"))["project"]
    assert laboratory["version"] == __version__
    assert laboratory["dependencies"] == [f"brake-ecu[lab]=={__version__}"]
    assert f"## {__version__}" in (ROOT / "CHANGELOG.md").read_text("utf-8")


def test_the_supported_pythons_are_the_same_everywhere() -> None:
    first, beyond = re.fullmatch(r">=3\.(\d+),<3\.(\d+)", PROJECT["project"]["requires-python"]).groups()
    minors = range(int(first), int(beyond))
    laboratory = tomllib.loads((ROOT / "tools/pyproject.toml").read_text("utf-8"))["project"]
    assert laboratory["requires-python"] == PROJECT["project"]["requires-python"]
    stated = [one for one in PROJECT["project"]["classifiers"] if one.startswith("Programming Language")]
    assert stated == [f"Programming Language :: Python :: 3.{minor}" for minor in minors]
    finder = (ROOT / "tools/find-python.sh").read_text("utf-8")
    assert " | ".join(f"3.{minor}.*" for minor in minors) in finder
    assert f"use Python 3.{minors[0]} to 3.{minors[-1]}" in (ROOT / "ecu/doctor.py").read_text("utf-8")
    assert f"Python 3.{minors[0]} to 3.{minors[-1]} " in (ROOT / "README.md").read_text("utf-8")
    assert f"--python-version 3.{minors[0]} " in (ROOT / "tools/lock.sh").read_text("utf-8")


def test_onboard_code_loads_no_laboratory() -> None:
    """Every module of `ecu` but the builder's is imported in a process; then none of these may be loaded."""
    script = (
        "import importlib, pkgutil, sys, ecu\n"
        "for module in pkgutil.walk_packages(ecu.__path__, 'ecu.'):\n"
        "    if not module.name.startswith('ecu.build'):\n"
        "        importlib.import_module(module.name)\n"
        "print(*{name.partition('.')[0] for name in sys.modules})\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script],
        cwd=ROOT,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},  # as with the library: nothing is compiled
        capture_output=True,
        text=True,
        check=True,
    )
    laboratory = {"brakelab", "matplotlib", "asammdf", "prometheus_client", "tornado", *LABORATORY, *LEARN}
    assert not {*laboratory, *COMPILER} & set(done.stdout.split())


def test_ecu_never_imports_the_laboratory() -> None:
    for path in (ROOT / "ecu").rglob("*.py"):
        for name, _ in _imports(path):
            assert name.partition(".")[0] not in {"brakelab", *LABORATORY, *FLEET, *LEARN}, f"{path}: {name}"


def test_the_simulated_vehicle_knows_nothing_of_the_ecu() -> None:
    for path in (ROOT / "tools/brakelab/plant").rglob("*.py"):
        for name, _ in _imports(path):
            assert name.partition(".")[0] != "ecu" or path.name == "jit.py", f"{path}: {name}"
            assert not name.startswith("brakelab.") or name.startswith("brakelab.plant"), f"{path}: {name}"


def test_the_ecu_knows_nothing_of_the_simulated_vehicle() -> None:
    for path in (ROOT / "ecu").rglob("*.py"):
        assert "config/plant" not in path.read_text("utf-8"), path


SHARED = ("brake", "estimate", "inputs", "vehicle")
WALLS = [
    # part of the algorithm, what it may not import: between them is ESTIMATE
    ("control", "estimation"),
    ("monitoring", "estimation"),
    ("publish", "estimation"),
    ("estimation", "control"),
    ("estimation", "monitoring"),
    ("estimation/joint", "estimation/thesis"),
    ("estimation/thesis", "estimation/joint"),
    *((shared, part) for shared in SHARED for part in ("control", "estimation", "monitoring")),
]


@pytest.mark.parametrize(("part", "other"), WALLS)
def test_estimating_and_using_know_each_other_by_the_estimate_alone(part: str, other: str) -> None:
    algorithm = ROOT / "ecu/algorithm"
    paths = [*algorithm.glob(f"{part}.py"), *(algorithm / part).rglob("*.py")]
    assert paths
    for path in paths:
        for name, _ in _imports(path):
            assert not name.startswith(f"ecu.algorithm.{other.replace('/', '.')}"), f"{path}: {name}"


OF_OBSERVERS = re.compile(
    r'\b(s\.|row\[")(motion|wheel_load|speed|joint|wheels|force|observer|friction|prediction)\b'
)


@pytest.mark.parametrize("part", ["control", "monitoring", "publish", "step"])
def test_what_uses_estimates_reads_no_record_of_an_observer(part: str) -> None:
    """Where all of the state is handed over, as `s`."""
    algorithm = ROOT / "ecu/algorithm"
    for path in [*algorithm.glob(f"{part}.py"), *(algorithm / part).rglob("*.py")]:
        assert not OF_OBSERVERS.search(path.read_text("utf-8")), path


def test_a_module_is_one_idea() -> None:
    lines = {path: len(path.read_text("utf-8").splitlines()) for path in SOURCES}
    long = {str(path.relative_to(ROOT)): count for path, count in lines.items() if count > 350}
    assert long == {}, "split it: 300 lines are the aim, 350 the limit"


TESTS = [path.relative_to(ROOT / "tests") for path in sorted((ROOT / "tests").rglob("test_*.py"))]
ACROSS = {"closed_loop", "golden", "system", "wide_world"}


def _has_a_module(test: Path) -> bool:
    source = (ROOT if test.parts[0] == "ecu" else ROOT / "tools") / test.parent
    words = test.stem.removeprefix("test_").split("_")
    names = ("_".join(words[:count]) for count in range(1, len(words) + 1))
    return any((source / name).is_dir() or (source / f"{name}.py").exists() for name in names)


def test_a_test_is_where_its_module_is() -> None:
    """The test of a/b.py, or of a package a/b, is a/test_b.py; of one aspect of it, a/test_b_aspect.py."""
    of_one = [path for path in TESTS if len(path.parts) > 1 and path.parts[0] not in ACROSS]
    lost = [str(path) for path in of_one if not _has_a_module(path)]
    assert lost == [], f"there is no module of that name; what concerns several is in {ACROSS}"


BRAKES = ("algorithm/control", "algorithm/monitoring", "bus", "contract", "recording", "runtime", "settings")
"""Below `tests/ecu`: `make test` runs all of them."""


def _studies(path: Path) -> Iterator[tuple[str, str]]:
    """Yield the tests of a file that are studies, each with its marks."""
    tree = ast.parse((ROOT / "tests" / path).read_text("utf-8"))
    of_all = [
        ast.unparse(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "pytestmark"
    ]
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
            marks = " ".join([*of_all, *map(ast.unparse, node.decorator_list)])
            if "pytest.mark.study" in marks:
                yield node.name, marks


def test_what_brakes_a_car_or_proves_a_requirement_is_no_study() -> None:
    studies = [(path, name, marks) for path in TESTS for name, marks in _studies(path)]
    assert len(studies) > 100
    for path, name, marks in studies:
        assert not path.as_posix().startswith(tuple(f"ecu/{folder}/" for folder in BRAKES)), f"{path}::{name}"
        assert "pytest.mark.requirement" not in marks, f"{path}::{name}"


DOCUMENTS = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md"))]


def _anchors(document: Path) -> set[str]:
    """Fragments that the headings of a document answer to."""
    headings = re.findall(r"^#+ +(.*)$", document.read_text("utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_relative_link_leads_somewhere(document: Path) -> None:
    for target in re.findall(r"\]\(\s*(?!https?:)([^)]+)\)", document.read_text("utf-8")):
        path, _, fragment = target.partition("#")
        linked = document.parent / path if path else document
        assert linked.exists(), target
        assert not fragment or fragment in _anchors(linked), target


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_row_of_a_table_has_the_cells_of_its_heading(document: Path) -> None:
    text = re.sub(r"```.*?```", "", document.read_text("utf-8"), flags=re.S)
    for table in re.findall(r"(?:^\|.*\n)+", text, re.M):
        rows = [re.sub(r"`[^`]*`", "", row) for row in table.splitlines()]
        cells = [len(re.findall(r"(?<!\\)\|", row)) for row in rows]
        assert set(cells) == {cells[0]}, rows[[each == cells[0] for each in cells].index(False)]


@pytest.mark.parametrize("page", sorted((ROOT / "docs/results").glob("*.md")), ids=lambda path: path.name)
def test_every_page_of_results_says_what_it_was_measured_on(page: Path) -> None:
    """By what command, on what commit, with what configuration: `tools/stale_pages.py` reads it."""
    text = page.read_text("utf-8")
    assert re.search(
        r"^Measured on commit [0-9a-f]{7}(-dirty)?, config/suv\.toml [0-9a-f]{12}\.$", text, re.M
    )
    assert re.search(r"`brake-ecu bench ?\w*`, version \d", text)


def test_the_index_of_the_documents_names_every_page() -> None:
    index = ROOT / "docs/README.md"
    linked = {
        (index.parent / path).resolve() for path in re.findall(r"\]\(([^)#]+)", index.read_text("utf-8"))
    }
    assert {*(ROOT / "docs").rglob("*.md")} - {index} <= linked


def test_what_is_said_to_be_touched_is_there() -> None:
    tables = "\n".join(re.findall(r"^\|.*", (ROOT / "docs/extending.md").read_text("utf-8"), re.M))
    files = re.findall(r"`((?:ecu|tools|tests|dbc|docs)/[\w./]+)`", tables.replace("/NAME/", "/"))
    assert len(files) > 30
    assert [name for name in files if not (ROOT / name).exists()] == []


def test_the_glossary_names_what_the_code_has() -> None:
    glossary = (ROOT / "docs/glossary.md").read_text("utf-8")
    cells = [row.rsplit("|", 2)[1] for row in re.findall(r"^\|.*\|$", glossary, re.MULTILINE)]
    names = {name for cell in cells for name in re.findall(r"`(\w+)`", cell)}
    words = {word for path in SOURCES for word in re.findall(r"\w+", path.read_text("utf-8"))}
    assert len(names) > 50
    assert names <= words, f"renamed or gone: {sorted(names - words)}"
