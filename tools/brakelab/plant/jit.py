"""Kernels of the plant: compiled as the ECU's are, with a cache that only an edit of the plant renews."""

from collections.abc import Callable
from typing import Any, TypeVar

from ecu.jit import Record, compile_kernel

__all__ = ["Record", "kernel", "parallel_kernel"]

Function = TypeVar("Function", bound=Callable[..., Any])

_PLANT = frozenset({"brakelab.plant"})


def kernel(function: Function) -> Function:
    """Compile a function of the plant. Raises UserError: see `ecu.jit.compile_kernel`."""
    return compile_kernel(function, "plant", _PLANT)


def parallel_kernel(function: Function) -> Function:
    """Compile `function` as `kernel` does; its `numba.prange` loops share the processor's cores."""
    return compile_kernel(function, "plant", _PLANT, parallel=True)
