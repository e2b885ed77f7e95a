"""One way to compile a kernel, and a cache that cannot go stale.

numba's disk cache looks at a function's own file only: after an edit in a callee it would silently run
the old code. Kernels are therefore cached in a folder named after the text of every kernel module of
their package (and of `ecu`, whose kernels the laboratory calls).

`NUMBA_CACHE_DIR` chooses the place, default `~/.cache/brake-ecu`. With `NUMBA_DISABLE_JIT=1` kernels run as
plain Python (`ecu/interpreted.py`).
"""

import hashlib
import os
from collections.abc import Callable
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


_CONSTANTS = frozenset(
    {"clock.py", "dust.py", "faults.py", "jit.py", "layout.py", "params.py", "records.py", "signals.py"}
)


def is_source_of_kernels(path: Path) -> bool:
    """Return whether a module holds kernels, or constants that are compiled into them."""
    return path.name in _CONSTANTS or b"@kernel" in path.read_bytes()


@cache
def _digest(package: str) -> str:
    text = hashlib.sha256(numba.__version__.encode())
    for name in sorted({"ecu", package}):
        spec = find_spec(name)
        for root in (spec.submodule_search_locations or []) if spec else []:
            for path in sorted(Path(root).rglob("*.py")):
                if is_source_of_kernels(path):
                    text.update(path.name.encode())
                    text.update(path.read_bytes())
    return text.hexdigest()[:16]


@cache
def _folder(package: str) -> str:
    """Return where the kernels of a package are kept. numba would turn to a place that can go stale."""
    folder = _CACHE_ROOT / f"{package}-{_digest(package)}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        writable = False
    else:
        writable = os.access(folder, os.W_OK)
    if not writable:
        raise UserError(str(folder), "", "cannot be written; set NUMBA_CACHE_DIR to a folder of yours")
    return str(folder)


def kernel(function: Function) -> Function:
    """Compile `function` with numba (no Python objects, no fastmath) and cache it on disk.

    Raises:
        UserError: there is no place for the cache.
    """
    if numba.config.DISABLE_JIT:
        return interpreted(function)
    numba.config.CACHE_DIR = _folder(function.__module__.partition(".")[0])
    return cast(Function, numba.njit(**OPTIONS)(function))


class CompileCounter(numba_event.Listener):  # type: ignore[misc]
    """Counts compilations from now on: after the warm-up there must be none. `begins` is called before."""

    def __init__(self, begins: Callable[[int], None] = lambda count: None) -> None:
        self.count = 0
        self._begins = begins
        numba_event.register("numba:compile", self)

    def on_start(self, event: numba_event.Event) -> None:
        self._begins(self.count)
        self.count += 1

    def on_end(self, event: numba_event.Event) -> None:
        pass
