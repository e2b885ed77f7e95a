"""What tests of several formats share: reading, messages as python-can has them, a computer in Berlin."""

import time
from collections.abc import Iterator
from pathlib import Path

import can
import numpy as np
import pytest
from hypothesis import strategies as st

from brakelab.bench.log_formats import FORMATS, convert
from brakelab.logs.formats import read_frames
from brakelab.logs.log_quality import LogQuality
from ecu.contract.records import FRAME_EXTENDED, FRAME_FD, FRAME_REMOTE, RecordArray
from ecu.jit import Record

DATA = Path(__file__).parents[2] / "data"
TEXT = (".log", ".asc", ".trc")
FD_LENGTHS = [*range(9), 12, 16, 20, 24, 32, 48, 64]
STAMPS = st.integers(0, 10_000_000).map(lambda us: 1_600_000_000 + us / 1e6)


@pytest.fixture
def berlin(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("TZ", "CET-1CEST,M3.5.0,M10.5.0/3")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


@pytest.fixture(scope="module")
def kona(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The drive of the Kona (two buses) in every format; by time, as python-can's writers want it."""
    folder = tmp_path_factory.mktemp("kona")
    lines = (DATA / "kona.log").read_text().splitlines(keepends=True)
    (folder / "sorted.log").write_text("".join(sorted(lines, key=lambda line: line.split()[0])))
    logs = {end: convert(folder / "sorted.log", folder / f"kona{end}") for end in FORMATS}
    return logs | {"sorted": folder / "sorted.log"}


def read(path: Path, interfaces: list[str] | None = None) -> tuple[RecordArray, LogQuality]:
    quality = LogQuality()
    blocks = list(read_frames(path, interfaces if interfaces is not None else [], quality))
    return np.concatenate(blocks), quality


def identifier(message: can.Message) -> int:
    """Return what keeps messages of one stamp apart: of those that are alike the second is left out."""
    return message.arbitration_id


@st.composite
def messages(
    draw: st.DrawFn,
    fd_too: bool = True,
    fd_lengths: list[int] = FD_LENGTHS,
    least_extended: int = 0,
    stamps: st.SearchStrategy[float] = STAMPS,
    channels: st.SearchStrategy[int | str] = st.integers(0, 7),  # noqa: B008
) -> can.Message:
    """A message; remote ones only where CAN FD is too."""
    fd = fd_too and draw(st.booleans())
    extended = draw(st.booleans())
    identifiers = st.integers(least_extended, (1 << 29) - 1) if extended else st.integers(0, 0x7FF)
    length = draw(st.sampled_from(fd_lengths if fd else FD_LENGTHS[:9]))
    remote = fd_too and not fd and draw(st.booleans())
    return can.Message(
        timestamp=draw(stamps),
        arbitration_id=draw(identifiers),
        is_extended_id=extended,
        is_fd=fd,
        is_remote_frame=remote,
        bitrate_switch=fd and draw(st.booleans()),
        data=None if remote else draw(st.binary(min_size=length, max_size=length)),
        dlc=length if remote else None,
        channel=draw(channels),
        is_rx=draw(st.booleans()),
    )


def assert_is(frame: Record, message: can.Message) -> None:
    """Compare all but stamp and interface."""
    assert frame["can_id"] == message.arbitration_id
    assert bool(frame["flags"] & FRAME_EXTENDED) == message.is_extended_id
    assert bool(frame["flags"] & FRAME_REMOTE) == message.is_remote_frame
    assert bool(frame["flags"] & FRAME_FD) == message.is_fd
    assert frame["length"] == message.dlc
    if not message.is_remote_frame:
        assert bytes(frame["data"][: frame["length"]]) == bytes(message.data)
    assert not frame["data"][len(message.data) :].any()
