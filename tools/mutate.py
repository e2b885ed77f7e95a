"""Mutation testing: checks that a module's own test notices an error in the module.

    python tools/mutate.py [MODULE…] [--every N]       of `TESTS`, or all of them

Changes one comparison, operator, constant or condition at a time and runs the module's tests, with kernels as
plain Python; each mutant is a fork of the process that has collected them, and ends with the first test that
fails: those that killed most of the others go first. Prints the surviving mutants. Exit code 1 if one is not
justified in `tools/mutants.toml`, or if that file justifies a mutant that is killed or no longer exists.
"""

import argparse
import ast
import copy
import importlib
import inspect
import json
import math
import mmap
import os
import signal
import sys
import time
import tomllib
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

os.environ |= {"NUMBA_DISABLE_JIT": "1", "OMP_NUM_THREADS": "1"}

import numpy as np
import pytest
from hypothesis import Phase, settings

CHECKOUT = Path(__file__).parent.parent
ARGUED = CHECKOUT / "tools" / "mutants.toml"

SLIP_GUARD = (
    "algorithm/control/test_slip_guard_cycle.py",
    "algorithm/control/test_slip_guard.py",
    "algorithm/control/test_slip_guard_unseen.py",
)
TESTS = {
    "ecu/algorithm/control/limiter.py": (
        "algorithm/control/test_limiter.py",
        "algorithm/control/test_limiter_left_right.py",
    ),
    "ecu/algorithm/control/mode.py": ("algorithm/control/test_mode.py",),
    "ecu/algorithm/control/slip_guard.py": SLIP_GUARD,
    "ecu/algorithm/control/rear_guard.py": SLIP_GUARD,
    "ecu/algorithm/control/distribution.py": ("algorithm/control/test_distribution.py",),
    "ecu/bus/e2e.py": ("bus/test_e2e.py",),
    "ecu/bus/sequence.py": ("bus/test_sequence.py",),
    "ecu/bus/link.py": ("bus/test_link.py",),
    "ecu/bus/request.py": ("bus/test_request.py",),
    "ecu/bus/freshness.py": ("bus/test_freshness.py",),
    "ecu/algorithm/monitoring/witness.py": ("algorithm/monitoring/test_witness.py",),
    "ecu/algorithm/monitoring/plausibility.py": ("algorithm/monitoring/test_plausibility.py",),
    "ecu/algorithm/estimation/joint/kalman.py": ("algorithm/estimation/joint/test_kalman.py",),
}
"""The modules that are held to it, and their tests in tests/ecu."""
PATIENCE_S, SLOWER = 2.0, 5.0  # of the processor's time, allowed to a test beside its own and beyond it
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


def mutants(source: str) -> Iterator[tuple[str, list[ast.stmt]]]:
    """Yield the name of every change of a module, and the top-level statements that it changes.

    A name is `function: line of the source: before -> after`, with a number where there are several.
    """
    lines = source.splitlines()
    seen: dict[str, int] = {}
    body = ast.parse(source).body
    for number, statement in enumerate(body):
        follow = _following(statement, body[number + 1 :])
        for place, node in enumerate(_nodes(statement)):
            for change in range(_changes(node)):
                mutated = copy.deepcopy(statement)
                other = next(n for k, n in enumerate(_nodes(mutated)) if k == place)
                before = ast.unparse(node).splitlines()[0]
                _change(other, change)
                line = lines[getattr(node, "lineno", 1) - 1].strip()
                where = f"{statement.name}: " if isinstance(statement, ast.FunctionDef) else ""
                name = f"{where}{line}: {before} -> {ast.unparse(other).splitlines()[0]}"
                seen[name] = seen.get(name, 0) + 1
                yield (name if seen[name] == 1 else f"{name} ({seen[name]})"), [mutated, *follow]


def _following(changed: ast.stmt, rest: list[ast.stmt]) -> list[ast.stmt]:
    """Return the constants computed from those a statement defines, in their order."""
    follow: list[ast.stmt] = []
    names = _defined(changed)
    for statement in rest:
        used = {node.id for node in ast.walk(statement) if isinstance(node, ast.Name)}
        if isinstance(statement, ast.Assign | ast.AnnAssign) and used & names:
            names |= _defined(statement)
            follow.append(statement)
    return follow


def _defined(statement: ast.stmt) -> set[str]:
    if isinstance(statement, ast.FunctionDef):
        return {statement.name}
    nodes = (node for node in ast.walk(statement) if isinstance(node, ast.Name))
    return {node.id for node in nodes if isinstance(node.ctx, ast.Store)}


def _nodes(statement: ast.stmt) -> Iterator[ast.AST]:
    """Yield every node that is executed."""
    for part in statement.body if isinstance(statement, ast.FunctionDef) else [statement]:
        fields = {inner for node in ast.walk(part) if _is_field(node) for inner in ast.walk(node)}
        yield from (node for node in ast.walk(part) if node not in fields)


def _is_field(node: ast.AST) -> bool:
    """Return whether it lays out a field of a record: name and format."""
    kinds = [getattr(part, "value", None) for part in node.elts[:2]] if isinstance(node, ast.Tuple) else []
    return len(kinds) == 2 and all(isinstance(kind, str) for kind in kinds)


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


def _apply(module: ModuleType, statement: ast.stmt) -> None:
    """Replace a function's code, or redefine a constant, in a module in use."""
    if not isinstance(statement, ast.FunctionDef):
        _execute(statement, module.__dict__)
        return
    statement.decorator_list = []
    scope = dict(module.__dict__)
    _execute(statement, scope)
    inspect.unwrap(module.__dict__[statement.name]).__code__ = scope[statement.name].__code__


def _execute(statement: ast.stmt, scope: dict[str, Any]) -> None:
    tree = ast.fix_missing_locations(ast.Module([statement], []))
    exec(compile(tree, "<mutant>", "exec"), scope)


class Mutation:
    """Pytest plugin that runs the collected tests once for every mutant of `module`."""

    def __init__(self, module: str, every: int, workers: int) -> None:
        self._module, self._every, self._workers = module, every, workers
        self.tried = 0
        self.names: set[str] = set()
        self.survivors: list[str] = []
        self._running: dict[int, str] = {}
        self._test = 0

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection(self) -> None:
        """Use fixed examples; a failing one need not be minimised."""
        phases = (Phase.explicit, Phase.generate)
        settings.register_profile("mutants", settings.default, phases=phases, print_blob=False)
        settings.load_profile("mutants")

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Fork a process for each mutant."""
        module = importlib.import_module(self._module.removesuffix(".py").replace("/", "."))
        # Reports of the processes: seconds per test, number of mutants it was the first to kill
        self._seconds, self._kills = np.frombuffer(mmap.mmap(-1, 16 * len(session.items))).reshape(2, -1)
        self._start(session, module, "", [])
        self._await_one()
        if not self.survivors:
            raise pytest.UsageError(f"{self._module}: its tests fail without any change")
        self.survivors.clear()
        for number, (name, statements) in enumerate(mutants((CHECKOUT / self._module).read_text("utf-8"))):
            self.names.add(name)
            if number % self._every:
                continue
            self.tried += 1
            self._start(session, module, name, statements)
            if len(self._running) >= self._workers:
                self._await_one()
        while self._running:
            self._await_one()
        return True

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_makereport(self, call: pytest.CallInfo[None]) -> None:
        """Stop at the first failure, before a report is made."""
        if call.excinfo is None:
            return
        if call.excinfo.errisinstance(pytest.skip.Exception):
            self._seconds[self._test] = math.nan
        else:
            self._kills[self._test] += 1.0
            os._exit(1)

    def _start(
        self, session: pytest.Session, module: ModuleType, name: str, statements: list[ast.stmt]
    ) -> None:
        child = os.fork()
        if child:
            self._running[child] = name
            return
        try:
            for statement in statements:
                _apply(module, statement)
            self._run_tests(session, measure=not statements)
            os._exit(0)
        finally:
            os._exit(2)

    def _run_tests(self, session: pytest.Session, measure: bool) -> None:
        """Run those first that kill most a second; measured: all of them, else all that are not skipped."""
        order = list(range(len(session.items)))
        if not measure:
            rate = (1.0 + self._kills) / self._seconds
            order = [k for k in np.argsort(-rate) if math.isfinite(rate[k])]
        for k, following in zip(order, [*order[1:], None], strict=False):
            self._test = k
            began_s = time.process_time()
            patience_s = 0.0 if measure else float(PATIENCE_S + SLOWER * self._seconds[k])
            signal.setitimer(signal.ITIMER_PROF, patience_s)
            nextitem = None if following is None else session.items[following]
            session.config.hook.pytest_runtest_protocol(item=session.items[k], nextitem=nextitem)
            if measure:
                self._seconds[k] += time.process_time() - began_s

    def _await_one(self) -> None:
        pid, status = os.wait()
        name = self._running.pop(pid)
        if status == 0:
            self.survivors.append(name)


def _run(module: str, every: int, workers: int) -> dict[str, Any]:
    """Run the mutants of a module in a process of its own; return the results."""
    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        quiet = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1):
            os.dup2(quiet, stream)
        mutation = Mutation(module, every, workers)
        tests = [str(CHECKOUT / "tests" / "ecu" / name) for name in TESTS[module]]
        code = pytest.main(
            ["-qq", "-p", "no:cacheprovider", "-p", "no:timeout", "--capture=no", *tests], [mutation]
        )
        found = {"tried": mutation.tried, "survivors": mutation.survivors, "names": [*mutation.names]}
        with os.fdopen(writing, "w") as pipe:
            json.dump(found if code in (0, 5) else {}, pipe)
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading) as pipe:
        answer: dict[str, Any] = json.loads(pipe.read() or "{}")
    os.waitpid(child, 0)
    if not answer:
        raise SystemExit(f"{module}: its tests fail without any change")
    return answer


def main() -> int:
    """Run the mutants."""
    parser = argparse.ArgumentParser(description="Change a module in one place at a time and run its tests.")
    parser.add_argument("modules", nargs="*", metavar="MODULE", help="of those that are held to it")
    parser.add_argument("--every", type=int, default=1, help="take every N-th mutant only")
    wanted = parser.parse_args()
    os.chdir(CHECKOUT)
    sys.path[:0] = [str(CHECKOUT), str(CHECKOUT / "tools")]
    argued = tomllib.loads(ARGUED.read_text("utf-8")) if ARGUED.exists() else {}
    workers, wrong = min(4, os.cpu_count() or 1), 0
    total = [0, 0, 0]
    for module in wanted.modules or TESTS:
        found = _run(module, wanted.every, workers)
        survivors, names, reasons = set(found["survivors"]), set(found["names"]), set(argued.get(module, {}))
        for name in sorted(survivors - reasons):
            print(f"SURVIVED {module} | {name}", flush=True)
        stale = reasons - (names if wanted.every > 1 else survivors)
        for name in sorted(stale):
            what = "is killed" if name in names else "no longer exists"
            print(f"ARGUED FOR BUT {what}: {module} | {name}")
        known = len(survivors & reasons)
        wrong += len(survivors) - known + len(stale)
        killed = found["tried"] - len(survivors)
        total = [total[0] + found["tried"], total[1] + killed, total[2] + known]
        print(f"{module}: {killed} of {found['tried']} killed, {known} argued", flush=True)
    print(f"all: {total[1]} of {total[0]} killed, {total[2]} argued, {wrong} wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
