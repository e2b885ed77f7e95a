"""tools/stale_pages.py on a small checkout: a bench, the module that it measures, golden figures."""

import subprocess
from pathlib import Path

import pytest

from stale_pages import ALSO, HEADER, LOOPS, MARK, OUTPUTS, TIMES, UNSEEN, code_of, judge, main

ROOT = Path(__file__).parents[1]
PAGES = sorted((ROOT / "docs/results").glob("*.md"))
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


GOLDEN = "single,mu_b_fl,abc,0.4\nbench brake,Torque,def 123,7\n"
RUNS = "from ecu import brake\n"


@pytest.mark.parametrize(
    ("golden", "change", "older"),
    [
        ("single,mu_b_fl,abc,0.4\n", {}, ""),
        ("single,mu_b_fl,abc,0.4\n", {OUTPUTS: "single,mu_b_fl,abd,0.5\n"}, "golden single"),
        ("single,mu_b_fl,abc,0.4\n", {OUTPUTS: "single,mu_b_fl,abc,0.4\nsingle,mu_b_fr,a,1\n"}, ""),
        ("single,mu_b_fl,abc,0.4\n", {OUTPUTS: "single,mu_b_fr,abc,0.4\n"}, "golden single"),
        (
            "split,mu_b_fl,abc,0.4\n",
            {OUTPUTS: "split,mu_b_fl,abc,0.4\nsingle,mu_b_fl,a,1\n"},
            "golden single",
        ),
        ("kona,mu_b_fl,abc,0.4\n", {OUTPUTS: "kona,mu_b_fl,abd,0.5\n"}, ""),
        ("single,mu_b_fl,abc,0.4\n", {"ecu/brake.py": BRAKE.replace("2.0", "2.1")}, ""),
        ("single,mu_b_fl,abc,0.4\n", {"config/car.toml": "mass = 1600\n"}, "config/car.toml"),
        (GOLDEN, {OUTPUTS: GOLDEN.replace("abc", "abd")}, ""),
        (GOLDEN, {OUTPUTS: GOLDEN.replace("def 123,7", "def 124,8")}, "golden bench brake"),
        (GOLDEN, {"tools/brakelab/bench/brake.py": BENCH + "CARS = 3\n"}, ""),
    ],
    ids=[
        "nothing",
        "loop",
        "another output of the loop",
        "output gone",
        "loop that was not there",
        "recorded drive",
        "module that the golden run loads",
        "configuration of the bench",
        "loop, for a bench with tables",
        "table of the bench",
        "bench with tables: its module",
    ],
)
def test_page_is_stale_where_the_golden_figures_that_it_rests_on_changed(
    checkout: Path, golden: str, change: dict[str, str], older: str
) -> None:
    _write(checkout, {OUTPUTS: golden, "tests/golden/test_golden.py": RUNS})
    _git(checkout, "add", "-A")
    _git(checkout, "commit", "-qm", "golden")
    commit = _git(checkout, "rev-parse", "--short=7", "HEAD")
    _write(checkout, {PAGE: _page(commit), **change})
    assert judge(checkout, checkout / PAGE) == (OLDER.format(commit, older) if older else "")


def test_times_are_measured_for_each_version(checkout: Path) -> None:
    page = _page("abcdef0").replace("bench brake", "bench play")
    _write(checkout, {PAGE: page, "pyproject.toml": '[project]\nversion = "1"\n'})
    assert judge(checkout, checkout / PAGE) == ""
    _write(checkout, {"pyproject.toml": '[project]\nversion = "1.1"\n'})
    assert judge(checkout, checkout / PAGE) == "brake.md: of version 1, this is 1.1"


def test_a_check_fails_where_a_page_does_not_say_that_it_is_stale(
    checkout: Path, tmp_path_factory: pytest.TempPathFactory, capsys: pytest.CaptureFixture[str]
) -> None:
    before, check, mark = (checkout / PAGE).read_text(), ["--check", str(checkout)], ["--mark", str(checkout)]
    assert main(check) == 0
    assert capsys.readouterr().out == "0 of 1 pages of docs/results are stale\n"
    _write(checkout, {"ecu/brake.py": "GAIN = 2.2\n"})
    assert main([str(checkout)]) == 0
    assert main(check) == 1
    assert main(mark) == main(mark) == main(check) == 0
    assert (checkout / PAGE).read_text() == before.replace("0.\n", f"0.\n\n{MARK}\n", 1)
    _write(checkout, {"ecu/brake.py": BRAKE})
    assert main(check) == 1
    assert main(mark) == 0
    assert (checkout / PAGE).read_text() == before
    _git(checkout, "commit", "-qam", "more", "--allow-empty")
    shallow = tmp_path_factory.mktemp("shallow") / "clone"
    _git(checkout, "clone", "-q", "--depth", "1", f"file://{checkout}", str(shallow))
    _write(shallow, {PAGE: _page("abcdef0")})
    assert main(["--check", str(shallow)]) == 0


def test_the_runs_and_modules_that_it_names_are_there() -> None:
    runs = {line.partition(",")[0].strip('"') for line in (ROOT / OUTPUTS).read_text("utf-8").splitlines()}
    assert {*LOOPS, *(run for others in ALSO.values() for run in others)} <= runs
    assert {*ALSO, *TIMES} <= {HEADER.search(page.read_text("utf-8"))["bench"] for page in PAGES}
    for name in UNSEEN:
        assert (ROOT / f"tools/{name.replace('.', '/')}.py").exists()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_page_has_code_of_its_bench(page: Path) -> None:
    header = HEADER.search(page.read_text("utf-8"))
    assert header is not None
    assert any(path.suffix == ".py" for path in code_of(ROOT, header["bench"])) or header["bench"] in TIMES
