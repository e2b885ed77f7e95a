"""Logs and maps that Python hands over as tables: files for the readers that are those of the commands."""

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import pyarrow as pa
import pyarrow.parquet as pq
import tomlkit

from ecu.arguments import map_file
from ecu.errors import UserError

AnyPath = str | os.PathLike[str]
Log = AnyPath | Any
"""A log by its path, or a table: of pandas, Polars or pyarrow, a `Table`, columns by name."""
Map = AnyPath | Mapping[str, Any]
"""A map by its path or name, or its content."""
_UNNAMED: Final = "__index_level_0__"


class Given:
    """What one call was given; tables are Parquet in a folder that lasts as long as the call."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._names: dict[str, str] = {}

    def log(self, log: Log) -> Path:
        """Return the file of a log. Raises UserError for what is neither file nor table."""
        if isinstance(log, str | os.PathLike):
            return Path(log)
        table = _arrow(log)
        tables = sum(name.endswith(".parquet") for name in self._names)
        path = self._path("table" if not tables else f"table-{tables + 1}", ".parquet")
        pq.write_table(table, path, compression="lz4")
        return path

    def map(self, map: Map | None) -> Path | None:
        """Return the file of a signal map or map of columns, None: none."""
        if map is None or isinstance(map, str | os.PathLike):
            return None if map is None else map_file(os.fspath(map))
        content = dict(map)
        if "database" in content:  # beside the map
            content["database"] = os.path.abspath(content["database"])
        path = self._path("map", ".toml")
        path.write_text(tomlkit.dumps(content), "utf-8")
        return path

    def _path(self, name: str, end: str) -> Path:
        path = self._folder / (name + end)
        self._names[str(path)] = name
        return path

    def said(self, text: str) -> str:
        """Return a line in which these files have the names by which a user knows them."""
        for path, name in self._names.items():
            text = text.replace(path, name)
        return text


@contextmanager
def given() -> Iterator[Given]:
    """Yield what takes the logs and maps of a call; its errors name a table as such."""
    with TemporaryDirectory(prefix="brake-ecu-") as folder:
        here = Given(Path(folder))
        try:
            yield here
        except UserError as error:
            said = [here.said(part) for part in (error.where, error.place, error.remedy)]
            if said == [error.where, error.place, error.remedy]:
                raise
            raise UserError(*said) from None


def _arrow(table: Any) -> pa.Table:
    """Return a table as Arrow, an index of times as the column t. Raises UserError: it is none."""
    try:
        found = pa.table(dict(table) if isinstance(table, Mapping) else table)
    except (TypeError, ValueError, pa.ArrowException) as error:
        reason = str(error).splitlines()[0]
        remedy = f"is neither a log nor a table of columns of one length ({reason})"
        raise UserError("log", type(table).__name__, remedy) from None
    if _UNNAMED in found.column_names:
        times = pa.types.is_temporal(found.schema.field(_UNNAMED).type)
        index = found.column(_UNNAMED)
        found = found.drop_columns([_UNNAMED])
        if times:
            found = found.add_column(0, "t", index)
    units = getattr(table, "attrs", {}).get("units", {})  # of pandas, as `Table.to_pandas` leaves them
    for place, field in enumerate(found.schema):
        if units.get(field.name):
            stated = field.with_metadata({"unit": units[field.name]})
            found = found.set_column(place, stated, found.column(place))
    return found
