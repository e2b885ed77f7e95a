"""One drive as a log of every format, by python-can's and asammdf's writers, for bench and tests."""

from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

import can
import numpy as np
from asammdf import MDF, Signal, Source
from asammdf.blocks import v4_constants as mdf_constants
from can.io import ASCWriter, BLFWriter, CanutilsLogWriter, TRCWriter
from numpy.typing import NDArray

from brakelab.logs.formats import read_frames
from brakelab.logs.log_quality import LogQuality
from ecu.contract.records import FRAME_ERROR, FRAME_EXTENDED, FRAME_FD, FRAME_REMOTE, RecordArray

WRITERS: Final[dict[str, Any]] = {
    ".log": CanutilsLogWriter,
    ".asc": ASCWriter,
    ".blf": BLFWriter,
    ".trc": TRCWriter,
}
FORMATS: Final = (*WRITERS, ".mf4")


def convert(log: Path, out: Path) -> Path:
    """Write a log as `out`, in the format of its suffix; return `out`."""
    interfaces: list[str] = []
    frames = np.concatenate(list(read_frames(log, interfaces, LogQuality())))
    if out.suffix == ".mf4":
        return write_mdf(out, frames, interfaces)
    return write(out, messages(frames, interfaces))


def write(out: Path, sent: Iterable[can.Message], **options: Any) -> Path:
    """Write messages with python-can's writer for the suffix of the name; return `out`."""
    with WRITERS[out.suffix](out, **options) as writer:
        for message in sent:
            writer.on_message_received(message)
    return out


def messages(frames: RecordArray, interfaces: list[str]) -> Iterator[can.Message]:
    """Yield FRAME records as python-can's messages."""
    for frame in frames:
        yield can.Message(
            timestamp=int(frame["stamp_ns"]) / 1e9,
            arbitration_id=int(frame["can_id"]),
            is_extended_id=bool(frame["flags"] & FRAME_EXTENDED),
            is_fd=bool(frame["flags"] & FRAME_FD),
            is_remote_frame=bool(frame["flags"] & FRAME_REMOTE),
            is_error_frame=bool(frame["flags"] & FRAME_ERROR),
            data=bytes(frame["data"][: frame["length"]]),
            channel=interfaces[frame["bus"]],
        )


def bus_logging(kind: str, frames: RecordArray, interfaces: list[str]) -> NDArray[Any]:
    """Return frames as samples of the ASAM bus logging channel `kind`."""
    size = max(8, int(frames["length"].max()))
    columns = {
        "BusChannel": ("u1", np.array([int(name[-1]) + 1 for name in interfaces])[frames["bus"]]),
        "ID": ("<u4", frames["can_id"]),
        "IDE": ("u1", frames["flags"] & FRAME_EXTENDED != 0),
        "DLC": ("u1", np.searchsorted([*range(9), 12, 16, 20, 24, 32, 48, 64], frames["length"])),
        "DataLength": ("u1", frames["length"]),
        "DataBytes": (f"({size},)u1", frames["data"][:, :size]),
        "Dir": ("u1", 0),
        "EDL": ("u1", frames["flags"] & FRAME_FD != 0),
    }
    samples = np.zeros(len(frames), [(f"{kind}.{name}", dtype) for name, (dtype, _) in columns.items()])
    for name, (_, values) in columns.items():
        samples[f"{kind}.{name}"] = values
    return samples


def write_mdf(out: Path, frames: RecordArray, interfaces: list[str], compression: Any = 2) -> Path:
    """Write MDF4 bus logging: a group of data frames for each interface, and one of error frames."""
    start_ns = int(frames["stamp_ns"].min()) // 1000 * 1000
    source = Source("CAN", "CAN", "", mdf_constants.SOURCE_BUS, mdf_constants.BUS_TYPE_CAN)
    with MDF(version="4.10") as mdf:
        seconds = datetime.fromtimestamp(start_ns // 1_000_000_000, UTC)
        mdf.start_time = seconds.replace(microsecond=start_ns // 1000 % 1_000_000)
        errors = frames["flags"] & FRAME_ERROR != 0
        groups = [("CAN_ErrorFrame", errors)]
        groups += [("CAN_DataFrame", ~errors & (frames["bus"] == bus)) for bus in range(len(interfaces))]
        for kind, chosen in groups:
            if chosen.any():
                samples = bus_logging(kind, frames[chosen], interfaces)
                t = (frames["stamp_ns"][chosen] - start_ns) * 1e-9
                mdf.append(Signal(samples, t, name=kind, source=source))
        level: Any = compression
        mdf.save(out, overwrite=True, compression=level)
    return out
