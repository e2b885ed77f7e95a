"""Kernels as plain Python that note how Python calls them."""

import os
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numba

from ecu import jit
from ecu.interpreted import interpreted
from ecu.library import Spec, spec_of

OPTIONS: Final = {
    **jit.OPTIONS,
    "cache": False,
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
}


class Call(NamedTuple):
    """A kernel that Python called, and with what."""

    kernel: "Seen"
    types: tuple[Any, ...]
    specs: tuple[Spec, ...]


class Seen:
    """A kernel as plain Python, which notes how Python calls it."""

    calls: Final = dict[tuple[Any, ...], Call]()
    modules: Final = set[str]()
    every: Final = list["Seen"]()
    _depth = 0

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function
        module = jit.module_of(function)
        Seen.modules.add(module)
        self.name = f"{module}.{function.__qualname__}"
        self._plain = interpreted(function)
        self.dispatcher = numba.njit(**OPTIONS)(function)
        Seen.every.append(self)

    def __call__(self, *arguments: Any) -> Any:
        if Seen._depth == 0:
            self._note(arguments)
        Seen._depth += 1
        try:
            return self._plain(*arguments)
        finally:
            Seen._depth -= 1

    def _note(self, arguments: tuple[Any, ...]) -> None:
        specs = tuple(spec for argument in arguments if (spec := spec_of(argument)) is not None)
        if len(specs) == len(arguments):
            found = tuple(numba.typeof(argument) for argument in arguments)
            Seen.calls.setdefault((self.name, specs), Call(self, found, specs))

    @property
    def _numba_type_(self) -> Any:
        return numba.core.types.Dispatcher(self.dispatcher)


def watch() -> None:
    """Note from now on how kernels of modules that are loaded later are called; they are plain Python."""
    os.environ["NUMBA_DISABLE_JIT"] = "0"

    def noted(function: Any, parallel: bool = False, nogil: bool = False) -> Any:
        return interpreted(function) if parallel else Seen(function)

    jit.kernel = noted
