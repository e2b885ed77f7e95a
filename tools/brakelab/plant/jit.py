"""Compilation of the plant's kernels: numba with a cache that an edit of any plant module renews.

`NUMBA_CACHE_DIR` chooses the place, default `~/.cache/brake-ecu`.
"""

import hashlib
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])

# A numba record: attributes by field name, typed by its dtype only.
Record = Any


@cache
def _cache_folder() -> str:
    text = hashlib.sha256(numba.__version__.encode())
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        text.update(path.name.encode())
        text.update(path.read_bytes())
    root = os.environ.get("NUMBA_CACHE_DIR") or Path.home() / ".cache" / "brake-ecu"
    return str(Path(root) / f"plant-{text.hexdigest()[:16]}")


def kernel(function: Function) -> Function:
    """Compile `function` without Python objects and without fastmath, x/0 as IEEE 754 has it."""
    numba.config.CACHE_DIR = _cache_folder()
    return cast(Function, numba.njit(cache=True, error_model="numpy", fastmath=False)(function))


def parallel_kernel(function: Function) -> Function:
    """Compile `function` as `kernel` does; its `numba.prange` loops share the processor's cores."""
    numba.config.CACHE_DIR = _cache_folder()
    return cast(
        Function, numba.njit(cache=True, error_model="numpy", fastmath=False, parallel=True)(function)
    )
