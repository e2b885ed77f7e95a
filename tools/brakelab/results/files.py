"""Results as files: `RESULT.parquet` with one row every 10 ms and `RESULT.brakes.parquet` beside it, or both
as the channel groups of one `RESULT.mf4` or the topics of one `RESULT.mcap`.

Names and units are the contract's. A quantity that is not available is null. Each field's metadata holds the
unit, the schema's metadata the provenance (version, hashes, start, quality of the input).
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Final, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from brakelab.arrays import arrow_array
from brakelab.results import mcap_file, mdf
from brakelab.results.brakes import BRAKE_UNITS, BrakeBook, BrakeRow
from brakelab.results.columns import EXPORTS, open_columns
from brakelab.results.outputs import cannot_write, unfinished, whole
from brakelab.results.pads import KEY, PadState, packed
from brakelab.results.row import MEASURED_INPUTS
from ecu.contract.records import RecordArray
from ecu.contract.signals import INPUT_SIGNALS, OUTPUT_COLUMNS, OUTPUT_SIGNALS, column_names

MEASURED: Final = tuple(INPUT_SIGNALS[place] for place in MEASURED_INPUTS)
"""Inputs that a reader needs beside the outputs, as last received."""
ROW_COLUMNS: Final = OUTPUT_COLUMNS + tuple(signal.name for signal in MEASURED)
"""A row of results without `t`: the outputs as a vector, then `MEASURED`."""
N_ROW: Final = len(ROW_COLUMNS)

_SMALL: Final = {"mode", "mode_mu_b", "pressure_demand_valid", "motor_demand_valid", "braking"}
_COUNTS: Final = {"active_faults", "active_faults_2", "overruns"}
# Dictionaries of numbers that rarely repeat cost as much time as all else, and space. The usual level of zstd
# takes an eighth more time for 6 % less, pages of the first version a fifth, to pack the places of nulls.
_QUICK: Final[dict[str, Any]] = {
    "compression": "zstd",
    "compression_level": -1,
    "use_dictionary": False,
    "data_page_version": "2.0",
    "write_statistics": ["t"],
    "write_batch_size": 1 << 16,  # a block of rows at once
}


def _row_schema() -> pa.Schema:
    fields: list[pa.Field[Any]] = [pa.field("t", pa.float64(), nullable=False, metadata={"unit": "s"})]
    for signal in OUTPUT_SIGNALS:
        kind: pa.DataType = (
            pa.int8() if signal.name in _SMALL else pa.uint32() if signal.name in _COUNTS else pa.float64()
        )
        fields += [pa.field(name, kind, metadata={"unit": signal.unit}) for name in column_names(signal)]
    fields += [pa.field(signal.name, pa.float64(), metadata={"unit": signal.unit}) for signal in MEASURED]
    return pa.schema(fields)


def _brake_schema() -> pa.Schema:
    kinds = {"brake": pa.int32(), **dict.fromkeys(("corner", "learning", "left_out"), pa.string())}
    return pa.schema(
        [
            pa.field(name, kinds.get(name, pa.float64()), metadata={"unit": u})
            for name, u in BRAKE_UNITS.items()
        ]
    )


ROW_SCHEMA: Final = _row_schema()
BRAKE_SCHEMA: Final = _brake_schema()


def brakes_path(result: Path) -> Path:
    """Return where the brake applications of `result` are: `<name>.brakes.parquet`, or in the same file."""
    return result if result.suffix in EXPORTS else result.with_name(result.stem + ".brakes.parquet")


def _table(schema: pa.Schema, columns: Sequence[NDArray[Any] | list[Any]]) -> pa.Table:
    pairs = zip(schema, columns, strict=True)
    return pa.Table.from_arrays([arrow_array(column, field.type) for field, column in pairs], schema=schema)


def brakes_table(rows: Sequence[BrakeRow]) -> pa.Table:
    """Return the table of brake applications, without metadata."""
    columns = [[getattr(row, name) for row in rows] for name in BRAKE_UNITS]
    return _table(BRAKE_SCHEMA, columns)


def _encoded(metadata: dict[str, Any]) -> dict[str, str]:
    return {name: value if isinstance(value, str) else json.dumps(value) for name, value in metadata.items()}


class ResultWriter:
    """Writer of a result by row groups; its files appear when the run is complete, or not at all."""

    def __init__(self, path: Path, params: RecordArray) -> None:
        """`params`: the parameters of `step`, shape (1,): geometry of the brakes, mass, resistances.

        Raises UserError for a `path` that ends in .mf4 or .mcap where the package for it is not installed.
        """
        if path.suffix == mdf.SUFFIX:
            mdf.load_asammdf(path)
        elif path.suffix == mcap_file.SUFFIX:
            mcap_file.load_mcap(path)
        self.path = path
        self.brakes = BrakeBook(params)
        self.provenance: dict[str, Any] = {}
        """Into the schema's metadata with the first rows: text as it is, everything else as JSON."""
        self.quality: list[dict[str, Any]] = []
        """Findings known at the end only: into the file's metadata under `quality`."""
        self.pads: list[PadState] = []
        """Likewise, under `pads`."""
        self.frames: Iterable[mcap_file.Frames] = ()
        """Of the logs, for a result as MCAP; read when everything else is complete."""
        self.rows = 0
        self._unfinished = unfinished(path.with_suffix(".parquet"))
        self._file: pq.ParquetWriter | None = None
        self._side = ThreadPoolExecutor(1, "brake-ecu writes rows")
        self._writing: Future[None] | None = None

    def write(self, t: NDArray[np.float64], rows: NDArray[np.float64]) -> None:
        """Append rows: `t` [s], shape (n,), `rows` in the order of `ROW_COLUMNS`, shape (n, N_ROW).

        Another thread encodes them: both are to stay as they are.
        """
        self._wait()
        file = self._open()
        self._writing = self._side.submit(lambda: file.write_table(_table(ROW_SCHEMA, [t, *rows.T])))
        self.brakes.add(t, rows)
        self.rows += len(t)

    def _wait(self) -> None:
        """Wait for the rows that are being written; raise what that raised."""
        writing, self._writing = self._writing, None
        if writing is not None:
            try:
                writing.result()
            except OSError as error:
                raise cannot_write(self.path, error) from None

    def restart(self) -> None:
        """Forget what was written: the rows come once more."""
        self._wait()
        if self._file is not None:
            self._file.close()
            self._file = None
        self.brakes.rows.clear()
        self.rows = 0

    def _open(self) -> pq.ParquetWriter:
        if self._file is None:
            schema = ROW_SCHEMA.with_metadata(_encoded(self.provenance))
            try:
                self.path.parent.mkdir(parents=True, exist_ok=True)
                self._file = pq.ParquetWriter(self._unfinished, schema, **_QUICK)
            except OSError as error:
                raise cannot_write(self.path, error) from None
        return self._file

    def __enter__(self) -> "ResultWriter":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: object, trace: TracebackType | None) -> None:
        self._side.shutdown()
        try:
            if kind is None:
                self._wait()
                self._finish()
        except OSError as failed:
            raise cannot_write(self.path, failed) from None
        finally:
            with suppress(OSError):  # of a full disk that already has its line
                if self._file is not None:
                    self._file.close()
            with suppress(OSError):
                self._unfinished.unlink(missing_ok=True)

    def _finish(self) -> None:
        file = self._open()
        file.add_key_value_metadata({"quality": json.dumps(self.quality), KEY: json.dumps(packed(self.pads))})
        file.close()
        self.brakes.end_log()
        table = brakes_table(self.brakes.rows).replace_schema_metadata(_encoded(self.provenance))
        if self.path.suffix == mdf.SUFFIX:
            mdf.write_mdf(self._unfinished, table, self.path)
        elif self.path.suffix == mcap_file.SUFFIX:
            mcap_file.write_mcap(self._unfinished, table, self.frames, self.path)
        else:
            with whole(brakes_path(self.path)) as part:
                pq.write_table(table, part, compression="zstd")
            self._unfinished.replace(self.path)


class Result(NamedTuple):
    """A result file."""

    columns: Mapping[str, NDArray[Any]]
    """By name, float64 (text: object); null is NaN; shape (rows,); read when asked for."""
    units: dict[str, str]
    metadata: dict[str, str]


def read_result(path: Path) -> Result:
    """Return the columns, units and provenance of a result (or of its brakes).

    Raises UserError if it cannot be read.
    """
    stored = open_columns(path, "give a result of `brake-ecu replay`")
    units = {field.name: (field.metadata or {}).get(b"unit", b"").decode() for field in stored.schema}
    metadata = {key: text for key, text in stored.metadata.items() if key != "ARROW:schema"}
    return Result(stored.columns, units, metadata)
