"""Records that Python hands to a kernel of numba's: taken by their address.

numba asks a record for its buffer, for which numpy writes down the format of every field: 6 µs for each
record of each call. A record holds its address behind its head (`PyVoidScalarObject`,
numpy/arrayscalars.h).
"""

from typing import Any, Final

from numba.core import cgutils, types
from numba.core.boxing import NativeValue  # the module that tells numba of its own way
from numba.core.pythonapi import _unboxers

HEAD: Final = object.__basicsize__ + tuple.__itemsize__
"""Bytes of the head of an object of variable size."""


def _address(kind: Any, record: Any, at: Any) -> Any:
    """Return the native value of a record."""
    pointer = at.context.get_value_type(kind).as_pointer()
    return NativeValue(at.builder.load(cgutils.pointer_add(at.builder, record, HEAD, pointer)))


def take_records_by_address() -> None:
    """Have what numba compiles from now on take records so."""
    _unboxers.functions[types.Record] = _address
