"""Words while kernels are compiled, which takes minutes: that it is so, and with `--verbose` each of them."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numba.core.event as numba_event

from ecu.output import detail, say


class _Words(numba_event.Listener):  # type: ignore[misc]
    def __init__(self) -> None:
        self.told = False

    def on_start(self, event: Any) -> None:
        if not self.told:
            say("compiling kernels that are not in the cache yet: once per version, minutes at most")
        self.told = True
        function = event.data["dispatcher"].py_func
        if not function.__module__.startswith("numba."):
            detail(f"compiling {function.__module__}.{function.__qualname__}")

    def on_end(self, event: Any) -> None:
        pass


@contextmanager
def compiling_told() -> Iterator[None]:
    """Say so when something is compiled in this block."""
    with numba_event.install_listener("numba:compile", _Words()):
        yield
