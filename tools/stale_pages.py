"""Check for pages of docs/results whose figures may have moved since they were measured.

    python tools/stale_pages.py [--mark | --check] [CHECKOUT]

A page names the bench that wrote it and the commit it was measured on. It is stale where one of these
changed since:

- tables of that bench in tests/golden/outputs.csv, where it has some: they are its figures for two cars;
- else outputs of the closed loops there, and of the runs of `ALSO`; and modules that the bench loads and the
  golden runs do not, or a file of config/ that one of them names. Modules are compared by their syntax trees:
  docstrings, comments, imports and a move to another folder change no figure.

What golden runs give is the code's because `make test` and `make studies` hold it.
A page of times is measured for each version. `--mark` writes below the header of a stale page that it is
stale, and takes it out elsewhere; with `--check` the exit code is 1 where a page says something else. A
checkout without history checks nothing.
"""

import ast
import csv
import hashlib
import re
import subprocess
import sys
import tomllib
from functools import cache
from pathlib import Path

PACKAGES = {"ecu": "ecu", "brakelab": "tools/brakelab"}
"""Where the sources of each package are."""
BENCHES = ("bench", "studies")
"""Folders of brakelab that hold the benches."""
TIMES = ("", "lateness", "replay", "play")
"""Benches whose figures are times; "": the one without a name."""
GOLDEN = "tests/golden"
OUTPUTS = f"{GOLDEN}/outputs.csv"
LOOPS = ("single", "hand-over", "stop-3", "low-grip", "split", "faults/circuit-dead-diagonal")
"""Runs of `OUTPUTS` in which ECU and simulated vehicle move each other."""
ALSO = {
    "entries": ("mustang",),
    "vehicle": ("identify vehicle",),
    "thermal": ("identify thermal",),
    "wear": ("identify wear",),
    "dust": ("identify dust",),
    "cycles": ("identify wear", "identify dust"),
    "lab": ("bench friction", "identify wear"),
}
"""Runs of `OUTPUTS` that a bench rests on besides."""
UNSEEN = ("brakelab.plant.energy",)
"""Modules that golden runs load, but of which they show nothing."""
PRESENTATION = (
    "bench.command",
    "bench.registry",
    "results.chart",
    "results.text_table",
    "studies.output",
    "studies.study",
    "studies.accuracy.table",
)
"""Modules that write the page down; none of the figures is theirs."""
HEADER = re.compile(r"`brake-ecu bench ?(?P<bench>\w*)`, version (?P<version>\w+(\.\w+)*)")
MEASURED = re.compile(r"^Measured on commit (?P<commit>\w+)(?P<dirty>-dirty)?,.*$", re.MULTILINE)
MARK = "Stale: what these figures rest on has changed since; `python tools/stale_pages.py` says what."


@cache
def fingerprint(content: bytes) -> str:
    """Return a hash of the source's syntax tree without docstrings, imports and texts of pages."""
    tree = ast.parse(content)
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            node.body = [line for line in body if not _says_nothing(line)]  # type: ignore[attr-defined]
    return hashlib.sha256(ast.dump(tree).encode()).hexdigest()


def _says_nothing(line: ast.stmt) -> bool:
    text = isinstance(line, ast.Expr) and isinstance(line.value, ast.Constant)
    page = isinstance(line, ast.AnnAssign) and getattr(line.target, "id", "") in ("TEXT", "STUDY")
    return text or page or isinstance(line, ast.Import | ast.ImportFrom)


def _git(checkout: Path, *words: str, stdin: str = "") -> bytes:
    git = ["git", *words]
    return subprocess.run(git, cwd=checkout, input=stdin.encode(), capture_output=True, check=True).stdout


def _modules(checkout: Path) -> dict[str, Path]:
    """Return the file of every module, by its dotted name."""
    found = {}
    for package, folder in PACKAGES.items():
        for path in (checkout / folder).rglob("*.py"):
            if path.stem == "__init__" and not path.stat().st_size:
                continue
            parts = (package, *path.relative_to(checkout / folder).with_suffix("").parts)
            found[".".join(parts).removesuffix(".__init__")] = path
    return found


@cache
def _named(content: bytes) -> frozenset[str]:
    """Return the dotted names that a module may import, and its text constants."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(content)):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
            names.update(f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            names.add(node.value)
    return frozenset(names)


def _modules_of(bench: str, benches: list[str]) -> list[str]:
    """Return the module of a bench and those whose names begin with its own, else all of its folder."""
    own = [name for name in benches if re.search(rf"\.{bench}(_\w+)?$", name)]
    return own or [name for name in benches if f".{bench}." in name]


def _loaded(modules: dict[str, Path], start: list[str]) -> dict[str, frozenset[str]]:
    """Return the modules that those of `start` load, each with the names that it has."""
    seen: dict[str, frozenset[str]] = {}
    while start:
        name = start.pop()
        if name not in seen:
            seen[name] = _named(modules[name].read_bytes())
            start.extend(seen[name] & modules.keys() - seen.keys())
    return seen


def code_of(checkout: Path, bench: str) -> set[Path]:
    """Return the modules and configuration files that a bench depends on and no golden run shows."""
    modules = _modules(checkout)
    benches = [name for name in modules if name.startswith(tuple(f"brakelab.{one}." for one in BENCHES))]
    golden = {name for path in (checkout / GOLDEN).glob("test_*.py") for name in _named(path.read_bytes())}
    shown = _loaded(modules, sorted(golden & modules.keys())).keys() - set(UNSEEN)
    for name in (*shown, *(f"brakelab.{name}" for name in PRESENTATION)):
        modules.pop(name, None)
    own = [name for name in _modules_of(bench, benches) if name in modules]
    loaded = _loaded(modules, own)
    texts = {
        text for named in loaded.values() for text in named if re.fullmatch(r"config/[\w/-]+\.toml", text)
    }
    files = {checkout / text for text in texts}
    return {modules[name] for name in loaded} | {path for path in files if path.exists()}


def _golden(text: str) -> dict[str, dict[str, list[str]]]:
    """Return hashes and values of outputs.csv by run and part."""
    runs: dict[str, dict[str, list[str]]] = {}
    for run, part, *cells in csv.reader(text.splitlines()):
        runs.setdefault(run, {})[part] = cells
    return runs


def changed_golden(
    checkout: Path, commit: str, runs: tuple[str, ...], now: dict[str, dict[str, list[str]]]
) -> list[str]:
    """Return those of `runs` whose golden figures are not those of `commit`; new parts change no figure."""
    there = _git(checkout, "ls-tree", "--name-only", commit, "--", OUTPUTS).strip()
    before = _golden(_git(checkout, "show", f"{commit}:{OUTPUTS}").decode()) if there else {}
    return [
        f"golden {run}"
        for run in runs
        if run not in before or any(now[run].get(part) != cells for part, cells in before[run].items())
    ]


def _fingerprint_of(path: str, content: bytes) -> str:
    return fingerprint(content) if path.endswith(".py") else hashlib.sha256(content).hexdigest()


@cache
def _content_at(checkout: Path, blob: str) -> bytes:
    return _git(checkout, "cat-file", "blob", blob)


def changed_since(checkout: Path, commit: str, files: set[Path]) -> list[str]:
    """Return those of `files`, as paths in the checkout, whose code is not found in `commit`."""
    tree = _git(checkout, "ls-tree", "-r", commit, "--", *PACKAGES.values(), "config").decode()
    blobs = {path: line.split()[2] for line, _, path in (row.partition("\t") for row in tree.splitlines())}
    changed = {path for path in files if _content_differs(checkout, path, blobs)}
    if not changed:
        return []
    suffixes = (".py", ".toml")
    before = {
        _fingerprint_of(path, _content_at(checkout, blob))
        for path, blob in blobs.items()
        if path.endswith(suffixes)
    }
    return sorted(
        str(path.relative_to(checkout))
        for path in changed
        if _fingerprint_of(path.name, path.read_bytes()) not in before
    )


def _content_differs(checkout: Path, path: Path, blobs: dict[str, str]) -> bool:
    blob = blobs.get(str(path.relative_to(checkout)))
    return blob is None or _content_at(checkout, blob) != path.read_bytes()


def _commit_of(checkout: Path, page: Path, measured: re.Match[str]) -> str:
    """Return the commit to compare with; of a dirty measurement the one that brought its line, or ""."""
    if not measured["dirty"]:
        return measured["commit"]
    relative = str(page.relative_to(checkout))
    return _git(checkout, "log", "-1", "--format=%h", f"-S{measured[0]}", "--", relative).decode().strip()


def judge(checkout: Path, page: Path) -> str:
    """Return one line on a page that is stale or cannot be judged, "" where its figures stand."""
    text = page.read_text("utf-8")
    header, measured = HEADER.search(text), MEASURED.search(text)
    if header is None or measured is None:
        return f"{page.name}: does not say what bench and commit it is of"
    bench = header["bench"]
    if bench in TIMES:
        now = version(checkout)
        return (
            "" if header["version"] == now else f"{page.name}: of version {header['version']}, this is {now}"
        )
    try:
        commit = _commit_of(checkout, page, measured)
        changed = _changed(checkout, commit, bench) if commit else []
    except subprocess.CalledProcessError:
        return f"{page.name}: commit {measured['commit']} is not in this clone"
    if not changed:
        return ""
    more = f" and {len(changed) - 3} more" if len(changed) > 3 else ""
    return f"{page.name}: of {commit}; changed since: {', '.join(changed[:3])}{more}"


def _changed(checkout: Path, commit: str, bench: str) -> list[str]:
    path = checkout / OUTPUTS
    golden = _golden(path.read_text("utf-8")) if path.exists() else {}
    own = f"bench {bench}"
    if own in golden:
        return changed_golden(checkout, commit, (own,), golden)
    runs = tuple(run for run in (*LOOPS, *ALSO.get(bench, ())) if run in golden)
    code = changed_since(checkout, commit, code_of(checkout, bench))
    return changed_golden(checkout, commit, runs, golden) + code


def version(checkout: Path) -> str:
    """Return the version of the project."""
    return str(tomllib.loads((checkout / "pyproject.toml").read_text("utf-8"))["project"]["version"])


def marked(page: Path, stale: bool) -> str:
    """Return the text of a page that says whether it is stale."""
    text = page.read_text("utf-8").replace(f"\n{MARK}\n", "")
    return MEASURED.sub(lambda line: f"{line[0]}\n\n{MARK}", text, count=1) if stale else text


def has_history(checkout: Path, pages: list[Path]) -> bool:
    """Return whether the checkout has the history of the pages: no copy of the last state alone."""
    found = (MEASURED.search(page.read_text("utf-8")) for page in pages)
    commits = "\n".join(f"{measured['commit']}^{{commit}}" for measured in found if measured)
    try:
        shallow = _git(checkout, "rev-parse", "--is-shallow-repository").strip() == b"true"
        return not shallow and b" commit " in _git(checkout, "cat-file", "--batch-check", stdin=commits)
    except (OSError, subprocess.CalledProcessError):
        return False


def main(arguments: list[str]) -> int:
    """Print a line for each page that is stale, and write or check what the pages say of it."""
    folders = [argument for argument in arguments if not argument.startswith("--")]
    checkout = Path(folders[0] if folders else Path(__file__).parent.parent).resolve()
    pages = sorted((checkout / "docs/results").glob("*.md"))
    verdicts = {page: judge(checkout, page) for page in pages}
    lines = [line for line in verdicts.values() if line]
    print(f"{len(lines)} of {len(pages)} pages of docs/results are stale", *lines, sep="\n  ")
    wrong = [page for page in pages if marked(page, bool(verdicts[page])) != page.read_text("utf-8")]
    if "--mark" in arguments:
        for page in wrong:
            page.write_text(marked(page, bool(verdicts[page])), "utf-8")
    elif "--check" in arguments and wrong and has_history(checkout, pages):
        names = ", ".join(page.name for page in wrong)
        print(f"{names}: measure anew (make results), or python tools/stale_pages.py --mark")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
