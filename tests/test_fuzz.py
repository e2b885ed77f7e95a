"""Damaged files: whatever a reader is given, it ends with a result or with one line that names the file.

Bytes of a good file are changed, cut, doubled, moved or overwritten by numbers that break arithmetic.
`make fuzz` tries some thousand cases more of each.
"""

import gzip
import json
import os
import shutil
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from brakelab.bench.log_formats import convert
from brakelab.logs.formats import kind_of, read_frames
from brakelab.logs.log_quality import LogQuality, SignalQuality
from brakelab.logs.signal_file import read_signals
from ecu.algorithm.step import INITIAL, new_state
from ecu.bus.database import load_database
from ecu.bus.output_map import transmit_plan
from ecu.bus.signal_map import receive_plan
from ecu.errors import RunFault, UserError
from ecu.recording.learned_range import out_of_range
from ecu.recording.recorder import layout, read_recording
from ecu.recording.ring import RECORDED, RingReader, create_ring
from ecu.recording.store import FILE, open_store, restore, save
from ecu.settings.config import load_config, new_params

ROOT = Path(__file__).parent.parent
FRAMES = 200
NUMBERS = [
    *(b"-1", b"0", b"-0", b"nan", b"inf", b"1e308", b"4294967296", b"99999999999999999999"),
    *(b"\xff" * 4, b"\0" * 8, b"\xff" * 8, b"\x7f\xff\xff\xff", b"\xff\xff\xff\x7f", b"\x00\x00\x00\x80"),
    *(b"'", b'"', b"[", b"\n", b"\r\n\r\n"),
]
KINDS = ("flip", "byte", "cut out", "put in", "number", "double", "end")


@st.composite
def damage(draw: st.DrawFn) -> list[tuple[str, float, int, bytes]]:
    """What is done to a file: kind, place as a share of its length, length, bytes."""
    place = st.one_of(st.floats(0.0, 1.0, exclude_max=True), st.floats(0.0, 0.02))
    one = st.tuples(
        st.sampled_from(KINDS),
        place,
        st.integers(1, 200),
        st.one_of(st.sampled_from(NUMBERS), st.binary(max_size=20)),
    )
    return draw(st.lists(one, min_size=1, max_size=6))


def damaged(whole: bytes, changes: list[tuple[str, float, int, bytes]]) -> bytes:
    """Return `whole` after `changes`."""
    content = bytearray(whole)
    for kind, share, length, new in changes:
        if not content:
            break
        at = int(share * len(content))
        match kind:
            case "flip":
                content[at] ^= 1 << length % 8
            case "byte":
                content[at] = length
            case "cut out":
                del content[at : at + length]
            case "put in":
                content[at:at] = new
            case "number":
                content[at : at + len(new)] = new
            case "double":
                content[at:at] = content[at : at + length]
            case "end":
                del content[at:]
    return bytes(content)


def read_log(path: Path) -> None:
    if kind_of(path) == "frames":
        for block in read_frames(path, [], LogQuality()):
            assert (block["length"] <= 64).all()
    else:
        read_signal_file(path)


def read_signal_file(path: Path) -> None:
    for block in read_signals(path, SignalQuality()):
        assert not np.isinf(block.values).any()
        assert (np.diff(block.t_ns) >= 0).all()


def read_config(path: Path) -> None:
    params = new_params(load_config(path))
    for name in params.dtype.names:
        if params[name].dtype.kind == "f":
            assert np.isfinite(params[name]).all(), name


def read_store(path: Path) -> None:
    nominal = np.full(4, 0.4)
    with closing(open_store(path.parent)) as store:
        found = restore(store, "fuzz", nominal)
    assert found is None or out_of_range(found[1], nominal) == ""


def read_folder(path: Path) -> None:
    recording = read_recording(path.parent)
    for block in read_frames(recording.frames, [], LogQuality()):
        assert (block["length"] <= 64).all()


def read_ring(path: Path) -> None:
    reader = RingReader(path)
    batch = reader.read()
    assert len(batch.records) <= 256
    reader.latest("learned")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], tuple[str, bytes]]:
    """Name and content of a good file of each kind."""
    folder = tmp_path_factory.mktemp("whole")
    head = folder / "head.log"
    lines = (ROOT / "tests" / "data" / "mustang.log").read_bytes().splitlines(keepends=True)
    head.write_bytes(b"".join(lines[:FRAMES]))

    def make(kind: str) -> tuple[str, bytes]:
        path = _make(kind, folder, head)
        return path.name, path.read_bytes()

    return make


def _make(kind: str, folder: Path, head: Path) -> Path:
    t = np.arange(400) * 0.01
    table = pa.table({"t": t, "accel_x": np.sin(t), "wheel_speed_fl": 10 + t, "pedal_pressed": t > 2.0})
    if kind == ".log":
        return head
    if kind in (".asc", ".trc", ".blf", ".mf4"):
        return Path(convert(head, folder / f"drive{kind}"))
    if kind.endswith(".gz"):
        path = folder / f"drive{kind}"
        path.write_bytes(gzip.compress(_make(kind[:-3], folder, head).read_bytes()))
        return path
    if kind == ".csv":
        path = folder / "drive.csv"
        path.write_text(
            "t,accel_x\n" + "".join(f"{a:.3f},{b:.4f}\n" for a, b in zip(t, np.sin(t), strict=True))
        )
        return path
    if kind == ".parquet":
        pq.write_table(table, folder / "drive.parquet", compression="zstd", row_group_size=100)
        return folder / "drive.parquet"
    if kind == "outputs":
        path = folder / "outputs.toml"
        shipped_map = (ROOT / "config" / "maps" / "mustang.toml").read_text()
        path.write_text(f'output_database = "../../dbc/brake_ecu.dbc"\n{shipped_map}{OUTPUTS}')
        return path
    shipped = {"config": "config/suv.toml", "map": "config/maps/mustang.toml", "dbc": "dbc/brake_ecu.dbc"}
    if kind in shipped:
        return ROOT / shipped[kind]
    return {"store": _store, "recording": _recording, "ring": _ring}[kind](folder, head)


def _store(folder: Path, head: Path) -> Path:
    learned = new_state(new_params(load_config(ROOT / "config" / "suv.toml")))["learned"].copy()
    with closing(open_store(folder)) as store:
        for revision in range(3):
            learned["brakings"] = revision
            save(store, "fuzz", learned)
    return folder / FILE


def _recording(folder: Path, head: Path) -> Path:
    about = {"start_ns": 1, "record": layout(RECORDED), "state": layout(INITIAL), "channel": "can0"}
    (folder / "recording.json").write_text(json.dumps(about))
    return folder / "recording.json"


def _ring(folder: Path, head: Path) -> Path:
    create_ring(folder / "ring", {"channel": "x"}, b"state", slots=8, frames=16)
    return folder / "ring"


OUTPUTS = """
[messages.PressureDemandFront]
period = 0.02
checksum = "autosar_p01"
data_id = 0x5A01
counter = { signal = "alive_counter" }
constants = { pressure_demand_fr = 7 }
[outputs.pressure_demand_fl]
message = "PressureDemandFront"
signal = "pressure_demand_fl"
unit = "bar"
factor = 0.5
offset = 0.1
invalid = 65.535
validity = { signal = "pressure_demand_valid", valid = 1, invalid = 0 }
"""


READERS: dict[str, Callable[[Path], Any]] = {
    ".log": read_log,
    ".asc": read_log,
    ".trc": read_log,
    ".blf": read_log,
    ".mf4": read_log,
    ".log.gz": read_log,
    ".asc.gz": read_log,
    ".csv": read_signal_file,
    ".parquet": read_signal_file,
    "config": read_config,
    "map": receive_plan,
    "outputs": lambda path: transmit_plan(path, receive_plan(path)),
    "dbc": load_database,
    "store": read_store,
    "recording": read_folder,
    "ring": read_ring,
}
SLOW = {".mf4": 4, "dbc": 4, "map": 4, "outputs": 4}
"""By how much fewer cases."""


@pytest.mark.timeout(900)
@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("kind", READERS)
@pytest.mark.requirement("REQ-KEEP-4")
def test_a_damaged_file_gives_a_result_or_one_line(
    kind: str, whole: Callable[[str], tuple[str, bytes]], tmp_path: Path
) -> None:
    name, content = whole(kind)
    if kind in ("map", "outputs"):
        shutil.copytree(ROOT / "dbc", tmp_path / "dbc")
    path = tmp_path / "of" / "kind" / name
    path.parent.mkdir(parents=True)
    _write(kind, path, content)
    READERS[kind](path)  # as it was
    cases = int(os.environ.get("FUZZ_CASES", "40")) // SLOW.get(kind, 1)

    @settings(max_examples=cases, suppress_health_check=list(HealthCheck), database=None)
    @given(damage())
    def run(changes: list[tuple[str, float, int, bytes]]) -> None:
        for left in path.parent.iterdir():
            left.unlink()
        _write(kind, path, damaged(content, changes))
        message = ""
        try:
            READERS[kind](path)
        except (UserError, RunFault) as error:
            message = str(error)
        assert "\n" not in message
        assert len(message) < 1000

    run()


def _write(kind: str, path: Path, content: bytes) -> None:
    """Write a file and what lies beside it."""
    path.write_bytes(content)
    path.chmod(0o600)
    if kind == "recording":
        (path.parent / "cycles.bin").write_bytes(bytes(3 * RECORDED.itemsize))
        (path.parent / "initial.bin").write_bytes(bytes(INITIAL.itemsize))
        (path.parent / "frames.log").write_text("(1.000000) can0 123#00\n" * 3)


def test_every_damage_changes_something() -> None:
    whole = bytes(range(256))
    for kind in KINDS:
        assert damaged(whole, [(kind, 0.5, 3, b"new")]) != whole
