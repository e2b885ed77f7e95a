"""docs/requirements.md: the requirements of docs/safety.md and the tests that name them.

A test names what it proves by `@pytest.mark.requirement("REQ-DEM-1")`. The text of the tests is read; none is
run.
"""

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final, NamedTuple

ROOT: Final = Path(__file__).parent.parent
PAGE: Final = ROOT / "docs" / "requirements.md"
SAFETY: Final = ROOT / "docs" / "safety.md"
HEAD: Final = """# Requirements and their proofs

Requirements are those of [safety.md](safety.md#requirements); proofs are the tests that name them.
`make test` runs all; those of `tests/system/` need UDP multicast or vcan0, else they are skipped.

Written by `python tools/write_reference.py` from the table and the tests.

| requirement | what holds | proof |
| --- | --- | --- |
"""


class Proof(NamedTuple):
    """A test that names a requirement."""

    requirement: str
    test: Path
    name: str


def requirements() -> dict[str, str]:
    """Return what each requirement says, by identifier, in the order of the table."""
    return dict(re.findall(r"^\| (REQ-\w+-\d+) \| (.+) \|$", SAFETY.read_text("utf-8"), re.M))


def proofs() -> Iterator[Proof]:
    """Yield what the tests name, file by file."""
    for path in sorted((ROOT / "tests").rglob("test_*.py")):
        for node in ast.parse(path.read_text("utf-8")).body:
            if isinstance(node, ast.FunctionDef):
                for call in node.decorator_list:
                    if isinstance(call, ast.Call) and ast.unparse(call.func) == "pytest.mark.requirement":
                        yield from (Proof(ast.literal_eval(one), path, node.name) for one in call.args)


def requirements_text() -> str:
    """Return the page."""
    found = list(proofs())
    rows = []
    for identifier, says in requirements().items():
        tests = [
            f"`{one.name}` ([{one.test.stem}](../{one.test.relative_to(ROOT).as_posix()}))"
            for one in found
            if one.requirement == identifier
        ]
        rows.append(f"| {identifier} | {says} | {', '.join(tests) or '**none**'} |\n")
    return HEAD + "".join(rows)
