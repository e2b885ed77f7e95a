"""Where the repository's databases and the recorded drives are, and frames for kernels."""

import os
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from ecu.bus.e2e import AUTOSAR_P01, protect
from ecu.contract.records import FRAME, RecordArray

ROOT = Path(__file__).parents[3]
LINE = re.compile(r"^\((\d+)\.(\d{6})\) (\S+) ([0-9A-F]+)#([0-9A-F]*)", re.MULTILINE)


@pytest.fixture(scope="session")
def root() -> Path:
    return ROOT


@pytest.fixture(scope="session")
def contract() -> Path:
    return ROOT / "dbc" / "brake_ecu.dbc"


@pytest.fixture(scope="session")
def drives() -> Path:
    folder = Path(os.environ.get("BRAKE_ECU_SHARED") or ROOT.parent / "shared") / "drives"
    if not folder.is_dir():
        pytest.skip("the recorded drives are not beside the checkout (set BRAKE_ECU_SHARED)")
    return folder


def _frame(stamp_ns: int, can_id: int, data: bytes, flags: int = 0) -> RecordArray:
    frames = np.zeros(1, FRAME)
    frames["stamp_ns"], frames["can_id"], frames["flags"] = stamp_ns, can_id, flags
    frames["length"] = len(data)
    frames["data"][0, : len(data)] = np.frombuffer(data, np.uint8)
    return frames


@pytest.fixture(scope="session")
def frame() -> Callable[..., RecordArray]:
    """frame(stamp_ns, can_id, data, flags=0) -> one FRAME, shape (1,)."""
    return _frame


@pytest.fixture(scope="session")
def read_log() -> Callable[[Path, str], RecordArray]:
    """read_log(path, bus) -> the frames of one interface of a candump log."""

    @cache
    def read(path: Path, bus: str) -> RecordArray:
        found = [m.groups() for m in LINE.finditer(path.read_text()) if m[3] == bus]
        frames = np.zeros(len(found), FRAME)
        frames["stamp_ns"] = [(int(s) * 1_000_000 + int(us)) * 1000 for s, us, *_ in found]
        frames["can_id"] = [int(can_id, 16) for *_, can_id, _ in found]
        payloads = [bytes.fromhex(data) for *_, data in found]
        frames["length"] = [len(data) for data in payloads]
        whole = b"".join(data.ljust(frames["data"].shape[1], b"\0") for data in payloads)
        frames["data"] = np.frombuffer(whole, np.uint8).reshape(frames["data"].shape)
        frames.flags.writeable = False
        return frames

    return read


def p01_protect(data: NDArray[np.uint8], length: int, data_id: int, counter: int) -> None:
    """Write counter and CRC of Profile 1 into a payload."""
    data[1] = data[1] & 0xF0 | counter
    protect(AUTOSAR_P01, data, length, 0, data_id)
