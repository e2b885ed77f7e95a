"""Check for pages of docs/results that are older than the code they describe.

    python tools/stale_pages.py [CHECKOUT]

A page names the bench that wrote it and the commit it was measured on. It is older than its code where a
module that the bench loads (imports, and `-m` names of processes), or a file of config/ that one of them
names, has changed since. Modules are compared by their syntax trees: docstrings, comments, imports and a move
to another folder change no figure. The exit code is always 0: the decision to measure again, which takes
hours, is left to people.
"""

import ast
import hashlib
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

PACKAGES = {"ecu": "ecu", "brakelab": "tools/brakelab"}
"""Where the sources of each package are."""
BENCHES = ("bench", "studies")
"""Folders of brakelab that hold the benches."""
TIMES = ("step", "codec", "plant", "cycle")
"""Benches of the page that `brake-ecu bench` without a name writes."""
PRESENTATION = (
    "bench.command",
    "bench.registry",
    "studies.output",
    "studies.study",
    "studies.accuracy.table",
)
"""Modules that write the page down; none of the figures is theirs."""
HEADER = re.compile(r"`brake-ecu bench ?(?P<bench>\w*)`")
MEASURED = re.compile(r"^Measured on commit (?P<commit>\w+)(?P<dirty>-dirty)?,.*$", re.MULTILINE)


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


def _git(checkout: Path, *words: str) -> bytes:
    return subprocess.run(["git", *words], cwd=checkout, capture_output=True, check=True).stdout


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


def _named(path: Path) -> set[str]:
    """Return the dotted names that a module may import, and its text constants."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
            names.update(f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            names.add(node.value)
    return names


def _modules_of(bench: str, benches: list[str]) -> list[str]:
    """Return the module of a bench and those whose names begin with its own, else all of its folder."""
    own = [name for name in benches if re.search(rf"\.{bench}(_\w+)?$", name)]
    return own or [name for name in benches if f".{bench}." in name]


def code_of(checkout: Path, bench: str) -> set[Path]:
    """Return the modules and configuration files that a bench depends on."""
    modules = _modules(checkout)
    benches = [name for name in modules if name.startswith(tuple(f"brakelab.{one}." for one in BENCHES))]
    todo = [name for start in ([bench] if bench else TIMES) for name in _modules_of(start, benches)]
    seen = {f"brakelab.{name}" for name in PRESENTATION}
    files: set[Path] = set()
    while todo:
        name = todo.pop()
        if name in seen:
            continue
        seen.add(name)
        files.add(modules[name])
        named = _named(modules[name])
        todo.extend(named & modules.keys())
        for text in named:
            if re.fullmatch(r"config/[\w/-]+\.toml", text) and (checkout / text).exists():
                files.add(checkout / text)
    return files


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
    """Return one line on a page that is older than its code or cannot be judged, "" where it is current."""
    text = page.read_text("utf-8")
    header, measured = HEADER.search(text), MEASURED.search(text)
    if header is None or measured is None:
        return f"{page.name}: does not say what bench and commit it is of"
    try:
        commit = _commit_of(checkout, page, measured)
        changed = changed_since(checkout, commit, code_of(checkout, header["bench"])) if commit else []
    except subprocess.CalledProcessError:
        return f"{page.name}: commit {measured['commit']} is not in this clone"
    if not changed:
        return ""
    more = f" and {len(changed) - 3} more" if len(changed) > 3 else ""
    return f"{page.name}: of {commit}; changed since: {', '.join(changed[:3])}{more}"


def main(checkout: Path) -> None:
    """Print a line for each page that is older than its code."""
    pages = sorted((checkout / "docs/results").glob("*.md"))
    lines = [line for line in (judge(checkout, page) for page in pages) if line]
    print(f"{len(lines)} of {len(pages)} pages of docs/results are older than their code", *lines, sep="\n  ")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent.parent).resolve())
