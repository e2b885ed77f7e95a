"""Kernels of the plant: compiled as the ECU's are."""

from collections.abc import Callable
from typing import Any, TypeVar

from ecu.jit import Record, interprets, kernel

__all__ = ["Record", "interprets", "kernel", "parallel_kernel"]

Function = TypeVar("Function", bound=Callable[..., Any])


def parallel_kernel(function: Function) -> Function:
    """Compile `function` as `kernel` does; its `numba.prange` loops share the processor's cores."""
    return kernel(function, parallel=True)
