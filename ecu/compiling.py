"""Words while kernels are compiled, which takes minutes: that it is so, and with `--verbose` each of them."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from ecu.jit import before_compiling, library, library_of, stop_listening
from ecu.output import detail, say


def _reason() -> str:
    if library("ecu") is not None and library_of("ecu.algorithm.step") is None:
        return "compiling kernels, whose library is of another text (python -m brakelab.build makes it anew)"
    return "compiling kernels that are not in the cache yet"


@contextmanager
def report_compiling() -> Iterator[None]:
    """Say so when something is compiled in this block."""
    reported = False

    def begins(dispatcher: Any) -> None:
        nonlocal reported
        if not reported:
            say(f"{_reason()}: once per version, minutes at most")
        reported = True
        function = dispatcher.py_func
        if not function.__module__.startswith("numba."):
            detail(f"compiling {function.__module__}.{function.__qualname__}")

    before_compiling(begins)
    try:
        yield
    finally:
        stop_listening(begins)
