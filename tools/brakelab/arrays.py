"""Arrays of numbers, by what they hold, as columns of Arrow and out of them."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Array = NDArray[np.float64]
"""Of any shape."""

if TYPE_CHECKING:
    import pyarrow as pa


def median(values: Vector) -> float:
    """Return the median, NaN if there is a NaN or nothing; numpy's loads masked arrays first."""
    ordered = np.sort(np.asarray(values, np.float64))
    if len(ordered) == 0 or np.isnan(ordered[-1]):
        return float("nan")
    middle = len(ordered) // 2
    return float(ordered[middle] if len(ordered) % 2 else (ordered[middle - 1] + ordered[middle]) / 2.0)


def arrow_array(values: Any, kind: Any) -> "pa.Array[Any]":
    """Return a column of Arrow: null where a number is NaN, or not finite where `kind` is an integer.

    Made of its memory: `pa.array` imports pandas. `kind`: a `pyarrow.DataType`.
    """
    import pyarrow as pa

    if len(values) == 0:
        return pa.nulls(0, kind)
    if pa.types.is_string(kind):
        texts = [b"" if text is None else text.encode() for text in values]
        ends: Any = np.cumsum([0, *map(len, texts)], dtype=np.int32)
        valid: Any = np.packbits([text is not None for text in values], bitorder="little")
        data: Any = b"".join(texts)
        return pa.Array.from_buffers(kind, len(texts), [pa.py_buffer(one) for one in (valid, ends, data)])
    if pa.types.is_boolean(kind):
        bits: Any = np.packbits(values, bitorder="little")
        return pa.Array.from_buffers(kind, len(values), [None, pa.py_buffer(bits)])
    numbers = np.ascontiguousarray(values, np.float64)
    known = ~np.isnan(numbers)
    if pa.types.is_integer(kind):
        known &= np.isfinite(numbers)
        numbers = np.where(known, numbers, 0.0)
    data = numbers.astype(kind.to_pandas_dtype(), copy=False)
    nulls = None if known.all() else pa.py_buffer(np.packbits(known, bitorder="little").data)
    return pa.Array.from_buffers(kind, len(numbers), [nulls, pa.py_buffer(data)])


def numpy_array(column: "pa.ChunkedArray[Any]") -> NDArray[Any]:
    """Return a column of Arrow: numbers as float64, NaN where one is null, or texts, None where one is null.

    Of its memory: `to_numpy` imports pandas. Raises `pa.ArrowException` where a value is no number.
    """
    import pyarrow as pa

    if pa.types.is_string(column.type):
        return np.array([*column.to_pylist(), None], object)[:-1]
    numbers = column.cast(pa.float64()).combine_chunks()
    if len(numbers) == 0:
        return np.zeros(0)
    buffers: list[Any] = numbers.buffers()
    values = np.frombuffer(buffers[1], np.float64, len(numbers), 8 * numbers.offset)
    if not numbers.null_count:
        return values
    known = np.unpackbits(np.frombuffer(buffers[0], np.uint8), bitorder="little")
    return np.where(known[numbers.offset :][: len(numbers)], values, np.nan)
