"""A result as MDF4 (ASAM MDF 4.1): rows in one channel group, brake applications in another.

Names, units and numbers are those of the Parquet files. A null is NaN, for integers an invalid sample. The
start of the measurement is the instant of `t` = 0; the header's comment holds the provenance, under the names
of the Parquet schema.

asammdf is in an extra: where it is installed, `import can` takes longer (see `ecu/bus/__init__.py`).
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from brakelab.results.outputs import whole
from ecu.errors import UserError

SUFFIX: Final = ".mf4"
_TIME: Final = 1  # synchronisation type of a master channel
_TRANSPOSED_DEFLATE: Final = 2

Samples = tuple[NDArray[Any], NDArray[np.bool_] | None]


def load_asammdf(path: Path) -> Any:
    """Return asammdf for writing `path`. Raises UserError if it is not installed."""
    try:
        import asammdf
    except ImportError:
        raise UserError(str(path), "", "MDF4 needs asammdf: pip install asammdf") from None
    return asammdf


def write_mdf(rows: Path, brakes: pa.Table, out: Path) -> None:
    """Write the finished Parquet file `rows` and the applications `brakes` as `out`."""
    asammdf = load_asammdf(out)
    with whole(out) as part, pq.ParquetFile(rows) as source, asammdf.MDF(version="4.10") as mdf:
        metadata = {key.decode(): value.decode() for key, value in (source.metadata.metadata or {}).items()}
        metadata.pop("ARROW:schema", None)
        groups = (source.read_row_group(place) for place in range(source.num_row_groups))
        first = _append(asammdf, mdf, groups, "t", "rows")
        _append(asammdf, mdf, iter([brakes]), "t_start", "brake applications")
        mdf.header.comment = _comment(metadata)
        start = metadata.get("start_time_ns")
        mdf.header.abs_time = int(start) - round(first * 1e9) if start else 0
        mdf.header.time_flags = mdf.header.tz_offset = mdf.header.daylight_save_time = 0  # UTC
        mdf.save(part, overwrite=True, compression=_TRANSPOSED_DEFLATE)


def _append(asammdf: Any, mdf: Any, tables: Iterator[pa.Table], master: str, name: str) -> float:
    """Write tables of one schema as a channel group over `master` [s]; return its first value."""
    group, first = len(mdf.groups), 0.0
    for place, table in enumerate(tables):
        t = _samples(table.column(master))[0]
        names = [column for column in table.column_names if column != master]
        columns = [_samples(table.column(column)) for column in names]
        if place:
            mdf.extend(group, [(t, None), *columns])
            continue
        first = float(t[0]) if len(t) else 0.0
        signals = [
            asammdf.Signal(
                samples,
                t,
                name=column,
                unit=(table.schema.field(column).metadata or {}).get(b"unit", b"").decode(),
                invalidation_bits=invalid,
                master_metadata=(master, _TIME),
                encoding="utf-8",
            )
            for column, (samples, invalid) in zip(names, columns, strict=True)
        ]
        mdf.append(signals, acq_name=name, comment=name, common_timebase=True)
    return first


def _samples(column: "pa.ChunkedArray[Any]") -> Samples:
    if pa.types.is_string(column.type):
        return np.char.encode(np.array(column.to_pylist(), str), "utf-8"), None
    if pa.types.is_floating(column.type):
        return column.to_numpy(), None
    values = column.cast(pa.float64()).to_numpy()
    missing = np.isnan(values)
    return np.where(missing, 0.0, values).astype(column.type.to_pandas_dtype()), missing


def _comment(metadata: dict[str, str]) -> str:
    comment = ElementTree.Element("HDcomment")
    ElementTree.SubElement(comment, "TX").text = "Result of brake-ecu"
    properties = ElementTree.SubElement(comment, "common_properties")
    for name, value in metadata.items():
        ElementTree.SubElement(properties, "e", name=name).text = value
    return ElementTree.tostring(comment, "unicode")
