"""Calls of compiled kernels as C can repeat them: places of a block, and memory that they point into.

A kernel of a library takes a block of places (`ecu/library.py`). Here a call is made ready with arrays of
Python, and what is an address in its block becomes an offset in one memory that holds a copy of all of them.
"""

from collections.abc import Callable, Iterable, Iterator
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu import jit
from ecu.errors import UserError
from ecu.library import Library, Spec, places_of, spec_of

NOISE: Final = np.dtype([("state", "u8", (2,)), ("step", "u8", (2,)), ("kept", "u8"), ("value", "u8")])
"""A generator of numpy's PCG64 as c/instance.c has it, halves of 128 bits with the low one first."""
NEXT: Final = (-1, -2, -3)
"""Targets in place of offsets: functions that give a generator's next number of 64 bits, 32, and below 1."""
_LINE: Final = 64  # bytes, of the processor's cache
_REMEDY: Final = "is not made of this text; run python -m brakelab.build first"


class Call(NamedTuple):
    """A kernel with its arguments."""

    name: str
    symbol: str
    library: Library
    places: list[int]
    """Of the arguments, and of what it returns."""
    at: list[int]
    """Place of each argument, and of what it returns."""
    targets: dict[int, int]
    """Offset in the memory, or one of `NEXT`, by place."""


class Memory:
    """Copies of arrays, one behind the other; a view lies within the array that it is a view of."""

    def __init__(self, arrays: Iterable[NDArray[Any]]) -> None:
        self._arrays = list(arrays)
        self._offsets, self.size = list[int](), 0
        for array in self._arrays:
            self._offsets.append(self.size)
            self.size += -(-array.nbytes // _LINE) * _LINE

    def offset(self, address: int) -> int:
        """Return the offset of what is at an address in this process. Raises LookupError: in no array."""
        for array, offset in zip(self._arrays, self._offsets, strict=True):
            first = array.ctypes.data
            if first <= address < first + array.nbytes:
                return offset + address - first
        raise LookupError(f"{address:#x} is in no array")

    def content(self) -> bytes:
        """Return the memory as it is now."""
        whole = np.zeros(self.size, np.uint8)
        for array, offset in zip(self._arrays, self._offsets, strict=True):
            whole[offset : offset + array.nbytes] = np.frombuffer(array.tobytes(), np.uint8)
        return whole.tobytes()


def arrays_in(value: Any) -> Iterator[NDArray[Any]]:
    """Yield the arrays in a tuple of tuples and arrays that hold anything."""
    if isinstance(value, np.ndarray) and value.nbytes:
        yield value
    elif isinstance(value, tuple):
        for part in value:
            yield from arrays_in(part)


def noise_state(source: np.random.Generator) -> NDArray[Any]:
    """Return `NOISE`, shape (1,), of a generator of numpy's PCG64 that has drawn nothing yet."""
    known = source.bit_generator.state
    assert known["bit_generator"] == "PCG64"
    record = np.zeros(1, NOISE)
    for field, value in (("state", known["state"]["state"]), ("step", known["state"]["inc"])):
        record[field] = value % 2**64, value >> 64
    return record


def compiled_call(
    name: str, kernel: Callable[..., Any], arguments: tuple[Any, ...], memory: Memory, noise: int = 0
) -> Call:
    """Return the call of a kernel with these arguments.

    Args:
        name: by which C calls it.
        kernel: compiled into the library of its package.
        arguments: arrays, and records and views of them, are in `memory`.
        memory: of which the offsets are.
        noise: address of `NOISE`, in `memory`, of an argument that is a generator.

    Raises:
        UserError: the library lacks it, or was made of another text.
    """
    package = kernel.__module__.partition(".")[0]
    library = jit.library_of(kernel.__module__)
    full = f"{kernel.__module__}.{kernel.__qualname__}"
    if library is None:
        raise UserError(f"compiled library of {package}", "", _REMEDY)
    rows = library.manifest["kernels"].get(full, [])
    for row, entry in zip(rows, library.entries(full), strict=True):
        if entry.count == len(arguments) and (block := entry.take(arguments)) is not None:
            specs = [spec_of(argument) or ("none",) for argument in arguments]
            at = [0]
            for spec in specs:
                at.append(at[-1] + places_of(spec))
            targets: dict[int, int] = {}
            for first, spec, argument in zip(at, specs, arguments, strict=False):
                targets |= _targets(first, spec, argument, memory, noise)
            return Call(name, row["symbol"], library, block.values.tolist(), at, targets)
    raise UserError(f"compiled library of {package}", full, _REMEDY)


def _targets(at: int, spec: Spec, value: Any, memory: Memory, noise: int) -> dict[int, int]:
    """Return the targets of the places of an argument."""
    if spec[0] == "record":
        return {at: memory.offset(np.frombuffer(value, np.uint8).ctypes.data)}
    if spec[0] == "array":
        return {at + 4: memory.offset(value.ctypes.data) if value.nbytes else 0}
    if spec[0] == "generator":
        state = memory.offset(noise)
        return {
            at + 1: state,
            at + 2: state,
            at + 3: NEXT[0],
            at + 4: NEXT[1],
            at + 5: NEXT[2],
            at + 6: state,
        }
    found: dict[int, int] = {}
    if spec[0] == "tuple":
        for inside, part in zip(spec[2:], value, strict=True):
            found |= _targets(at, inside, part, memory, noise)
            at += places_of(inside)
    return found
