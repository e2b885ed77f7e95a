"""Columns with their units, as the Python interface hands them out; as pandas, Polars or Arrow on request."""

from collections.abc import Iterator, Mapping
from html import escape
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from brakelab.results.chart import BLUE, GREEN, ORANGE, PINK, Line, Panel, chart_svg, ends_of
from brakelab.results.outputs import write_text
from ecu.contract.signals import CORNERS, OUTPUT_SIGNALS, column_names
from ecu.errors import UserError, closest

SHOWN: Final = 8
"""Columns that a table names of itself."""
_COLOURS: Final = tuple(zip(CORNERS, (BLUE, ORANGE, GREEN, PINK), strict=True))
_PANEL_PX: Final = 440
_FOUR: Final = {signal.name: column_names(signal) for signal in OUTPUT_SIGNALS if signal.corners}


class Picture:
    """Curves, which a notebook shows."""

    def __init__(self, svg: str, columns: int) -> None:
        self.svg = svg
        self._width = columns * _PANEL_PX

    def _repr_html_(self) -> str:
        return f'<div style="max-width:{self._width}px">{self.svg}</div>'

    def save(self, path: str | PathLike[str]) -> Path:
        """Write it as SVG and return the path. Raises UserError if it cannot be written."""
        write_text(Path(path), self.svg)
        return Path(path)


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
        names = self._named(name)
        return (
            np.stack([self.columns[one] for one in names], axis=1) if len(names) > 1 else self.columns[name]
        )

    def column(self, name: str) -> NDArray[Any]:
        """Return a single column. Raises UserError for a name that is none."""
        if name not in self.columns:
            raise self._none(name)
        return self.columns[name]

    def unit(self, name: str) -> str:
        """Return the unit of a column or of four, empty: none. Raises UserError for a name that is none."""
        return self.units.get(self._named(name)[0], "")

    def plot(self, *names: str, x: str | None = None, columns: int = 2) -> Picture:
        """Return a panel for each name over the column `x`, by a name without its corner the four wheels.

        `x`: None: `t`, of brake applications `t_start`. `columns`: panels in a row. Raises UserError for a
        name that is none, or has text.
        """
        if not names:
            raise UserError("plot", "", 'name what to draw: plot("mu_b", "vehicle_speed")')
        x = x or ("t_start" if "t_start" in self.columns else "t")
        along = self._number(x)
        panels, wheels = [], False
        for name in names:
            curves = self._named(name)
            wheels |= len(curves) > 1
            lines = [
                Line(along, self._number(one), colour)
                for one, (_, colour) in zip(curves, _COLOURS, strict=False)
            ]
            axes = ends_of(along, margin=0.0), ends_of(*(line.y for line in lines), margin=0.05)
            panels.append(Panel(self._with_unit(name), self._with_unit(x), *axes, lines))
        across = min(max(columns, 1), len(panels))
        return Picture(chart_svg(panels, _COLOURS if wheels else (), across), across)

    def _number(self, name: str) -> NDArray[np.float64]:
        column = self.column(name)
        if column.dtype == object:
            raise UserError("plot", name, "has text; name a column of numbers")
        return column.astype(np.float64)

    def _with_unit(self, name: str) -> str:
        unit = self.unit(name)
        return f"{name} [{unit}]" if unit else name

    def _named(self, name: str) -> tuple[str, ...]:
        """Return the column of this name, or the four."""
        if not isinstance(name, str):
            raise self._none(name)
        if name in self.columns:
            return (name,)
        columns = _FOUR.get(name, tuple(f"{name}_{corner}" for corner in CORNERS))
        if not all(column in self.columns for column in columns):
            raise self._none(name)
        return columns

    def _none(self, name: str) -> UserError:
        remedy = f"no such column{closest(str(name), self.columns)}; `.columns` has all {len(self.columns)}"
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
