"""Kernels as plain Python, several hundred times slower: for coverage, mutation tests and debuggers.

A record then has its fields as attributes, as under numba. Fields take precedence: numpy's own records hide a
field named like a numpy attribute (`sum`, `mean`, `data`).
"""

from collections.abc import Callable
from functools import cache, wraps
from typing import Any, TypeVar, cast

import numpy as np

Function = TypeVar("Function", bound=Callable[..., Any])


class _Record(np.void):  # type: ignore[misc]  # final to the type checker alone
    """One record, a view."""

    def __getattribute__(self, name: str) -> Any:
        names = np.void.__getattribute__(self, "dtype").names
        return self[name] if name in names else np.void.__getattribute__(self, name)

    def __setattr__(self, name: str, value: Any) -> None:
        self[name] = value


class _Records(np.ndarray[Any, Any]):
    """An array of records, a view: a field of it is the array of that field."""

    def __getattribute__(self, name: str) -> Any:
        names = np.ndarray.__getattribute__(self, "dtype").names
        if names and name in names:
            return np.ndarray.__getitem__(self, name).view(np.ndarray)
        return np.ndarray.__getattribute__(self, name)


@cache
def _dtype_with_attributes(dtype: np.dtype[Any]) -> np.dtype[Any]:
    """Return the same layout with `_Record` for every record in it."""
    if dtype.subdtype:
        base, shape = dtype.subdtype
        return np.dtype((_dtype_with_attributes(base), shape))
    if not dtype.names:
        return dtype
    fields: Any = dtype.fields
    layout: Any = {
        "names": list(dtype.names),
        "formats": [_dtype_with_attributes(fields[name][0]) for name in dtype.names],
        "offsets": [fields[name][1] for name in dtype.names],
        "itemsize": dtype.itemsize,
    }
    return np.dtype((_Record, np.dtype(layout)))


_PLAIN = frozenset({_Record, _Records, float, int, bool, np.float64, np.int64})


def _with_attributes(value: Any) -> Any:
    kind = type(value)
    if kind is np.ndarray and value.dtype.names:
        return value.view(_dtype_with_attributes(value.dtype)).view(_Records)
    if kind is np.void and value.dtype.names:
        return value.view(_dtype_with_attributes(value.dtype))
    if isinstance(value, tuple):
        views = map(_with_attributes, value)
        return kind(*views) if hasattr(value, "_fields") else tuple(views)
    return value


def interpreted(function: Function) -> Function:
    """Return a kernel as plain Python; from then on numpy does not warn where IEEE 754 defines the result."""
    np.seterr(all="ignore")

    @wraps(function)
    def run(*arguments: Any) -> Any:
        return function(*[a if type(a) in _PLAIN else _with_attributes(a) for a in arguments])

    return cast(Function, run)
