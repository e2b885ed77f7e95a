"""The cache of compiled kernels is named after everything that a kernel is made of."""

import grp
import json
import os
import pwd
import subprocess
import sys
from pathlib import Path

import numba
import pytest

from ecu import jit
from ecu.algorithm.step import step

ROOT = Path(__file__).parents[2]
IMPORTS = {
    # of taking the constant: the text of a module with a kernel that returns `{}`
    "by name": ("from {package}.limits import GREATEST", "GREATEST"),
    "by another name": ("from {package}.limits import GREATEST as g", "g"),
    "of a module": ("from {package} import limits", "limits.GREATEST"),
    "of a module by another name": ("import {package}.limits as at", "at.GREATEST"),
    "by its whole name": ("import {package}.limits", "{package}.limits.GREATEST"),
    "in lower case": ("from {package}.limits import greatest", "greatest"),
    "by a relative import": ("from .limits import GREATEST", "GREATEST"),
    "of a relative module": ("from . import limits", "limits.GREATEST"),
    "from a folder below": ("from .below.further import GREATEST", "GREATEST"),
    "among others": ("from .limits import (  # (which)\n    OTHER,  # a)\n    GREATEST,\n)", "GREATEST"),
    "over two lines": ("from .limits import OTHER, \\\n    GREATEST", "GREATEST"),
    "all that there is": ("from .limits import *", "GREATEST"),
    "after another statement": ("OTHER = 1.0; from .limits import GREATEST", "GREATEST"),
    "inside a function": (
        "def made():\n    from .limits import GREATEST\n\n    return GREATEST\n\n\nMADE = made()", "MADE"
    ),
    "computed here": ("from .limits import GREATEST\n\nTWICE = 2.0 * GREATEST", "TWICE / 2.0"),
    "computed elsewhere": ("from .derived import TWICE", "TWICE / 2.0"),
    "handed on by the package": ("from {package} import handed_on", "handed_on"),
    "of another kernel": ("from .by_name import value as other", "other()"),
}  # fmt: skip


class Package:
    """A package with a module for each import, and `page`, which no kernel reaches."""

    def __init__(self, folder: Path) -> None:
        self.name, self.folder, self.cache = "thrown_away", folder / "thrown_away", folder / "cache"
        (self.folder / "below").mkdir(parents=True)
        self.cache.mkdir()
        self.write("__init__", "from .limits import GREATEST as handed_on")
        self.write("below/__init__", "")
        self.write("below/further", "from ..limits import GREATEST")
        self.write("derived", "from . import limits\n\nTWICE = 2.0 * limits.GREATEST")
        self.write("alone", self.kernel("NUMBER = 7.0", "NUMBER"))
        self.write("page", f"import {self.name}.alone")
        for kind, (imports, value) in IMPORTS.items():
            self.write(kind.replace(" ", "_"), self.kernel(imports, value))

    def kernel(self, imports: str, value: str) -> str:
        head, value = (text.replace("{package}", self.name) for text in (imports, value))
        return f"from ecu.jit import kernel\n{head}\n\n\n@kernel\ndef value():\n    return {value}"

    def write(self, module: str, text: str) -> None:
        (self.folder / f"{module}.py").write_text(text + "\n")

    def limit(self, value: float) -> None:
        self.write("limits", f"OTHER = 0.0\nGREATEST = greatest = {value}")

    def run(self, first: str = "") -> dict[str, tuple[float, bool]]:
        """Return what each kernel gives, in a process of its own, and whether it was compiled."""
        program = first + (
            "import importlib, json, sys\n"
            "package, *names = sys.argv[1:]\n"
            "kernels = [importlib.import_module(f'{package}.{name}').value for name in names]\n"
            "print(json.dumps([(k(), bool(k.stats.cache_misses)) for k in kernels]))"
        )
        names = ["alone", *(kind.replace(" ", "_") for kind in IMPORTS)]
        environment = {
            **os.environ, "PYTHONPATH": f"{ROOT}:{self.folder.parent}", "NUMBA_CACHE_DIR": str(self.cache),
            "PYTHONDONTWRITEBYTECODE": "1",
        }  # fmt: skip
        command = [sys.executable, "-c", program, self.name, *names]
        done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
        if done.returncode:
            raise RuntimeError(done.stderr)
        return dict(zip(names, map(tuple, json.loads(done.stdout)), strict=True))


def test_a_changed_constant_is_compiled_however_it_is_imported(tmp_path: Path) -> None:
    package = Package(tmp_path)
    package.limit(2.0)
    assert set(package.run().values()) == {(7.0, True), (2.0, True)}
    package.limit(3.0)
    package.write("page", "WORDS = 'new'")
    changed = package.run()
    assert changed.pop("alone") == (7.0, False)
    assert {kind: found for kind, found in changed.items() if found != (3.0, True)} == {}
    assert {compiled for _, compiled in package.run().values()} == {False}


READ_ONLY = """
import errno, os, tempfile

def refuse(path=None, *args, **kwargs):
    raise OSError(errno.EEXIST if path and os.path.exists(path) else errno.EROFS, "read-only", path)

os.mkdir = tempfile.TemporaryFile = refuse
os.access = lambda path, mode: not mode & os.W_OK
"""


def test_a_complete_cache_on_a_read_only_system_is_enough(tmp_path: Path) -> None:
    package = Package(tmp_path)
    package.limit(2.0)
    package.run()
    assert {compiled for _, compiled in package.run(READ_ONLY).values()} == {False}
    package.limit(3.0)
    with pytest.raises(RuntimeError) as refused:
        package.run(READ_ONLY)
    line = str(refused.value).splitlines()[-1]
    assert f"{package.cache}: lacks thrown_away.by_name.value and cannot be written; set NUMBA" in line


UNREADABLE = """
import os

real = os.scandir

def scandir(path="."):
    if str(path).startswith(os.environ["NUMBA_CACHE_DIR"]):
        raise PermissionError(13, "Permission denied", str(path))
    return real(path)

os.scandir = scandir
"""


def test_a_cache_that_cannot_be_read_is_one_line(tmp_path: Path) -> None:
    package = Package(tmp_path)
    package.limit(2.0)
    with pytest.raises(RuntimeError) as refused:
        package.run(UNREADABLE)
    assert "cannot be read (Permission denied); set NUMBA_CACHE_DIR" in str(refused.value).splitlines()[-1]


@pytest.mark.parametrize("package", ["ecu", "brakelab"])
def test_pages_and_commands_count_for_no_kernel(package: str) -> None:
    modules = jit.modules_with_kernels(package)
    assert len(modules) > 20
    for module in modules:
        counted = jit.sources_of_kernels(module)
        assert (
            not {"ecu.cli", "brakelab.cli.main", "brakelab.report.page", "ecu.watch.web"} & counted.keys()
        ), module


def test_the_cycle_s_kernel_counts_on_all_that_it_calls() -> None:
    counted = jit.sources_of_kernels("ecu.algorithm.step").keys()
    called = set(jit.modules_with_kernels("ecu")) - {"ecu.algorithm.step"}
    assert {name for name in called if name.startswith("ecu.algorithm.")} <= counted
    assert {"ecu.contract.signals", "ecu.contract.params"} <= counted


def test_kernels_of_tests_count_on_the_laboratory_s_too() -> None:
    counted = jit.sources_of_kernels("tests.brakelab.plant.conftest")
    assert {"brakelab.plant.vehicle", "brakelab.plant.lining"} <= counted.keys()


def numba_alone(cache: Path) -> dict[str, str]:
    """Return an environment without the library of kernels."""
    given = {"PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(cache), "BRAKE_ECU_LIBRARY": "0"}
    return {**os.environ, **given}


def test_without_a_place_for_the_cache_nothing_is_compiled_and_one_line_says_so(tmp_path: Path) -> None:
    place = tmp_path / "file"
    place.write_text("")
    environment = {
        **os.environ,
        "PYTHONPATH": str(ROOT),
        "NUMBA_CACHE_DIR": str(place),
        "BRAKE_ECU_LIBRARY": "0",
    }
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
@pytest.mark.requirement("REQ-SEC-2")
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


def test_a_cache_of_another_user_than_root_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert jit.open_to_others(tmp_path) is None
    if os.geteuid() == 0:
        os.chown(tmp_path, 4712, -1)
    monkeypatch.setattr(os, "geteuid", lambda: 4711)
    assert jit.open_to_others(tmp_path) == tmp_path


@pytest.mark.skipif(os.geteuid() != 0, reason="only root gives a folder to root")
def test_a_cache_of_root_is_run_by_its_users(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 4711)
    assert jit.open_to_others(tmp_path) is None


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


@pytest.mark.requirement("REQ-SEC-2")
def test_kernels_in_a_folder_that_is_open_to_all_are_not_run(tmp_path: Path) -> None:
    tmp_path.chmod(0o777)
    environment = {
        **os.environ,
        "PYTHONPATH": str(ROOT),
        "NUMBA_CACHE_DIR": str(tmp_path),
        "BRAKE_ECU_LIBRARY": "0",
    }
    command = [sys.executable, "-m", "ecu.cli", "doctor"]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        f"brake-ecu: {tmp_path}: others may put compiled kernels here, which are run; chmod go-w it, or set"
        " NUMBA_CACHE_DIR to a folder of yours alone\n"
    )


def test_the_cache_is_made_for_its_user_alone() -> None:
    made = jit.dispatcher(step.py_func)  # type: ignore[attr-defined]  # though a library may have it
    folder = Path(made._cache._impl._locator.get_cache_path())
    assert folder.parent.stat().st_mode & 0o777 == 0o700


def test_functions_of_others_are_not_cached_among_kernels(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba.config, "CACHE_DIR", "theirs")
    jit.dispatcher(step.py_func)
    assert numba.config.CACHE_DIR == "theirs"
