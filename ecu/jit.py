"""Compilation of kernels, and a cache that cannot go stale.

numba's disk cache checks a function's own file only: after an edit in a callee it would silently run
the old code. Kernels are therefore cached in a folder named after the text of every module with kernels or
constants of their package (and of `ecu`, whose kernels the laboratory calls).

`NUMBA_CACHE_DIR` chooses the place, default `~/.cache/brake-ecu`. What lies there is run (numba's cache is
pickle and machine code), so a place in which anybody else may put or exchange files is refused. With
`NUMBA_DISABLE_JIT=1` kernels run as plain Python (`ecu/interpreted.py`).
"""

import hashlib
import os
import re
import stat
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numba.core.event as numba_event

from ecu.errors import UserError
from ecu.interpreted import interpreted

Function = TypeVar("Function", bound=Callable[..., Any])

# A numba record or a row of a structured array: attributes by field name, typed by its dtype only.
Record = Any

# Kernels raise nothing and follow IEEE 754: x/0 is inf or NaN and is caught by the module's own checks.
OPTIONS = {"cache": True, "error_model": "numpy", "fastmath": False}

_CACHE_ROOT = Path(
    os.environ.get("NUMBA_CACHE_DIR")
    or Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "brake-ecu"
)


_IMPORTED = re.compile(rb"^from ([\w.]+) import (\([^)]*\)|.*)$", re.MULTILINE)
_CONSTANT = re.compile(rb"\b[A-Z][A-Z0-9_]+\b")


def sources_of_kernels(packages: Iterable[str]) -> dict[str, bytes]:
    """Return the text of every module with kernels, or with constants used in kernels, by name.

    A constant is upper case and imported by name.
    """
    texts = dict(_texts(packages))
    found = [name for name, text in texts.items() if b"@kernel" in text]
    for name in found:  # grows
        for module, names in _IMPORTED.findall(texts[name]):
            if (source := module.decode()) in texts and source not in found and _CONSTANT.search(names):
                found.append(source)
    return {name: texts[name] for name in sorted(found)}


def _texts(packages: Iterable[str]) -> Iterator[tuple[str, bytes]]:
    for package in packages:
        spec = find_spec(package)
        for root in (spec.submodule_search_locations or []) if spec else []:
            for path in Path(root).rglob("*.py"):
                parts = path.relative_to(root).with_suffix("").parts
                yield ".".join((package, *parts)).removesuffix(".__init__"), path.read_bytes()


@cache
def _folder(cache_name: str, packages: frozenset[str]) -> str:
    """Return the folder of compiled kernels; numba would fall back to one that can go stale."""
    digest = hashlib.sha256(numba.__version__.encode())
    for name, text in sources_of_kernels(packages).items():
        digest.update(name.encode())
        digest.update(text)
    folder = _CACHE_ROOT / f"{cache_name}-{digest.hexdigest()[:16]}"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError:
        writable = False
    else:
        writable = os.access(folder, os.W_OK)
    if not writable:
        raise UserError(str(folder), "", "cannot be written; set NUMBA_CACHE_DIR to a folder of yours")
    folder = folder.resolve()
    if found := open_to_others(folder):
        remedy = "chmod go-w it, or set NUMBA_CACHE_DIR to a folder of yours alone"
        raise UserError(str(found), "", f"others may put compiled kernels here, which are run; {remedy}")
    return str(folder)


def open_to_others(folder: Path) -> Path | None:
    """Return which of `folder` and those above it lets others put or exchange files, None: none does.

    Root, and whoever owns `/`, is trusted above it. In a sticky folder (`/tmp`) only owners exchange files.
    `folder` contains no links.
    """
    if not hasattr(os, "geteuid"):  # a system whose folders have no such owners
        return None
    own, above = {os.geteuid()}, {os.geteuid(), 0, os.stat("/").st_uid}  # `/` in a user namespace: nobody's
    for path in (folder, *folder.parents):
        found = path.stat()
        writers = found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
        if writers == stat.S_IWGRP and _of_one_user(found.st_gid):
            writers = 0
        if path != folder and found.st_mode & stat.S_ISVTX:
            writers = 0
        if writers or found.st_uid not in (own if path == folder else above):
            return path
    return None


def _of_one_user(group: int) -> bool:
    """Return whether a group is the user's own: many systems give each one, and let it write by default."""
    try:
        import grp
        import pwd

        found, user = grp.getgrgid(group), pwd.getpwuid(os.geteuid()).pw_name
    except (ImportError, KeyError):
        return False
    return found.gr_name == user and set(found.gr_mem) <= {user}


def compile_kernel(
    function: Function, cache_name: str, packages: frozenset[str], parallel: bool = False
) -> Function:
    """Compile `function` with numba (no Python objects, no fastmath) and cache it on disk.

    `cache_name` is the prefix of the cache's folder, `packages` hold the sources it depends on.

    Raises:
        UserError: there is no place for the cache.
    """
    if numba.config.DISABLE_JIT:
        return interpreted(function)
    numba.config.CACHE_DIR = _folder(cache_name, packages)
    return cast(Function, numba.njit(**OPTIONS, parallel=parallel)(function))


def kernel(function: Function) -> Function:
    """Compile a function of the ECU or of the laboratory. Raises UserError: see `compile_kernel`."""
    package = function.__module__.partition(".")[0]
    return compile_kernel(function, package, frozenset({"ecu", package}))


class CompileCounter(numba_event.Listener):  # type: ignore[misc]
    """Counter of compilations, none of which may follow the warm-up; `begins` is called before each."""

    def __init__(self, begins: Callable[[int], None] = lambda count: None) -> None:
        self.count = 0
        self._begins = begins
        numba_event.register("numba:compile", self)

    def on_start(self, event: numba_event.Event) -> None:
        self._begins(self.count)
        self.count += 1

    def on_end(self, event: numba_event.Event) -> None:
        pass
