"""Series of all signals of a log."""

import warnings
from pathlib import Path

from brakelab.logs.formats import read_frames
from brakelab.logs.log_quality import LogQuality
from brakelab.mapping.series import read_series
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
