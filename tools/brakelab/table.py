"""Columns with their units, as the Python interface hands them out; as pandas, Polars or Arrow on request."""

from collections.abc import Iterator, Mapping
from html import escape
from importlib import import_module
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ecu.contract.signals import CORNERS, OUTPUT_SIGNALS, column_names
from ecu.errors import UserError, closest

SHOWN: Final = 8
"""Columns that a table names of itself."""
_FOUR: Final = {signal.name: column_names(signal) for signal in OUTPUT_SIGNALS if signal.corners}


class Table:
    """Columns of the same length."""

    def __init__(self, columns: Mapping[str, NDArray[Any]], units: Mapping[str, str]) -> None:
        self.columns = columns
        """By name; NaN: not available; shape (rows,)."""
        self.units = units
        """By name, empty: none."""

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Return a column, shape (rows,), or by a name without its corner all four, shape (rows, 4).

        Raises UserError for a name that is none.
        """
        if name in self.columns:
            return self.columns[name]
        return np.stack([self.columns[one] for one in self._four(name)], axis=1)

    def column(self, name: str) -> NDArray[Any]:
        """Return a single column. Raises UserError for a name that is none."""
        if name not in self.columns:
            raise self._none(name)
        return self.columns[name]

    def unit(self, name: str) -> str:
        """Return the unit of a column or of four, empty: none. Raises UserError for a name that is none."""
        return self.units.get(name if name in self.columns else self._four(name)[0], "")

    def _four(self, name: str) -> tuple[str, ...]:
        columns = _FOUR.get(name, tuple(f"{name}_{corner}" for corner in CORNERS))
        if not all(column in self.columns for column in columns):
            raise self._none(name)
        return columns

    def _none(self, name: str) -> UserError:
        remedy = f"no such column{closest(name, self.columns)}; `.columns` has all {len(self.columns)}"
        return UserError("column", str(name), remedy)

    def __repr__(self) -> str:
        units = {name: f" [{unit}]" if unit else "" for name, unit in self.units.items()}
        named = [name + units.get(name, "") for name in self.columns]
        shown = ", ".join(named if len(named) <= SHOWN else [*named[:SHOWN], "…"])
        return f"{type(self).__name__} of {len(self)} rows, {len(named)} columns: {shown}"

    def _repr_html_(self) -> str:
        """Return the columns as a notebook shows them: unit, least, mean and greatest of each."""
        rows = []
        for name, column in self.columns.items():
            known = column[np.isfinite(column)] if np.issubdtype(column.dtype, np.number) else column[:0]
            figures = [f"{of(known):.4g}" if len(known) else "" for of in (np.min, np.mean, np.max)]
            rows.append([name, self.units.get(name, ""), *figures])
        return _html(self, ["column", "unit", "least", "mean", "greatest"], rows)

    def _ipython_key_completions_(self) -> list[str]:
        return [*self.columns, *(name[:-3] for name in self.columns if name.endswith(f"_{CORNERS[0]}"))]

    def __arrow_c_stream__(self, requested_schema: Any = None) -> Any:
        """Hand the columns to whatever reads Arrow: polars.DataFrame(table), DuckDB, …"""
        return self.to_arrow().__arrow_c_stream__(requested_schema)

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


class Listing(Table):
    """A table of few rows, each of which is read."""

    def _repr_html_(self) -> str:
        rows = zip(*(column.tolist() for column in self.columns.values()), strict=True)
        shown = [[f"{cell:.4g}" if isinstance(cell, float) else str(cell) for cell in row] for row in rows]
        return _html(self, [*self.columns], shown)


def _html(table: Table, head: list[str], rows: list[list[str]]) -> str:
    """Return a table as HTML; the first cell of a row is its name."""
    title = escape(repr(table).partition(":")[0])
    lines = "".join(
        f"<tr><th>{escape(name)}</th>{''.join(f'<td>{escape(cell)}</td>' for cell in cells)}</tr>"
        for name, *cells in rows
    )
    names = "".join(f"<th>{escape(each)}</th>" for each in head)
    return f"<table><caption>{title}</caption><tr>{names}</tr>{lines}</table>"


def _module(name: str) -> Any:
    try:
        return import_module(name)
    except ModuleNotFoundError:
        raise UserError(name, "", f"is not installed: pip install {name}; or use .columns") from None
