"""The cache of compiled kernels is named after everything that a kernel is made of."""

import ast
import grp
import os
import pwd
import subprocess
import sys
from pathlib import Path

import numba
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


PLACES = [
    # mode of the folder, of the one above it, whether the writing group is the user's own, the one at fault
    (0o700, 0o755, False, None),
    (0o755, 0o1777, False, None),
    (0o775, 0o775, True, None),
    (0o775, 0o755, False, "cache"),
    (0o757, 0o755, True, "cache"),
    (0o1777, 0o755, False, "cache"),  # what others put there is theirs, but is run
    (0o700, 0o775, False, "above"),
    (0o700, 0o777, True, "above"),
]


@pytest.mark.parametrize(("mode", "above", "own_group", "fault"), PLACES)
def test_a_cache_that_others_can_write_to_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mode: int, above: int, own_group: bool, fault: str | None
) -> None:
    folder = tmp_path / "above" / "cache"
    folder.mkdir(parents=True)
    folder.chmod(mode)
    folder.parent.chmod(above)
    monkeypatch.setattr(jit, "_of_one_user", lambda group: own_group)
    found = jit.open_to_others(folder)
    assert (found and found.name) == fault


def test_a_cache_of_another_user_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert jit.open_to_others(tmp_path) is None
    monkeypatch.setattr(os, "geteuid", lambda: 4711)
    assert jit.open_to_others(tmp_path) == tmp_path


def test_a_group_is_a_user_s_own_by_its_name_and_members(monkeypatch: pytest.MonkeyPatch) -> None:
    class Entry:
        pw_name, gr_name, gr_mem = "ann", "ann", ["ann"]

    monkeypatch.setattr(pwd, "getpwuid", lambda uid: Entry)
    monkeypatch.setattr(grp, "getgrgid", lambda gid: Entry)
    assert jit._of_one_user(1000)
    monkeypatch.setattr(Entry, "gr_mem", ["ann", "bob"])
    assert not jit._of_one_user(1000)
    monkeypatch.setattr(Entry, "gr_mem", [])
    monkeypatch.setattr(Entry, "gr_name", "staff")
    assert not jit._of_one_user(1000)


def test_kernels_in_a_folder_that_is_open_to_all_are_not_run(tmp_path: Path) -> None:
    tmp_path.chmod(0o777)
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-m", "ecu.cli", "doctor"]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        f"brake-ecu: {tmp_path}: others may put compiled kernels here, which are run; chmod go-w it, or set"
        " NUMBA_CACHE_DIR to a folder of yours alone\n"
    )


def test_the_cache_is_made_for_its_user_alone() -> None:
    assert Path(numba.config.CACHE_DIR).stat().st_mode & 0o777 == 0o700
