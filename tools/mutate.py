"""Mutation testing: does a module's own test notice when the module is wrong?

    python tools/mutate.py MODULE TEST [TEST…] [--every N]

Changes one comparison, operator, constant or condition at a time in a copy of the checkout, runs the tests
with kernels as plain Python and prints what survives. Exit code 1 if anything does that `EQUIVALENT` does not
list.
"""

import argparse
import ast
import copy
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

CHECKOUT = Path(__file__).parent.parent
COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
}
OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
}
TIMEOUT_S = 120.0
EQUIVALENT = {
    "ecu/algorithm/control/limiter.py": (
        "excess == 0.0",  # a shift by nothing
        "bounded > last + step",  # both branches give the same there
        "bounded < last - step",
    ),
}
"""What may survive, by a part of its line, since it is the same."""


def mutants(tree: ast.Module) -> Iterator[tuple[ast.Module, str, int]]:
    """Return every changed copy of a module, what was changed, and the line."""
    for place, node in enumerate(ast.walk(tree)):
        for change in range(_changes(node)):
            mutated = copy.deepcopy(tree)
            other = next(n for k, n in enumerate(ast.walk(mutated)) if k == place)
            before = ast.unparse(node)
            _change(other, change)
            yield mutated, f"{before} -> {ast.unparse(other)}", getattr(node, "lineno", 0)


def _changes(node: ast.AST) -> int:
    if isinstance(node, ast.Compare):
        return len(node.ops) if all(type(op) in COMPARISONS for op in node.ops) else 0
    if isinstance(node, ast.BinOp | ast.AugAssign):
        return int(type(node.op) in OPERATORS)
    if isinstance(node, ast.BoolOp):
        return 1 + len(node.values)
    if isinstance(node, ast.If | ast.IfExp):
        return 2
    if isinstance(node, ast.Constant):
        return int(isinstance(node.value, int | float) and not isinstance(node.value, bool))
    return 0


def _change(node: ast.AST, change: int) -> None:
    if isinstance(node, ast.Compare):
        node.ops[change] = COMPARISONS[type(node.ops[change])]()
    elif isinstance(node, ast.BinOp | ast.AugAssign):
        node.op = OPERATORS[type(node.op)]()
    elif isinstance(node, ast.BoolOp):
        if change == 0:
            node.op = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        else:
            del node.values[change - 1]
    elif isinstance(node, ast.If | ast.IfExp):
        node.test = ast.Constant(bool(change))
    elif isinstance(node, ast.Constant):
        value = node.value
        assert isinstance(value, int | float)
        node.value = value + 1 if isinstance(value, int) else 1.1 * value if value else 0.001


def _survives(copied: Path, tests: list[str]) -> bool:
    environment = os.environ | {
        "NUMBA_DISABLE_JIT": "1",
        "PYTHONPATH": f"{copied}:{copied / 'tools'}",
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests]
    try:
        done = subprocess.run(command, cwd=copied, env=environment, capture_output=True, timeout=TIMEOUT_S)
    except subprocess.TimeoutExpired:
        return False
    return done.returncode == 0


def main() -> int:
    """Run the mutants of one module."""
    parser = argparse.ArgumentParser(description="Change a module in one place at a time and run its tests.")
    parser.add_argument("module")
    parser.add_argument("tests", nargs="+")
    parser.add_argument("--every", type=int, default=1, help="take every N-th mutant only")
    wanted = parser.parse_args()
    tree = ast.parse((CHECKOUT / wanted.module).read_text("utf-8"))
    with tempfile.TemporaryDirectory() as folder:
        copied = Path(folder) / "checkout"
        shutil.copytree(CHECKOUT, copied, ignore=shutil.ignore_patterns(".git", "__pycache__", ".*_cache"))
        if not _survives(copied, wanted.tests):
            print(f"{wanted.module}: the tests fail without any change")
            return 2
        tried, survivors = 0, []
        for number, (mutated, what, line) in enumerate(mutants(tree)):
            if number % wanted.every:
                continue
            (copied / wanted.module).write_text(ast.unparse(ast.fix_missing_locations(mutated)), "utf-8")
            tried += 1
            known = any(part in what for part in EQUIVALENT.get(wanted.module, ()))
            if _survives(copied, wanted.tests) and not known:
                survivors.append(f"{wanted.module}:{line}: {what.splitlines()[0]}")
                print(f"SURVIVED {survivors[-1]}", flush=True)
    print(f"{wanted.module}: {tried - len(survivors)} of {tried} killed")
    return 1 if survivors else 0


if __name__ == "__main__":
    sys.exit(main())
