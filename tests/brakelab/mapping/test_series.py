"""Series of all signals of a log."""

import warnings
from pathlib import Path

import numpy as np
import pytest

from brakelab.logs.formats import read_frames
from brakelab.logs.log_quality import LogQuality
from brakelab.mapping import series as module
from brakelab.mapping.series import read_series, the_first
from ecu.bus.database import load_database

DBC = """VERSION ""
BS_:
BU_: ECU
BO_ 256 State: 3 ECU
 SG_ Page M : 0|8@1+ (1,0) [0|255] "" ECU
 SG_ Speed m0 : 8|8@1+ (1,0) [0|255] "km/h" ECU
 SG_ Heat m1 : 16|8@1+ (1,0) [0|255] "degC" ECU
"""


def test_a_signal_that_the_multiplexer_never_selects_has_no_series(tmp_path: Path) -> None:
    (tmp_path / "car.dbc").write_text(DBC)
    log = tmp_path / "drive.log"
    log.write_text("".join(f"({0.01 * k:.6f}) can0 100#00{k % 90:02X}07\n" for k in range(300)))
    interfaces: list[str] = []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        series = read_series(read_frames(log, interfaces, LogQuality()), load_database(tmp_path / "car.dbc"))
    assert [one.signal for one in series] == ["Page", "Speed"]
    assert series[1].value[:3].tolist() == [0.0, 1.0, 2.0]


@pytest.mark.parametrize(("most", "read", "said"), [(10, 1, True), (11, 2, True), (30, 3, False)])
def test_of_a_long_log_the_first_blocks_are_read(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], most: int, read: int, said: bool
) -> None:
    monkeypatch.setattr(module, "MOST_NUMBERS", most)
    blocks = [np.full(10, k) for k in range(3)]
    assert [int(block[0]) for block in the_first(blocks, len)] == list(range(read))
    assert ("the log is long" in capsys.readouterr().err) is said
