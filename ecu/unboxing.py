"""Records that Python hands to a kernel of numba's: taken by their address.

numba asks a record for its buffer, for which numpy writes down the format of every field: 6 µs for each
record of each call. A record holds its address behind its head (`PyVoidScalarObject`,
numpy/arrayscalars.h).
"""

from typing import Any, Final

HEAD: Final = object.__basicsize__ + tuple.__itemsize__
"""Bytes of the head of an object of variable size."""


def take_records_by_address() -> None:
    """Have what numba compiles from now on take records so."""
    from numba.core import cgutils, types  # where something has to be compiled
    from numba.core.boxing import NativeValue  # the module that tells numba how it takes them itself
    from numba.core.pythonapi import _unboxers

    def address(kind: Any, record: Any, at: Any) -> Any:
        pointer = at.context.get_value_type(kind).as_pointer()
        return NativeValue(at.builder.load(cgutils.pointer_add(at.builder, record, HEAD, pointer)))

    _unboxers.functions[types.Record] = address
