"""The cache of compiled kernels is named after everything that a kernel is made of."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

from ecu import jit

ROOT = Path(__file__).parents[2]
FOLDERS = {"ecu": ROOT / "ecu", "brakelab": ROOT / "tools" / "brakelab"}


def names_in_kernels(module: ast.Module) -> set[str]:
    functions = (node for node in module.body if isinstance(node, ast.FunctionDef))
    kernels = (function for function in functions if "kernel" in map(ast.unparse, function.decorator_list))
    bodies = (ast.Module(kernel.body, []) for kernel in kernels)
    return {node.id for body in bodies for node in ast.walk(body) if isinstance(node, ast.Name)}


def constants_of_kernels(package: str) -> set[str]:
    """Modules of which a kernel takes a constant: numba compiles its value in."""
    found = set()
    for path in FOLDERS[package].rglob("*.py"):
        module = ast.parse(path.read_text("utf-8"))
        used = names_in_kernels(module)
        for node in ast.walk(module):
            if not isinstance(node, ast.ImportFrom):
                continue
            root, _, rest = (node.module or "").partition(".")
            taken = {name.name for name in node.names} & used
            if root in FOLDERS and taken:
                place = FOLDERS[root].joinpath(*filter(None, rest.split(".")))
                found |= (
                    {f"{node.module}.{name}" for name in taken} if place.is_dir() else {node.module or ""}
                )
    return found


@pytest.mark.parametrize("package", FOLDERS)
def test_whatever_a_kernel_takes_a_constant_from_counts(package: str) -> None:
    modules = constants_of_kernels(package)
    assert len(modules) > 5
    assert modules <= jit.sources_of_kernels({"ecu", package}).keys()


def test_a_module_of_neither_kind_does_not_count() -> None:
    assert "ecu.cli" not in jit.sources_of_kernels({"ecu"})


def test_without_a_place_for_the_cache_nothing_is_compiled_and_one_line_says_so(tmp_path: Path) -> None:
    place = tmp_path / "file"
    place.write_text("")
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(place)}
    command = [sys.executable, "-m", "ecu.cli", "doctor"]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"brake-ecu: {place}")
    assert done.stderr.count("\n") == 1
    assert "set NUMBA_CACHE_DIR" in done.stderr
