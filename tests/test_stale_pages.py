"""tools/stale_pages.py on a small checkout: one bench, the module that it measures, one configuration."""

import subprocess
from pathlib import Path

import pytest

from stale_pages import HEADER, code_of, judge

ROOT = Path(__file__).parents[1]
PAGE = "docs/results/brake.md"
BENCH = "from ecu import brake\n\nCONFIG = 'config/car.toml'\n"
BRAKE = '"""A brake."""\n\nGAIN = 2.0\n'
OLDER = "brake.md: of {}; changed since: {}"


def _git(checkout: Path, *words: str) -> str:
    who = ["-c", "user.name=t", "-c", "user.email=t@example.org", "-c", "commit.gpgsign=false"]
    return subprocess.run(
        ["git", *who, *words], cwd=checkout, capture_output=True, text=True, check=True
    ).stdout.strip()


def _write(checkout: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        path = checkout / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, "utf-8")


def _page(commit: str) -> str:
    return (
        f"# Brake\n\nMeasured on commit {commit}, config/suv.toml 0.\n\n`brake-ecu bench brake`, version 1.\n"
    )


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    _git(tmp_path, "init", "-q")
    code = {
        "ecu/brake.py": BRAKE,
        "ecu/other.py": "X = 1\n",
        "tools/brakelab/bench/brake.py": BENCH,
        "config/car.toml": "mass = 1500\n",
    }
    _write(tmp_path, code)
    _git(tmp_path, "add", "-A")
    _git(tmp_path, "commit", "-qm", "code")
    _write(tmp_path, {PAGE: _page(_git(tmp_path, "rev-parse", "--short=7", "HEAD"))})
    return tmp_path


@pytest.mark.parametrize(
    ("change", "older"),
    [
        ({}, ""),
        ({"ecu/brake.py": BRAKE.replace("2.0", "2.1")}, "ecu/brake.py"),
        ({"ecu/brake.py": BRAKE.replace("A brake", "One brake")}, ""),
        ({"ecu/brake.py": "# Torque per pressure.\n" + BRAKE}, ""),
        ({"ecu/brake.py": BRAKE + 'TEXT: Final = "What is measured."\n'}, ""),
        ({"ecu/other.py": "X = 2\n"}, ""),
        ({"config/car.toml": "mass = 1600\n"}, "config/car.toml"),
        (
            {
                "ecu/control/brake.py": BRAKE,
                "tools/brakelab/bench/brake.py": BENCH.replace("ecu", "ecu.control"),
            },
            "",
        ),
    ],
    ids=[
        "nothing",
        "constant",
        "docstring",
        "comment",
        "text",
        "module not loaded",
        "configuration",
        "moved",
    ],
)
def test_page_is_older_where_what_the_bench_loads_changed(
    checkout: Path, change: dict[str, str], older: str
) -> None:
    commit = _git(checkout, "rev-parse", "--short=7", "HEAD")
    _write(checkout, change)
    assert judge(checkout, checkout / PAGE) == (OLDER.format(commit, older) if older else "")


def test_dirty_measurement_counts_from_the_commit_that_brought_it(checkout: Path) -> None:
    dirty = _git(checkout, "rev-parse", "--short=7", "HEAD") + "-dirty"
    _write(checkout, {PAGE: _page(dirty), "ecu/brake.py": BRAKE.replace("2.0", "3.0")})
    assert judge(checkout, checkout / PAGE) == ""  # not committed: of this very code
    _git(checkout, "add", "-A")
    _git(checkout, "commit", "-qm", "brake: gain")
    assert judge(checkout, checkout / PAGE) == ""
    _write(checkout, {"ecu/brake.py": BRAKE.replace("2.0", "4.0")})
    commit = _git(checkout, "rev-parse", "--short", "HEAD")
    assert judge(checkout, checkout / PAGE) == OLDER.format(commit, "ecu/brake.py")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("# Brake\n", "brake.md: does not say what bench and commit it is of"),
        (_page("abcdef0"), "brake.md: commit abcdef0 is not in this clone"),
    ],
)
def test_page_that_cannot_be_judged(checkout: Path, text: str, said: str) -> None:
    _write(checkout, {PAGE: text})
    assert judge(checkout, checkout / PAGE) == said


@pytest.mark.parametrize("page", sorted((ROOT / "docs/results").glob("*.md")), ids=lambda page: page.stem)
def test_every_page_has_code_of_its_bench(page: Path) -> None:
    header = HEADER.search(page.read_text("utf-8"))
    assert header is not None
    assert any(path.suffix == ".py" for path in code_of(ROOT, header["bench"]))
