"""Kernels of a library give what numba's give, and are taken only where they were made from this text."""

import ast
import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest

from ecu import jit, library
from ecu.building.c_compiler import compiler
from ecu.building.machine_code import taken_spec

ROOT = Path(__file__).parents[2]
pytestmark = [
    pytest.mark.compiled,
    pytest.mark.skipif(compiler() is None, reason="no C compiler"),
]

LAWS = '''
"""Kernels of every kind of argument and of what is returned."""

from typing import NamedTuple

import numpy as np

from ecu.jit import kernel

ROW = np.dtype([("gain", "f8"), ("count", "i4"), ("values", "f8", (3,)), ("on", "u1")])
LIMIT = 2.0


class Pair(NamedTuple):
    first: np.ndarray
    second: float


@kernel
def inner(value):
    return min(value, LIMIT)


@kernel
def at(values, place):
    return values[place] + place


@kernel
def scalars(real, whole, flag, small):
    return inner(real) + whole + (100.0 if flag else 0.0) + small


@kernel
def record(row, gain):
    row.gain = gain
    row.values[1] += row.count
    return at(row.values, 1) - 1.0


@kernel
def rows(many):
    total = 0.0
    for k in range(len(many)):
        total += many[k].gain * many[k].values[2]
        many[k].on = 1
    return total, len(many), total > 1.0


@kernel
def matrix(values):
    total = 0.0
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            total += (i + 1) * (j + 10) * values[i, j]
    return total


@kernel
def pair(given, factor=3.0):
    return given.first.sum() * given.second * factor


@kernel
def same(given):
    return given


@kernel
def drawn(random, out):
    for k in range(len(out)):
        out[k] = random.normal(0.0, 1.0)


@kernel
def scratch(count):
    made = np.zeros(count)
    for k in range(count):
        made[k] = k * k
    return made.sum()


@kernel
def broken(values):
    out = np.zeros(2)
    out[:] = values
    return out[0]
'''

CALLS = """
import json, sys
import numpy as np
from thrown_away import laws

def results():
    row = np.zeros(2, laws.ROW)
    row["count"], row["values"], row["gain"] = 7, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], [0.5, 0.25]
    grid = np.arange(12.0).reshape(3, 4)
    sample = np.zeros(5)
    laws.drawn(np.random.default_rng(4), sample)
    return [
        laws.scalars(5.0, -3, True, np.float32(0.5)), laws.scalars(1.5, 2, False, np.float32(0.25)),
        laws.record(row[0], 8.0), row[0].tolist(), laws.rows(row), row.tolist(),
        laws.matrix(grid), laws.matrix(grid[::2, 1:]), laws.matrix(grid[::-1]),
        laws.pair(laws.Pair(np.ones(4), 2.0)), laws.pair(laws.Pair(np.ones(4), 2.0), 1.0),
        laws.same((1.0, 4, True)), sample.tolist(), laws.scratch(6),
    ]

def more():
    laws.inner(1)

def plain():
    return json.loads(json.dumps(results(), default=np.ndarray.tolist))
"""


class Package:
    """A package with kernels, and its library."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.inner = folder / "thrown_away", folder / "inner"
        self.folder.mkdir(parents=True)
        (self.folder / "__init__.py").write_text("")
        self.write(LAWS)
        (folder / "calls.py").write_text(CALLS)
        self.environment = {
            **os.environ,
            "PYTHONPATH": f"{ROOT}:{folder}",
            "NUMBA_CACHE_DIR": str(folder / "cache"),
            "PYTHONDONTWRITEBYTECODE": "1",
        }

    def write(self, laws: str) -> None:
        (self.folder / "laws.py").write_text(laws)

    def run(self, program: str, **environment: str) -> str:
        done = subprocess.run(
            [sys.executable, "-c", program],
            env={**self.environment, **environment},
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            raise RuntimeError(done.stdout + done.stderr)
        return done.stdout

    def make(self) -> None:
        self.run(
            "from ecu import build\n"
            "def load():\n    import calls; return calls.results\n"
            "def more():\n    import calls; return calls.more\n"
            "from pathlib import Path\n"
            f"inner = build.Inner(Path({str(self.inner)!r}), more)\n"
            "build.leave(build.make('thrown_away', load, True, inner))\n"
        )

    def results(self, **environment: str) -> tuple[str, bool]:
        """Return what all kernels give, and whether numba was loaded for it."""
        said = self.run(
            "import json, sys, calls\nprint(json.dumps(calls.plain()), 'numba' in sys.modules)",
            **environment,
        )
        found, _, numba = said.strip().rpartition(" ")
        return found, numba == "True"


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Package:
    made = Package(tmp_path_factory.mktemp("library"))
    made.make()
    return made


def test_a_library_gives_what_numba_gives_and_loads_no_numba(package: Package) -> None:
    found, numba = package.results()
    assert not numba
    assert (found, True) == package.results(BRAKE_ECU_LIBRARY="0")


def test_what_tests_alone_call_is_in_a_library_of_its_own(package: Package) -> None:
    """Whole numbers before real ones; a kernel that is called with a constant takes any number."""
    made = library.open_library(package.inner / "thrown_away")
    assert made is not None
    assert set(made.manifest["kernels"]) == {"thrown_away.laws.inner", "thrown_away.laws.at"}
    calls = {"inner": [(1,), (5.0,)], "at": [(np.array([3.0, 4.0, 6.0]), 2)]}
    found = []
    for name, rows in calls.items():
        for entry, row in zip(made.entries(f"thrown_away.laws.{name}"), rows, strict=True):
            block = entry.take(row)
            assert block is not None
            found.append(entry.call(block))
    assert found == [1.0, 2.0, 8.0]


def test_the_least_processor_gives_the_same(package: Package) -> None:
    least = (
        "import json, sys\nfrom ecu import library\nlibrary.has_v3 = lambda: False\n"
        "import calls\nprint(json.dumps(calls.plain()))"
    )
    assert package.run(least).strip() == package.results()[0]


def test_other_arguments_go_to_numba(package: Package) -> None:
    said = package.run(
        "import sys, numpy as np\nfrom thrown_away import laws\n"
        "whole = np.arange(6, dtype=np.int64).reshape(2, 3)\n"
        "print(laws.matrix(whole), laws.matrix(values=whole), 'numba' in sys.modules)"
    )
    assert said.split() == ["303.0", "303.0", "True"]


def test_what_numba_checks_is_an_error_here_too(package: Package) -> None:
    program = (
        "import numpy as np\nfrom thrown_away import laws\n"
        "try:\n    laws.{name}\nexcept Exception as error:\n    print(type(error).__name__, error)"
    )
    package.write(LAWS)
    assert "ValueError" in package.run(program.format(name="broken(np.ones(3))"))


def test_a_changed_text_is_compiled_and_a_changed_comment_elsewhere_is_not(package: Package) -> None:
    before, _ = package.results()
    package.write(LAWS.replace("LIMIT = 2.0", "LIMIT = 1.0"))
    changed, numba = package.results()
    package.write(LAWS)
    (package.folder / "page.py").write_text("WORDS = 'new'")
    assert numba
    assert changed != before
    assert package.results() == (before, False)


def test_a_damaged_library_is_left_aside(package: Package) -> None:
    manifest = package.folder / library.FOLDER / library.MANIFEST
    whole = manifest.read_bytes()
    try:
        manifest.write_bytes(whole[:100])
        assert package.results()[1]
    finally:
        manifest.write_bytes(whole)


def test_a_module_that_is_run_calls_its_kernels_too(package: Package) -> None:
    """The last of this package: its text is another then."""
    (package.folder / "laws.py").write_text(
        LAWS + "\nif __name__ == '__main__':\n    import sys\n"
        "    print(pair(Pair(np.ones(4), 2.0)), 'numba' in sys.modules)\n"
    )
    package.make()
    run = "import runpy; runpy.run_module('thrown_away.laws', run_name='__main__', alter_sys=True)"
    assert package.run(run).split() == ["24.0", "False"]


@pytest.mark.parametrize(
    ("wanted", "given", "fits"),
    [
        (1.0, 2.0, True),
        (1.0, 2, True),  # numba would compile it for whole numbers; the value is the same
        (1, 2.0, False),
        (1.0, np.float32(1.0), False),
        (True, 1, False),
        (np.zeros(2), np.ones(9), True),
        (np.zeros(2), np.zeros((2, 1)), False),
        (np.zeros(2), np.zeros(4)[::2], False),
        (np.zeros(4)[::2], np.zeros(2), True),
        (np.zeros(2), np.zeros(2, np.float32), False),
        (np.zeros(2), np.broadcast_to(1.0, 2), False),
        (np.broadcast_to(1.0, 2), np.zeros(4)[::2], True),
        ((1.0, 2), (3.0, 4), True),
        ((1.0, 2), (3.0, 4, 5), False),
        (np.zeros(1, "f8,i4")[0], np.zeros(1, "f8,i4")[0], True),
        (np.zeros(1, "f8,i4")[0], np.zeros(1, "f8,i8")[0], False),
        (np.zeros(1, [("a", "f8")])[0], np.zeros(1, [("b", "f8")])[0], False),
    ],
)
def test_an_argument_fits_where_numba_would_run_the_same_code(
    wanted: object, given: object, fits: bool
) -> None:
    specs = library.spec_of(wanted), library.spec_of(given)
    assert None not in specs
    assert specs == (taken_spec(numba.typeof(wanted)), taken_spec(numba.typeof(given)))
    assert library.fits(*specs) is fits


def _kernels_that_python_calls(package: str, but: tuple[str, ...] = ()) -> set[str]:
    """Return the kernels named outside kernels, by full name, but in modules that begin with one of `but`."""
    trees = {}
    root = Path(importlib.import_module(package).__file__ or "").parent
    for path in root.rglob("*.py"):
        name = ".".join((package, *path.relative_to(root).with_suffix("").parts)).removesuffix(".__init__")
        trees[name] = ast.parse(path.read_text("utf-8"))

    def is_kernel(node: ast.AST) -> bool:
        return isinstance(node, ast.FunctionDef) and any(
            isinstance(one, ast.Name) and one.id in ("kernel", "batch_kernel") for one in node.decorator_list
        )

    kernels = {(m, f.name) for m, tree in trees.items() for f in tree.body if is_kernel(f)}  # type: ignore[attr-defined]
    called = set()
    for module, tree in trees.items():
        if module.startswith(but):
            continue
        names = {
            alias.asname or alias.name: (node.module, alias.name)
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom) and node.module
            for alias in node.names
        }
        names |= {name: (of, name) for of, name in kernels if of == module}
        inside = {inner for node in ast.walk(tree) if is_kernel(node) for inner in ast.walk(node)}
        called |= {
            names[node.id]
            for node in ast.walk(tree)
            if isinstance(node, ast.Name) and node not in inside and names.get(node.id) in kernels
        }
    return {f"{module}.{name}" for module, name in called}


def test_a_library_holds_every_kernel_of_the_ecu_that_python_calls() -> None:
    program = (
        "from ecu.building.calls import Seen, watch\nwatch()\n"
        "from ecu.entries import call_every_entry\ncall_every_entry()\n"
        "print(*{call.kernel.name for call in Seen.calls.values()})"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert _kernels_that_python_calls("ecu") <= set(done.stdout.split())


@pytest.mark.study
def test_the_laboratory_s_library_holds_every_kernel_that_a_command_calls() -> None:
    """Only studies, benchmarks and the parts of the plant are compiled by numba when they are called."""
    made = jit.library("brakelab")
    if made is None or jit.library_of("brakelab.replay.engine") is None:
        pytest.skip("no library of these texts: python -m brakelab.build")
    called = _kernels_that_python_calls("brakelab", ("brakelab.studies", "brakelab.bench", "brakelab.plant"))
    assert called <= set(made.manifest["kernels"])


BRAKING = """
import hashlib, sys
from brakelab.simulation.closed_loop import new_loop, run
from brakelab.simulation.scenario import load_scenario
from ecu.settings.config import load_config
from ecu.settings.resources import resource

scenario, config = resource("config/scenarios/stop-1.toml"), resource("config/suv.toml")
loop = new_loop(load_scenario(scenario), load_config(config), 3)
drive = run(loop)
digest = hashlib.sha256()
for part in (*drive.outputs.values(), *drive.truth.values(), drive.frames):
    digest.update(part.tobytes())
print(digest.hexdigest(), len(drive.frames), "numba" in sys.modules)
"""


@pytest.mark.study  # numba compiles 800 functions one by one for it
def test_a_whole_stop_is_the_same_to_the_bit() -> None:
    for package in ("ecu", "brakelab"):
        spec = importlib.util.find_spec(package)
        root = Path(next(iter((spec and spec.submodule_search_locations) or [])))
        try:
            made = library.Library(root / library.FOLDER)
        except (OSError, ValueError):
            pytest.skip(f"no library of {package}: python -m brakelab.build")
        if not all(made.fits(module, jit.text_digest) for module in made.manifest["modules"]):
            pytest.skip(f"the library of {package} is of another text: python -m brakelab.build")
    found = {
        flag: subprocess.run(
            [sys.executable, "-c", BRAKING],
            env={**os.environ, "BRAKE_ECU_LIBRARY": flag},
            capture_output=True,
            text=True,
            check=True,
        ).stdout.split()
        for flag in ("1", "0")
    }
    assert found["1"][-1] == "False"
    assert found["0"][-1] == "True"
    assert found["1"][:-1] == found["0"][:-1]
