"""A result as MCAP, for Foxglove and PlotJuggler: JSON messages with a JSON schema for each topic.

`/ecu` and `/corner/fl` … `/corner/rr` have a message a row, with the names of the Parquet columns (of a
corner without its suffix) and the unit in the schema's description; `/brakes` has one per application and
corner; `/frames` has the frames of the log. What is not available is left out. Log time is Unix time where
the log has a date, else nanoseconds from its start. The file's metadata hold the provenance.
"""

import heapq
import json
import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import pyarrow as pa
import pyarrow.parquet as pq

from brakelab.results.outputs import whole
from ecu import __version__
from ecu.contract.records import FRAME_ERROR, FRAME_EXTENDED, FRAME_FD, FRAME_REMOTE, RecordArray
from ecu.contract.signals import CORNERS, topic_of
from ecu.errors import UserError

SUFFIX: Final = ".mcap"
_KINDS: Final = {"string": "string", "int8": "integer", "int32": "integer", "uint32": "integer"}
_FRAME: Final = {
    "bus": ("string", "interface"),
    "id": ("integer", "identifier, 11 or 29 bits"),
    "extended": ("boolean", "29 bits"),
    "fd": ("boolean", "CAN FD"),
    "remote": ("boolean", "remote frame"),
    "error": ("boolean", "error frame"),
    "length": ("integer", "bytes"),
    "data": ("string", "hexadecimal"),
}


class Frames(NamedTuple):
    """A block of frames; `stamp_ns` in nanoseconds from the first row's time on."""

    frames: RecordArray
    interfaces: Sequence[str]
    """Names by the frames' `bus`."""


class _Message(NamedTuple):
    time_ns: int
    topic: str
    content: dict[str, Any]


def load_mcap(path: Path) -> Any:
    """Return the writer of mcap for `path`. Raises UserError if it is not installed."""
    try:
        from mcap.writer import Writer
    except ImportError:
        raise UserError(str(path), "", "MCAP needs mcap: pip install mcap") from None
    return Writer


def write_mcap(rows: Path, brakes: pa.Table, frames: Iterable[Frames], out: Path) -> None:
    """Write the finished Parquet file `rows`, the applications `brakes` and the `frames` as `out`."""
    writer_of = load_mcap(out)
    with whole(out) as part, pq.ParquetFile(rows) as source, part.open("wb") as stream:
        metadata = {key.decode(): value.decode() for key, value in (source.metadata.metadata or {}).items()}
        metadata.pop("ARROW:schema", None)
        start_ns = int(metadata.get("start_time_ns", 0))
        writer = writer_of(stream)
        writer.start(library=f"brake-ecu {__version__}")
        writer.add_metadata("brake-ecu", metadata)
        topics = {
            **_topics(source.schema_arrow),
            "/brakes": {field.name: _described(field) for field in brakes.schema},
            "/frames": _FRAME,
        }
        channels = {topic: _register(writer, topic, names) for topic, names in topics.items()}
        merged = heapq.merge(
            _row_messages(source, start_ns),
            _brake_messages(brakes, start_ns),
            _frame_messages(frames, start_ns),
            key=lambda message: message.time_ns,
        )
        for message in merged:
            time_ns = max(0, message.time_ns)
            data = json.dumps(message.content, separators=(",", ":")).encode()
            writer.add_message(channels[message.topic], time_ns, data, time_ns)
        writer.finish()


def _described(field: "pa.Field[Any]") -> tuple[str, str]:
    unit = (field.metadata or {}).get(b"unit", b"").decode()
    return _KINDS.get(str(field.type), "number"), unit


def _topics(schema: pa.Schema) -> dict[str, dict[str, tuple[str, str]]]:
    topics: dict[str, dict[str, tuple[str, str]]] = {
        topic: {} for topic in ("/ecu", *(f"/corner/{corner}" for corner in CORNERS))
    }
    for field in schema:
        topic, name = topic_of(field.name)
        topics[topic][name] = _described(field)
    return topics


def _register(writer: Any, topic: str, names: dict[str, tuple[str, str]]) -> int:
    properties = {name: {"type": kind, "description": about} for name, (kind, about) in names.items()}
    schema = {"type": "object", "title": f"brake_ecu{topic.replace('/', '.')}", "properties": properties}
    name = "brake_ecu.corner" if topic.startswith("/corner") else str(schema["title"])
    number = writer.register_schema(name=name, encoding="jsonschema", data=json.dumps(schema).encode())
    return int(writer.register_channel(topic=topic, message_encoding="json", schema_id=number))


def _row_messages(source: pq.ParquetFile, start_ns: int) -> Iterator[_Message]:
    for group in range(source.num_row_groups):
        table = source.read_row_group(group)
        places = [(name, *topic_of(name)) for name in table.column_names]
        columns: dict[str, list[Any]] = {name: table.column(name).to_pylist() for name in table.column_names}
        for row, t in enumerate(columns["t"]):
            content: dict[str, dict[str, Any]] = {}
            for column, topic, name in places:
                value = columns[column][row]
                message = content.setdefault(topic, {})
                if value is not None and not (isinstance(value, float) and not math.isfinite(value)):
                    message[name] = value
            time_ns = start_ns + round(t * 1e9)
            for topic, message in content.items():
                yield _Message(time_ns, topic, message)


def _brake_messages(brakes: pa.Table, start_ns: int) -> Iterator[_Message]:
    rows = sorted(brakes.to_pylist(), key=lambda row: float(row["t_start"]))
    for row in rows:
        known = {
            name: value
            for name, value in row.items()
            if value is not None and not (isinstance(value, float) and not math.isfinite(value))
        }
        yield _Message(start_ns + round(row["t_start"] * 1e9), "/brakes", known)


def _frame_messages(blocks: Iterable[Frames], start_ns: int) -> Iterator[_Message]:
    for block in blocks:
        columns = (block.frames[name].tolist() for name in ("stamp_ns", "can_id", "flags", "bus", "length"))
        data = block.frames["data"].tobytes()
        for i, (stamp_ns, can_id, flags, bus, length) in enumerate(zip(*columns, strict=True)):
            content = {
                "bus": block.interfaces[bus] if bus < len(block.interfaces) else str(bus),
                "id": can_id,
                "extended": bool(flags & FRAME_EXTENDED),
                "fd": bool(flags & FRAME_FD),
                "remote": bool(flags & FRAME_REMOTE),
                "error": bool(flags & FRAME_ERROR),
                "length": length,
                "data": data[64 * i : 64 * i + length].hex(),
            }
            yield _Message(start_ns + stamp_ns, "/frames", content)
