"""Mutation testing: does a module's own test notice when the module is wrong?

    python tools/mutate.py [MODULE…] [--every N]       of `TESTS`, or all of them

Changes one comparison, operator, constant or condition at a time and runs the module's tests, with kernels as
plain Python; each mutant is a fork of one process that has loaded the libraries. Prints what survives. Exit
code 1 if anything does that `tools/mutants.toml` does not argue, or if that file argues for a mutant that is
killed or no longer exists.
"""

import argparse
import ast
import contextlib
import copy
import importlib.abc
import importlib.util
import io
import os
import signal
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

CHECKOUT = Path(__file__).parent.parent
ARGUED = CHECKOUT / "tools" / "mutants.toml"

TESTS = {
    "ecu/algorithm/control/limiter.py": ("control/test_limiter.py", "control/test_left_right.py"),
    "ecu/algorithm/control/mode.py": ("control/test_mode.py",),
    "ecu/algorithm/control/slip_guard.py": ("control/test_slip_guard.py",),
    "ecu/bus/e2e.py": ("bus/test_e2e.py", "bus/test_request.py"),
    "ecu/bus/link.py": ("bus/test_link.py",),
    "ecu/bus/request.py": ("bus/test_request.py",),
    "ecu/bus/freshness.py": ("bus/test_freshness.py",),
    "ecu/algorithm/monitoring/plausibility.py": ("monitoring/test_plausibility.py",),
    "ecu/algorithm/estimation/joint/kalman.py": ("estimation/joint/test_kalman.py",),
}
"""The modules that are held to it, and their tests in tests/ecu."""
LIBRARIES = ("numba", "pytest", "hypothesis.strategies", "scipy.signal", "cantools", "can", "pydantic", "e2e")
TIMEOUT_S = 60
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


def mutants(source: str) -> Iterator[tuple[str, ast.Module]]:
    """Yield the name and the tree of every changed copy of a module.

    A name is `function: line of the source: before -> after`, with a number where there are several.
    """
    tree, lines = ast.parse(source), source.splitlines()
    seen: dict[str, int] = {}
    for place, (where, node) in enumerate(_nodes(tree)):
        for change in range(_changes(node)):
            mutated = copy.deepcopy(tree)
            other = next(n for k, (_, n) in enumerate(_nodes(mutated)) if k == place)
            before = ast.unparse(node).splitlines()[0]
            _change(other, change)
            line = lines[getattr(node, "lineno", 1) - 1].strip()
            name = f"{where}: {line}: {before} -> {ast.unparse(other).splitlines()[0]}"
            seen[name] = seen.get(name, 0) + 1
            yield (name if seen[name] == 1 else f"{name} ({seen[name]})"), ast.fix_missing_locations(mutated)


def _nodes(tree: ast.Module) -> Iterator[tuple[str, ast.AST]]:
    """Yield every node that runs, with the function that it is in."""
    for statement in tree.body:
        if isinstance(statement, ast.FunctionDef):
            for part in statement.body:
                yield from ((statement.name, node) for node in ast.walk(part))
        else:
            yield from (("", node) for node in ast.walk(statement))


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
        value: Any = node.value
        node.value = value + 1 if isinstance(value, int) else 2.0 * value if value else 1.0


class _Mutated(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Loads one module from a changed tree."""

    def __init__(self, module: str, tree: ast.Module) -> None:
        self._name = module.removesuffix(".py").replace("/", ".")
        self._path, self._tree = CHECKOUT / module, tree

    def find_spec(self, name: str, path: Any, target: Any = None) -> Any:
        if name != self._name:
            return None
        return importlib.util.spec_from_file_location(name, self._path, loader=self)

    def create_module(self, spec: Any) -> None:
        return None

    def exec_module(self, module: Any) -> None:
        exec(compile(self._tree, self._path, "exec"), module.__dict__)


def _start(module: str, tree: ast.Module) -> int:
    """Fork a process that runs the tests of `module`; its exit code 0: the mutant survives."""
    child = os.fork()
    if child:
        return child
    signal.alarm(TIMEOUT_S)
    quiet = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(quiet, stream)
    sys.meta_path.insert(0, _Mutated(module, tree))
    code = 1
    with contextlib.suppress(BaseException):
        import pytest

        tests = [str(CHECKOUT / "tests" / "ecu" / name) for name in TESTS[module]]
        options = ["-x", "-qq", "-p", "no:cacheprovider", "-p", "no:faulthandler", "--capture=no"]
        with contextlib.redirect_stdout(io.StringIO()):
            code = int(pytest.main([*options, *tests]))
    os._exit(code)


def _survivors(module: str, every: int, workers: int) -> tuple[int, list[str], set[str]]:
    """Return how many mutants were tried, which survive, and the names of all."""
    source = (CHECKOUT / module).read_text("utf-8")
    child = _start(module, ast.parse(source))
    if os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]):
        raise SystemExit(f"{module}: its tests fail without any change")
    running: dict[int, str] = {}
    survivors: list[str] = []
    names: set[str] = set()
    tried = 0

    def await_one() -> None:
        pid, status = os.wait()
        name = running.pop(pid)
        if status == 0:
            survivors.append(name)

    for number, (name, tree) in enumerate(mutants(source)):
        names.add(name)
        if number % every:
            continue
        tried += 1
        running[_start(module, tree)] = name
        if len(running) >= workers:
            await_one()
    while running:
        await_one()
    return tried, survivors, names


def main() -> int:
    """Run the mutants."""
    parser = argparse.ArgumentParser(description="Change a module in one place at a time and run its tests.")
    parser.add_argument("modules", nargs="*", metavar="MODULE", choices=[*TESTS, []], default=list(TESTS))
    parser.add_argument("--every", type=int, default=1, help="take every N-th mutant only")
    wanted = parser.parse_args()
    os.environ |= {"NUMBA_DISABLE_JIT": "1", "PYTHONDONTWRITEBYTECODE": "1", "OMP_NUM_THREADS": "1"}
    sys.path[:0] = [str(CHECKOUT), str(CHECKOUT / "tools")]
    sys.dont_write_bytecode = True
    os.chdir(CHECKOUT)
    for name in LIBRARIES:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    argued = tomllib.loads(ARGUED.read_text("utf-8")) if ARGUED.exists() else {}
    workers, wrong = min(4, os.cpu_count() or 1), 0
    total = [0, 0, 0]
    for module in wanted.modules:
        tried, survivors, names = _survivors(module, wanted.every, workers)
        reasons = argued.get(module, {})
        for name in sorted(set(survivors) - set(reasons)):
            print(f"SURVIVED {module} | {name}", flush=True)
        stale = set(reasons) - names if wanted.every > 1 else set(reasons) - set(survivors)
        for name in sorted(stale):
            what = "no longer exists" if name not in names else "is killed"
            print(f"ARGUED FOR BUT {what}: {module} | {name}")
        known = len(set(survivors) & set(reasons))
        wrong += len(survivors) - known + len(stale)
        total = [total[0] + tried, total[1] + tried - len(survivors), total[2] + known]
        print(f"{module}: {tried - len(survivors)} of {tried} killed, {known} argued", flush=True)
    print(f"all: {total[1]} of {total[0]} killed, {total[2]} argued, {wrong} wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
