"""Columns of a Parquet file, read when they are asked for."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from brakelab.arrays import Vector, numpy_array
from brakelab.results import mcap_file, mdf
from ecu.errors import UserError

KEPT: Final = 128 << 20  # bytes of columns of one length
EXPORTS: Final = (mdf.SUFFIX, mcap_file.SUFFIX)
"""Endings of results for other programs; this one does not read them."""

Values = NDArray[Any]


class Columns(Mapping[str, Values]):
    """Columns, all of one length, that `read` makes when asked for; the last `KEPT` bytes are kept."""

    def __init__(self, names: Iterable[str], read: Callable[[str], Values]) -> None:
        self._names, self._read = dict.fromkeys(names), read
        self._kept: dict[str, Values] = {}

    def __getitem__(self, name: str) -> Values:
        if name not in self._names:
            raise KeyError(name)
        values = self._kept.pop(name, None)
        self._kept[name] = values = self._read(name) if values is None else values
        while len(self._kept) > 1 and len(self._kept) * values.nbytes > KEPT:
            del self._kept[next(iter(self._kept))]
        return values

    def __contains__(self, name: object) -> bool:
        return name in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


class Stored(NamedTuple):
    """An open file."""

    path: Path
    columns: Columns
    """float64 with NaN for null, text as objects; shape (rows,)."""
    schema: pa.Schema
    rows: int
    metadata: dict[str, str]

    def numbers(self, name: str) -> Vector:
        """Return a column, shape (rows,); UserError when it holds no numbers."""
        values = self.columns[name]
        if values.dtype == object:
            kind = self.schema.field(name).type
            raise UserError(str(self.path), f"column {name}", f"holds {kind}; numbers are needed")
        return values

    def known_numbers(self, name: str) -> Vector:
        """Return a column, shape (rows,), all NaN where the file lacks it."""
        return self.numbers(name) if name in self.columns else np.full(self.rows, np.nan)


def open_columns(path: Path, remedy: str, required: Iterable[str] = ()) -> Stored:
    """Open a Parquet file; what is open can be read when its name is gone, too.

    Raises:
        UserError: it is missing, for other programs, or lacks a column of `required`; it cannot be read, now
            or when a column is.
    """
    if path.suffix in EXPORTS:
        raise UserError(str(path), "", "results are read from Parquet; `replay` with --out RESULT.parquet")
    if not path.is_file():
        raise UserError(str(path), "is a folder" if path.is_dir() else "no such file", remedy)
    with _readable(path, remedy):
        file = pq.ParquetFile(path)

    def read(name: str) -> Values:
        with _readable(path, remedy):
            return numpy_array(file.read([name]).column(0))

    schema = file.schema_arrow
    for name in required:
        if name not in schema.names:
            raise UserError(str(path), f"column {name}: missing", remedy)
    stored = (file.metadata.metadata or {}).items()
    metadata = {key.decode(errors="replace"): text.decode(errors="replace") for key, text in stored}
    return Stored(path, Columns(schema.names, read), schema, file.metadata.num_rows, metadata)


@contextmanager
def _readable(path: Path, remedy: str) -> Iterator[None]:
    try:
        yield
    except (pa.ArrowException, OSError, ValueError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise UserError(str(path), f"not a readable Parquet file ({reason})", remedy) from error
