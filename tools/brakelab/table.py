"""Columns with their units, as the Python interface hands them out; as pandas, Polars or Arrow on request."""

from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ecu.errors import UserError, closest

SHOWN: Final = 8
"""Columns that a table names of itself."""


class Table:
    """Columns of the same length."""

    def __init__(self, columns: Mapping[str, NDArray[Any]], units: Mapping[str, str]) -> None:
        self.columns = columns
        """By name; NaN: not available; shape (rows,)."""
        self.units = units
        """By name, empty: none."""

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Return a column. Raises UserError for a name that is none."""
        try:
            return self.columns[name]
        except KeyError:
            hint = closest(name, self.columns)
            remedy = f"no such column{hint}; `.columns` has all {len(self.columns)}"
            raise UserError("column", str(name), remedy) from None

    def __repr__(self) -> str:
        units = {name: f" [{unit}]" if unit else "" for name, unit in self.units.items()}
        named = [name + units.get(name, "") for name in self.columns]
        shown = ", ".join(named if len(named) <= SHOWN else [*named[:SHOWN], "…"])
        return f"{type(self).__name__} of {len(self)} rows, {len(named)} columns: {shown}"

    def _ipython_key_completions_(self) -> list[str]:
        return [*self.columns]

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(next(iter(self.columns.values()), ()))

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names of the columns."""
        return iter(self.columns)

    def to_pandas(self) -> Any:
        """Return a pandas.DataFrame; `attrs["units"]` has the units. Raises UserError without pandas."""
        frame = _module("pandas").DataFrame(dict(self.columns))
        frame.attrs["units"] = dict(self.units)
        return frame

    def to_polars(self) -> Any:
        """Return a polars.DataFrame; NaN becomes null. Raises UserError without Polars."""
        polars = _module("polars")
        return polars.from_arrow(self.to_arrow())

    def to_arrow(self) -> Any:
        """Return a pyarrow.Table; NaN becomes null, each field's metadata has its `unit`."""
        import pyarrow as pa

        arrays = {name: pa.array(column, from_pandas=True) for name, column in self.columns.items()}
        fields = [
            pa.field(name, array.type, metadata={"unit": self.units.get(name, "")})
            for name, array in arrays.items()
        ]
        return pa.Table.from_arrays([*arrays.values()], schema=pa.schema(fields))

    def where(self, rows: NDArray[np.bool_]) -> "Table":
        """Return some rows, by a mask of shape (rows,). Raises UserError for anything else."""
        mask = np.asarray(rows)
        if mask.shape != (len(self),) or mask.dtype != np.bool_:
            found = f"{mask.dtype} of shape {mask.shape}"
            raise UserError("where", found, f"give a mask of bool of shape ({len(self)},)")
        return Table({name: column[mask] for name, column in self.columns.items()}, self.units)


def _module(name: str) -> Any:
    try:
        return import_module(name)
    except ModuleNotFoundError:
        raise UserError(name, "", f"is not installed: pip install {name}; or use .columns") from None
