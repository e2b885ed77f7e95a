"""Imports that load less: optional modules hidden from libraries that would load them needlessly."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def without_modules(*names: str) -> Iterator[None]:
    """Hide optional modules `names` from libraries that would load them needlessly.

    Modules loaded already stay; afterwards all can be imported again.
    """
    absent = [name for name in names if name not in sys.modules]
    for name in absent:
        sys.modules[name] = None  # type: ignore[assignment]
    try:
        yield
    finally:
        for name in absent:
            del sys.modules[name]
