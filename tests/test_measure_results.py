"""tools/measure_results.py on a small checkout: what is measured, what is left, what one that fails does."""

import subprocess
from pathlib import Path

import pytest

from measure_results import TIMES, benches, measure_all

ROOT = Path(__file__).parents[1]
TEXT = "Measured on commit {}, config/suv.toml 0.\n\n`brake-ecu bench{}`, version 1.\n"


def _git(checkout: Path, *words: str) -> str:
    who = ["-c", "user.name=t", "-c", "user.email=t@example.org", "-c", "commit.gpgsign=false"]
    done = subprocess.run(["git", *who, *words], cwd=checkout, capture_output=True, text=True, check=True)
    return done.stdout.strip()


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """With pages of this code, of code with changes, of another commit and of one that is gone."""
    _git(tmp_path, "init", "-q")
    (tmp_path / "ecu").mkdir()
    (tmp_path / "docs/results").mkdir(parents=True)
    for gain in ("1.0", "2.0"):
        (tmp_path / "ecu/brake.py").write_text(f"GAIN = {gain}\n")
        _git(tmp_path, "add", "-A")
        _git(tmp_path, "commit", "-qm", "code")
    now, before = (_git(tmp_path, "rev-parse", "--short=7", name) for name in ("HEAD", "HEAD~1"))
    pages = {"now": (now, " now"), "dirty": (f"{now}-dirty", " dirty"), "before": (before, " before")}
    for name, said in {**pages, "times": ("abcdef0", "")}.items():
        (tmp_path / f"docs/results/{name}.md").write_text(TEXT.format(*said))
    return tmp_path


def _run(checkout: Path, names: list[str], failing: str = "") -> tuple[int, list[str]]:
    measured: list[str] = []

    def measure(bench: str) -> bool:
        measured.append(bench)
        return bench != failing

    return measure_all(checkout, names, measure, iter(range(100)).__next__), measured


@pytest.mark.parametrize(
    ("names", "failing", "code", "measured"),
    [
        ([], "", 0, ["before", "dirty", TIMES]),
        ([], "before", 1, ["before", "dirty", TIMES]),
        (["dirty", "now"], "", 0, ["dirty"]),
        (["gone"], "", 2, []),
    ],
    ids=["all", "one fails", "some", "no such bench"],
)
def test_what_is_not_of_this_code_is_measured_whatever_fails(
    checkout: Path, names: list[str], failing: str, code: int, measured: list[str]
) -> None:
    assert _run(checkout, names, failing) == (code, measured)


def test_it_goes_on_after_a_commit_of_pages_and_starts_again_after_one_of_code(checkout: Path) -> None:
    _git(checkout, "add", "-A")
    _git(checkout, "commit", "-qm", "pages")
    assert _run(checkout, ["now"]) == (0, [])
    (checkout / "ecu/brake.py").write_text("GAIN = 3.0\n")
    assert _run(checkout, ["now"]) == (0, ["now"])


def test_it_says_what_it_does_and_how_long_it_took(
    checkout: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _run(checkout, ["now", "before"], "before")
    out, err = capsys.readouterr()
    assert out.splitlines()[0] == "1 of 2: bench now, now.md: is of this code"
    assert out.splitlines()[2] == "2 of 2: bench before, before.md: failed after 1 s"
    assert err == "failed: before\n"


def test_every_page_is_measured() -> None:
    assert set(benches(ROOT).values()) == set((ROOT / "docs/results").glob("*.md"))
