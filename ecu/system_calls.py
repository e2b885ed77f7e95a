"""Functions of Linux's C library for kernels, which call them by name without Python between.

Where kernels are plain Python, ctypes calls them. Addresses are whole numbers: `array.ctypes.data`.
"""

import ctypes
from functools import cached_property
from typing import Any, Final

from ecu.jit import compiler


class CFunction:
    """A function of the C library. Types are named as numpy names them: "int32"."""

    def __init__(self, name: str, returns: str, *arguments: str) -> None:
        self._name, self._returns, self._arguments = name, returns, arguments

    @cached_property
    def _function(self) -> Any:
        found = getattr(ctypes.PyDLL(None), self._name)
        found.restype, *found.argtypes = (
            getattr(ctypes, f"c_{kind}") for kind in (self._returns, *self._arguments)
        )
        return found

    def __call__(self, *arguments: int) -> int:
        return int(self._function(*map(int, arguments)))

    @property
    def _numba_type_(self) -> Any:
        """Return its type where numba finds it in a kernel."""
        types = compiler().types
        returns, *arguments = (getattr(types, kind) for kind in (self._returns, *self._arguments))
        return types.ExternalFunction(self._name, returns(*arguments))


recvmmsg: Final = CFunction("recvmmsg", "int32", "int32", "int64", "uint32", "int32", "int64")
sendmmsg: Final = CFunction("sendmmsg", "int32", "int32", "int64", "uint32", "int32")
clock_gettime: Final = CFunction("clock_gettime", "int32", "int32", "int64")
errno_location: Final = CFunction("__errno_location", "int64")
memcpy: Final = CFunction("memcpy", "int64", "int64", "int64", "int64")
clock_nanosleep: Final = CFunction("clock_nanosleep", "int32", "int32", "int32", "int64", "int64")
